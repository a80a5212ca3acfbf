"""When a running test may stop."""

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray

from thermocomp.core.exceptions import InputError
from thermocomp.judging.settling.stopping import foretell, judge_running
from thermocomp.recordings.recording import Recording

Curve = tuple[NDArray[np.float64], NDArray[np.float64]]


def curve(hours: float, amplitudes: list[float], taus: list[float], noise: float = 0.15, seed: int = 0) -> Curve:
    t = np.arange(0.0, hours * 3600 + 1, 60.0)
    y = sum(a * -np.expm1(-t / tau) for a, tau in zip(amplitudes, taus, strict=True))
    return t, y + np.random.default_rng(seed).normal(0, noise, len(t))


def test_the_end_of_a_curve_is_known_before_it_is_there() -> None:
    t, y = curve(2.0, [40.0], [3600.0])
    state = foretell(t, y)
    assert y[-1] < 35.0
    assert state.known
    assert state.final == pytest.approx(40.0, abs=state.uncertainty)


def test_a_curve_that_has_hardly_begun_says_nothing_of_its_end() -> None:
    assert not foretell(*curve(0.75, [10.0, 40.0], [900.0, 3 * 3600.0])).known
    assert foretell(*curve(0.4, [40.0], [600.0])).uncertainty == np.inf  # 24 min: too short
    t, y = curve(4.0, [40.0], [600.0])
    assert foretell(t[:9], y[:9]).uncertainty == np.inf


def test_what_is_said_to_be_known_is() -> None:
    """Of random curves of up to three exponentials: nine in ten known ends are within the limit."""
    rng, held = np.random.default_rng(8), []
    for seed in range(60):
        n = int(rng.integers(1, 4))
        amplitudes, taus = rng.normal(0, 20, n).tolist(), np.exp(rng.uniform(np.log(300), np.log(10800), n)).tolist()
        state = foretell(*curve(float(rng.uniform(1, 4)), amplitudes, taus, noise=0.5, seed=seed))
        if state.known:
            held.append(abs(state.final - sum(amplitudes)) <= state.limit)
    assert len(held) >= 20
    assert np.mean(held) >= 0.9


def test_noise_without_a_drift_is_at_its_end() -> None:
    state = foretell(*curve(2.0, [0.0], [600.0]))
    assert state.known
    assert abs(state.final) < 1.0


def test_missing_values_are_passed_over() -> None:
    t, y = curve(2.0, [40.0], [3600.0])
    y[3::7] = np.nan
    assert foretell(t, y).known
    empty = foretell(t, np.full(len(t), np.nan))
    assert not empty.known


def running(run_minutes: int, stop_minutes: int = 0) -> Recording:
    speed = np.r_[np.zeros(15), np.full(run_minutes, 2000.0), np.zeros(stop_minutes)]
    z = np.zeros(len(speed))
    for k in range(1, len(z)):
        z[k] = z[k - 1] + (30 * (speed[k] > 0) - z[k - 1]) * -np.expm1(-60 / 1500)
    z += np.random.default_rng(1).normal(0, 0.1, len(z))
    table = pd.DataFrame({"time_s": 60.0 * np.arange(len(speed)), "spindle_rpm": speed, "z_um": z})
    return Recording.from_dataframe(table, name="now")


def test_the_last_phase_is_judged() -> None:
    early, late, cooling = running(35), running(150), running(150, 20)
    assert not judge_running(early, ["z_um"]).may_stop
    found = judge_running(late, ["z_um"])
    assert found.may_stop
    assert "warm-up 1, 2.5 h: the steady state is known accurately enough; stop the spindle" in found.words
    cold = judge_running(cooling, ["z_um"])
    assert cold.phase.kind == "cool-down"
    assert not cold.may_stop
    assert "continue; the steady state is not known accurately enough of z_um" in cold.words
    assert "the test may end" in judge_running(running(150, 150), ["z_um"]).words


def test_a_run_of_ten_minutes_is_a_run() -> None:
    assert judge_running(running(10), ["z_um"]).phase.kind == "warm-up"
    with pytest.raises(InputError, match="has not run for 5 min yet"):
        judge_running(running(3), ["z_um"])
