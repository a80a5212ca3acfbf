"""Which test next: what is missing is proposed, and what was learned is proposed no more."""

from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from thermocomp.core.exceptions import FitError, InputError
from thermocomp.judging.planning.planning import KINDS, SPEEDS, Plan, make_grid, plan
from thermocomp.models.doubt import find_doubt
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack

TOP = 3000.0
MINUTE = 60.0


def lagged(signal: np.ndarray, tau: float) -> np.ndarray:
    found = np.zeros(len(signal))
    for k in range(1, len(signal)):
        found[k] = found[k - 1] + (signal[k] - found[k - 1]) * -np.expm1(-MINUTE / tau)
    return found


def recorded(steps: list[tuple[float, float]], room: float = 6.0, name: str = "test", seed: int = 0) -> Recording:
    """A machine of two temperatures and a drift; steps of speed [1/min] and duration [min]."""
    rng = np.random.default_rng(seed)
    speed = np.concatenate([np.full(round(minutes), v) for v, minutes in [(0.0, 15.0), *steps]])
    air = lagged(room * np.sin(np.arange(len(speed)) / 400.0), 900.0)
    heat = lagged((speed / TOP) ** 1.67, 2400.0)
    slow = lagged(air, 5400.0) + lagged(3.0 * heat, 7200.0)
    table = pd.DataFrame(
        {
            "time_s": MINUTE * np.arange(len(speed)),
            "t_bearing_C": 20.0 + 15.0 * heat + air + rng.normal(0, 0.03, len(speed)),
            "t_frame_C": 20.0 + slow + rng.normal(0, 0.03, len(speed)),
            "t_air_C": 20.0 + air + rng.normal(0, 0.03, len(speed)),
            "spindle_rpm": speed,
            "z_um": 40.0 * heat - 2.5 * slow + rng.normal(0, 0.2, len(speed)),
        }
    )
    return Recording.from_dataframe(table, name=name)


def cycles(speeds: list[float], run: float = 150.0, stop: float = 120.0) -> list[tuple[float, float]]:
    return [step for v in speeds for step in ((v, run), (0.0, stop))]


ALL = [600.0, 3000.0, 1200.0, 2400.0, 1800.0]


def planned(*recordings: Recording, swing: float = 5.0) -> Plan:
    return plan(stack(list(recordings), ["z_um"]), TOP, swing=swing)


def test_the_grid_is_all_of_one_length_and_as_stated() -> None:
    grid = make_grid(TOP, 6.0)
    assert len(grid) == len(SPEEDS) * len(KINDS) + 2
    assert {t.duration for t in grid} == {6.25 * 3600}
    assert {t.speed for t in grid} == {0.0, 600.0, 1200.0, 1800.0, 2400.0, 3000.0}
    assert {t.words for t in grid if t.speed == 600.0} == {
        "600 1/min for 0.5 h and a stop of equal length, repeated",
        "600 1/min for 3 h, then a stop of equal length",
        "600 1/min for 6 h",
    }


@pytest.mark.parametrize("seed", range(5))
def test_a_random_order_is_one_of_all_speeds_and_repeatable(seed: int) -> None:
    (trial,) = [t for t in make_grid(TOP, 10.0, seed) if t.kind == "random"]
    assert trial.words == (
        f"10 runs of 0.5 h at 600 to 3,000 1/min in a random order (seed {seed}), each with a stop of equal length"
    )
    first, second = trial.speeds[:5], trial.speeds[5:]
    assert sorted(first) == sorted(second) == [600.0, 1200.0, 1800.0, 2400.0, 3000.0]
    assert first != second
    assert trial in make_grid(TOP, 10.0, seed)
    assert trial not in make_grid(TOP, 10.0, seed + 1)


def test_a_negative_seed_is_refused() -> None:
    with pytest.raises(InputError, match="seed -1: expected 0 or a positive"):
        plan(stack([recorded(cycles(ALL))], ["z_um"]), TOP, seed=-1)


def test_a_random_order_has_the_speeds_that_are_missing() -> None:
    found = planned(recorded(cycles([600.0, 900.0, 1200.0, 700.0])))
    (varied,) = [c for c in found.candidates if c.trial.kind == "random"]
    assert varied.news == "no run at about 1,800, 2,400, 3,000 1/min"
    assert varied.gain_range == (0.5 * varied.gain, 1.7 * varied.gain)
    (whole,) = [c for c in planned(recorded(cycles(ALL))).candidates if c.trial.kind == "random"]
    assert whole.news == ""


def test_a_machine_that_was_never_fast_is_to_run_fast() -> None:
    best, *_ = planned(recorded(cycles([600.0, 900.0, 1200.0, 700.0]))).candidates
    assert best.trial.speed == TOP
    assert best.news == "no run faster than 1,200 1/min"


def test_a_room_that_never_changed_is_to_change() -> None:
    found = planned(recorded(cycles(ALL), room=0.0))
    best = found.candidates[0]
    assert best.trial.kind == "room"
    assert best.news.startswith("the room temperature changed by at most 0.")
    assert all(c.trial.kind != "room" for c in planned(recorded(cycles(ALL), room=0.0), swing=0.0).candidates)


def test_a_machine_that_never_ran_long_is_to_run_long() -> None:
    short = [step for v in ALL for step in cycles([v] * 5, 20.0, 20.0)]
    best, *_ = planned(recorded(short), swing=0.0).candidates
    assert best.trial.kind in ("run", "stop")
    assert best.news == f"no run at about this speed longer than {20 / 60:.1f} h"


def test_what_was_learned_brings_less_a_second_time() -> None:
    base = recorded(cycles([600.0, 900.0, 1200.0, 700.0]))
    before = planned(base)
    trial = before.candidates[0].trial
    done = recorded([(v, d / 60) for v, d in trial.steps[1:]], name="done", seed=1)
    after = planned(base, done)
    assert after.expected < 0.5 * before.expected
    again = next(c for c in after.candidates if c.trial == trial)
    assert again.gain < 0.3 * before.candidates[0].gain


def test_gains_are_sorted_and_never_more_than_there_is() -> None:
    found = planned(recorded(cycles(ALL)))
    gains = [c.gain for c in found.candidates]
    assert gains == sorted(gains, reverse=True)
    assert gains[-1] >= 0.0
    assert gains[0] <= found.expected


def test_a_test_takes_from_the_covariance_and_adds_nothing() -> None:
    doubt = find_doubt(stack([recorded(cycles(ALL))], ["z_um"]))
    table = doubt.table(np.full(120, 2000.0), MINUTE)
    after = doubt.after(table, 7200.0)
    assert (np.linalg.eigvalsh(doubt.covariance[0] - after.covariance[0]) > -1e-9 * np.trace(doubt.covariance[0])).all()
    assert after.spread(table)[0] < doubt.spread(table)[0]
    # two halves of a test say what the whole says
    twice = doubt.after(table, 3600.0).after(table, 3600.0)
    np.testing.assert_allclose(twice.spread(table), after.spread(table), rtol=1e-6)


def test_the_heat_of_a_test_that_was_not_run_is_foretold() -> None:
    samples = stack([recorded(cycles(ALL), room=0.0)], ["z_um"])
    doubt = find_doubt(samples)
    bearing = doubt.table(np.full(300, 2100.0), MINUTE)[-1, 0]
    heat = lagged(np.full(300, (2100.0 / TOP) ** 1.67), 2400.0)[-1]
    assert bearing == pytest.approx(15.0 * heat, abs=0.5)


def one_cycle() -> Samples:
    return stack([recorded(cycles([1200.0]))], ["z_um"])


def test_one_cycle_is_enough_to_plan_from() -> None:
    assert plan(one_cycle(), TOP).candidates[0].gain > 0


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"top_speed": -1.0}, "top speed -1 1/min"),
        ({"top_speed": 0.0}, "top speed 0 1/min"),
        ({"top_speed": float("inf")}, "top speed inf"),
        ({"hours": 1.0}, "a test of 1 h: expected 2 to 72"),
        ({"hours": float("nan")}, "expected 2 to 72"),
        ({"swing": -3.0}, "change of the room temperature -3 degC"),
    ],
)
def test_a_setting_that_cannot_be_is_refused(given: dict[str, Any], words: str) -> None:
    with pytest.raises(InputError, match=words):
        plan(one_cycle(), **{"top_speed": TOP, **given})


def test_recordings_that_cannot_be_planned_from_are_refused() -> None:
    samples = one_cycle()
    with pytest.raises(InputError, match="one spindle speed and at least one temperature"):
        plan(samples.only(["t_bearing_C", "t_air_C"]), TOP)
    with pytest.raises(InputError, match="one spindle speed and at least one temperature"):
        plan(samples.only(["spindle_rpm"]), TOP)
    with pytest.raises(FitError, match="0 rows contain all inputs and targets"):
        plan(replace(samples, deviations=np.full_like(samples.deviations, np.nan)), TOP)
    still = stack([recorded([(0.0, 300.0)])], ["z_um"])
    with pytest.raises(InputError, match="never turned in these recordings: record a run"):
        plan(still, TOP)
