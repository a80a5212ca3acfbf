"""A source that is frozen at the start, and works again on a machine that is warm by then: its zero is unknown."""

import time
from dataclasses import replace
from pathlib import Path

import pytest
from test_one_word import fed, unconfirmed
from watchedmachine import watched_model

from thermocomp.core.correction import Correction, Limits
from thermocomp.core.reading import Reading
from thermocomp.core.zero import FIRST_READING
from thermocomp.live.journal.journal import JournalLimits
from thermocomp.live.journal.journalreader import JournalReader
from thermocomp.live.journal.journalrows import AlarmRow
from thermocomp.live.keeper import StateKeeper
from thermocomp.live.loop import Service
from thermocomp.live.page.snapshot import snapshot
from thermocomp.live.recorder import Recorder
from thermocomp.runtime.compensator import Compensator

REST = {"t1_C": 22.0, "t2_C": 21.0, "t3_C": 20.5, "spindle_rpm": 0.0}


def watched() -> Service:
    return Service(Compensator.of([replace(watched_model(), zeroing=FIRST_READING)], Limits(rate=1e9)), [], [])


def test_the_zero_of_stale_values_is_unknown_until_it_is_set_anew(tmp_path: Path) -> None:
    own = unconfirmed()
    own.keeper = StateKeeper(tmp_path / "state.json", own.compensator, own.clock, lambda _: None)
    own.recorder = Recorder(tmp_path / "live.db", own.compensator, "off", own.clock, JournalLimits())
    assert fed(own, [20.0] * 5)[1:] == ["holding"] * 4
    assert fed(own, [26.0, 26.1, 26.2]) == ["no zero"] * 3
    assert own.state.corrections["z_um"] == Correction(0.0)
    found = snapshot(own, 1.0)
    why = "t has changed by +6.0 degC at once, after it had repeated since the start at "
    assert found["state"]["word"] == "no zero"
    assert why in found["targets"][0]["reason"]
    assert any(why in alarm for alarm in found["alarms"])
    assert len([e for e in own.events if e.kind == "reference" and why in e.text]) == 1
    own.recorder.journal.close()
    assert own.outlets[0].sink._statuses["z_um"].word == "no zero"  # type: ignore[attr-defined]
    rows = [one.row for one in JournalReader(tmp_path / "live.db").rows()]
    assert any(why in row.text for row in rows if isinstance(row, AlarmRow))
    own.keeper.save(own.state)
    again = StateKeeper(tmp_path / "state.json", own.compensator, own.clock, lambda _: None)
    assert again.begin().orders["z_um"].word == "no zero"
    own.rezero("z_um", "cold")
    assert fed(own, [20.0, 20.0, 21.0])[1:] == ["sent, not confirmed"] * 2
    assert own.state.corrections["z_um"].offset == -2.0


@pytest.mark.parametrize("by", [0.5, 1.0])
def test_a_coarse_sensor_that_changes_at_last_keeps_its_zero(by: float) -> None:
    own = unconfirmed()
    fed(own, [20.3] * 5)
    assert fed(own, [20.3 + by]) == ["sent, not confirmed"]
    assert own.state.corrections["z_um"].offset == pytest.approx(-2.0 * by)


def test_a_change_of_readings_that_never_repeated_is_none() -> None:
    assert "no zero" not in fed(unconfirmed(), [20.0, 22.0, 24.0])


def test_messages_of_one_temperature_each() -> None:
    """The first that changes has hardly warmed."""
    own = watched()
    for _ in range(5):
        own.take(Reading(time.time(), REST))
    own.take(Reading(time.time(), {"t3_C": 20.6}))
    assert own.keeper.no_zero is None
    own.take(Reading(time.time(), {"t1_C": 30.0}))
    assert own.keeper.no_zero is not None


@pytest.mark.parametrize(("names", "held"), [(("t1_C", "t2_C"), True), (("t1_C",), False)])
def test_if_most_change_at_once_less_shows_it(names: tuple[str, ...], held: bool) -> None:
    own = watched()
    own.take(Reading(time.time(), REST))
    own.take(Reading(time.time(), REST))
    own.take(Reading(time.time(), REST | {name: REST[name] + 0.7 for name in names}))
    assert (own.keeper.no_zero is not None) == held


def test_while_the_zero_is_averaged_it_begins_anew() -> None:
    own = unconfirmed()
    own.compensator = Compensator.of([watched_model()], Limits(rate=1e9))
    own.state = own.compensator.start()
    at = time.time()
    for k in range(5):
        own.take(Reading(at + k, REST))
    assert not own.state.references
    own.take(Reading(at + 5.0, {name: v + 4.0 * (v > 0.0) for name, v in REST.items()}))
    assert own.keeper.no_zero is None
    assert own.state.averaged[0].mean[0] == 26.0
