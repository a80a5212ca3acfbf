"""A probing that is delivered twice is one."""

from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path

import pytest
from test_adaptation import MODEL

from thermocomp.core.reading import Reading
from thermocomp.core.thresholds import THRESHOLDS
from thermocomp.live import statefile
from thermocomp.runtime.adaptation import Probing
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.identity import KNOWN, MOST_KEYS, remember
from thermocomp.runtime.orders import rezero
from thermocomp.runtime.state import CompensatorState, resume

RUNNING = Compensator.of([MODEL])
#: as sent again and again: with an id, with a time, with both, with neither
SENT = [Probing(9.0, 0.5, keys=keys) for keys in (("id 7",), ("time 60.0",), ("id 7", "time 60.0"), ())]


def run(probings: dict[int, Probing], until: int = 1000, step: float = 60.0) -> Iterator[tuple[CompensatorState, str]]:
    state = RUNNING.start()
    for k in range(until):
        reading = Reading(step * k, {"t": 20.0, "n": 0.0})
        mine = {"z": probings[k]} if k in probings else None
        state, said = RUNNING.step(state, reading, reading.time, mine)
        yield state, said.refused.get("z", "")


def shift(state: CompensatorState) -> float:
    return float(state.learned["z"].mean[-1])


@pytest.mark.parametrize("sent", SENT)
@pytest.mark.parametrize("error", [4.0, 9.0, -15_000.0])
@pytest.mark.parametrize("rows", [(10, 11, 12), tuple(range(10, 210, 20))])
def test_delivered_often_is_delivered_once(sent: Probing, error: float, rows: tuple[int, ...]) -> None:
    sent = sent._replace(deviation=error)
    once = [shift(state) for state, _ in run({10: sent}, 300) if "z" in state.learned]
    often = list(run(dict.fromkeys(rows, sent), 300))
    assert [shift(state) for state, _ in often if "z" in state.learned] == once
    later = {often[k][1] for k in rows[1:]}
    assert later == {KNOWN} if "at most" not in often[10][1] else later <= {KNOWN, often[10][1]}


def test_one_id_or_one_time_is_one_probing_whatever_else_it_says() -> None:
    first, others = SENT[2], (SENT[0]._replace(deviation=8.5), SENT[1]._replace(deviation=8.6))
    found = list(run({10: first, 30: others[0], 50: others[1], 70: Probing(2.0, 0.5, keys=("id 8", "time 61.0"))}))
    assert [found[k][1] for k in (30, 50)] == [KNOWN] * 2
    assert not found[70][1]  # two that are two


def test_a_chip_moves_nothing_however_often_it_is_probed() -> None:
    """It is there a minute later, too, and after half an hour."""
    times = [*range(10, 20), *range(40, 100, 30)]
    each = {k: Probing(9.0 + 0.01 * k, 0.5, keys=(f"id {k}",)) for k in times}
    found = list(run(each, 100))
    assert all(found[k][1] for k in each)
    assert shift(found[-1][0]) == 0.0


def test_it_is_known_after_a_restart_and_a_new_zero(tmp_path: Path) -> None:
    state = list(run({10: SENT[0]}, 100))[-1][0]
    statefile.write(state, RUNNING, tmp_path / "state.json", datetime.now(UTC))
    saved = statefile.read(tmp_path / "state.json", RUNNING).state
    back = rezero(RUNNING, resume(saved, RUNNING.start(), 20.0), "z", 6000.0, "homing")
    reading = Reading(6020.0, {"t": 20.0, "n": 0.0})
    after, said = RUNNING.step(back, reading, reading.time, {"z": SENT[0]}, tick=1.0)
    assert said.refused == {"z": KNOWN}
    assert not after.learned


def test_it_is_forgotten_after_a_day_and_many_are_not_kept() -> None:
    state = list(run({10: SENT[3]}, 100))[-1][0]
    assert list(state.probed["z"].values()) == [600.0]
    assert remember(state, {"z": Probing(1.0, keys=("new",))}, 600.0 + THRESHOLDS.resumable + 1.0)["z"] == {
        "new": 87001.0
    }
    for k in range(2 * MOST_KEYS):
        state = state._replace(probed=remember(state, {"z": Probing(1.0, keys=(f"id {k}",))}, 700.0 + k))
    assert len(state.probed["z"]) == MOST_KEYS
    assert f"id {2 * MOST_KEYS - 1}" in state.probed["z"]


def test_what_no_model_could_use_may_come_again() -> None:
    running, state = RUNNING, RUNNING.start()
    bad, good = ({"t": float("nan"), "n": 0.0}, {"t": 20.0, "n": 0.0})
    for k, values in enumerate((good, bad, good)):
        state, said = running.step(state, Reading(60.0 * k, values), 60.0 * k, {"z": SENT[0]} if k else None)
    assert "are plausible: check the probe" in said.refused["z"]
    assert shift(state) == 0.0


def test_sound_ones_count_each() -> None:
    found = list(run({k: Probing(1.0 + 0.002 * k, 0.1) for k in range(60, 1000, 120)}))
    assert not any(why for _, why in found)
    assert shift(found[-1][0]) == pytest.approx(2.8, abs=0.3)
