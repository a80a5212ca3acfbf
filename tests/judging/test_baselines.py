"""Baselines: agreement with an error, and the two that know the time only."""

from dataclasses import replace
from itertools import pairwise
from typing import Literal

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from smallmachine import small_machine

from thermocomp.core.inputs import Support
from thermocomp.core.learned import Learned
from thermocomp.judging import splits, study
from thermocomp.judging.baselines import CURVE, SLOW, Series, compare_errors, compare_with_time, worst_of
from thermocomp.judging.compare import compare
from thermocomp.judging.do_no_harm import Verdict
from thermocomp.judging.judgedunits import JudgedUnit, measure
from thermocomp.recordings.cycles import Cycle
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.stacking import stack
from thermocomp.recordings.starts import COLD, Start
from thermocomp.report.summary import verdict

FloatArray = NDArray[np.float64]
Policy = Literal["clip", "hold", "fade"]

NOTHING = Learned(mean=0.0, last=0.0, noise=0.05, largest=20.0)
MINUTE = 60.0


def cycles(measured: FloatArray, predicted: FloatArray, n: int, records: int = 1) -> Verdict:
    """Return the verdict over a series cut into cycles, of one recording or of several one after the other."""
    units: list[JudgedUnit] = []
    rows = len(measured) // n
    for k in range(n):
        mine = slice(k * rows, (k + 1) * rows)
        record = k * records // n
        time = MINUTE * (np.arange(k * rows, (k + 1) * rows, dtype=np.float64) - record * len(measured) // records)
        of = (f"recording {record}", time)
        units.append(measure(str(k), measured[mine], predicted[mine], NOTHING, series=of))
    return Verdict(tuple(units))


def warm_up(rows: int, tau: float) -> FloatArray:
    return 20.0 * (1 - np.exp(-np.arange(rows) / tau))


def test_agreement_is_one_zero_or_minus_one() -> None:
    error = np.sin(np.linspace(0, 2 * np.pi, 1000, endpoint=False))
    other = np.cos(np.linspace(0, 2 * np.pi, 1000, endpoint=False))
    for output, wanted in ((error, 1.0), (other, 0.0), (-error, -1.0), (0.5 * error, 0.8), (0.0 * error, 0.0)):
        assert compare_errors(error - output, error, 0.01).agreement == pytest.approx(wanted, abs=1e-12)
    assert compare_errors(0.0 * error, error, 0.5).agreement == 0.0  # of the size of the noise


def test_one_warm_up_is_no_proof_however_many_cycles() -> None:
    """Drift and output warm up with different time constants: in no other way have they to do with each other."""
    rng = np.random.default_rng(0)
    drift = warm_up(480, 150.0) + 0.05 * rng.normal(size=480)
    for n in (4, 6, 8, 12):
        found = cycles(drift, warm_up(480, 100.0), n)
        assert found.word == "unproven"
        assert found.worst == SLOW
        assert "let the machine cool and record again" in found.advice


def test_what_is_faster_than_a_cycle_is_a_proof() -> None:
    rng = np.random.default_rng(0)
    heat = np.tile(np.repeat([1.0, 0.0], [40, 20]), 8)
    fast = np.convolve(heat, np.exp(-np.arange(60) / 15.0), "full")[:480]
    drift = warm_up(480, 150.0) + fast + 0.05 * rng.normal(size=480)
    same = cycles(drift, 0.9 * drift, 8)
    assert same.p_values[SLOW] < 0.001
    # each cycle the same: its curve over time explains as much
    assert cycles(drift, warm_up(480, 150.0), 8).word == "unproven"


def test_separate_warm_ups_prove_a_model_that_knows_their_size() -> None:
    sizes = np.repeat([0.3, 1.0, 0.6, 1.4, 0.8], 100)
    drift = np.tile(warm_up(100, 30.0), 5) * sizes + 0.05 * np.random.default_rng(0).normal(size=500)
    found = cycles(drift, 0.8 * np.tile(warm_up(100, 30.0), 5) * sizes, 5, records=5)
    assert found.word == "accepted"


def test_a_model_that_knows_more_than_the_curve_is_accepted_for_this_duty() -> None:
    """The same warm-up each time; of the weather, the model knows four fifths."""
    rng = np.random.default_rng(0)
    weather = [2.0 * np.sin(np.linspace(a, a + 3, 100)) for a in rng.uniform(0, 6, 6)]
    weather = [w - w[0] for w in weather]
    drift = np.concatenate([warm_up(100, 30.0) + w for w in weather]) + 0.05 * rng.normal(size=600)
    found = cycles(drift, np.concatenate([warm_up(100, 30.0) + 0.8 * w for w in weather]), 6, records=6)
    assert found.word == "accepted for this duty"
    assert found.accepted
    assert found.reason.endswith("the drift is much the same each time, so other speeds and durations are not proved")


def test_a_drift_that_is_the_same_each_time_is_known_from_its_curve() -> None:
    drift = np.tile(warm_up(100, 30.0), 5) + 0.05 * np.random.default_rng(0).normal(size=500)
    found = cycles(drift, 0.9 * np.tile(warm_up(100, 30.0), 5), 5, records=5)
    assert (found.word, found.worst) == ("unproven", CURVE)
    assert found.reason.startswith(f"not shown to be better than {CURVE}: RMS ")
    assert "record other speeds and durations" in found.advice


@given(st.integers(0, 2**32 - 1), st.integers(3, 10), st.floats(-50, 50), st.floats(-50, 50))
def test_slow_changes_of_a_recording_make_no_difference(seed: int, n: int, first: float, second: float) -> None:
    """A trend and waves that drift and output share, of whatever size."""
    rng = np.random.default_rng(seed)
    drift, output = 10.0 * rng.normal(size=(2, 40 * n))
    u = np.linspace(0, 1, 40 * n)
    slow = first * u + second * np.cos(np.pi * rng.integers(1, 2 * n + 1) * u)
    one, other = (cycles(drift + c * slow, output + c * slow, n).compared[SLOW] for c in (0.0, 1.0))
    np.testing.assert_allclose(np.array(one), np.array(other), atol=1e-6)


def test_the_curve_is_that_of_the_others_over_the_time_since_the_start_of_each() -> None:
    ramp = np.linspace(0.0, 8.0, 50)
    units = [
        Series("a", MINUTE * np.arange(60.0 * k, 60.0 * k + 50.0), level + ramp, (np.zeros(50),))
        for k, level in enumerate((1.0, 2.0, 6.0))
    ]
    curves = [curve for curve, _ in compare_with_time(units, [0.01] * 3).units]
    assert [c.other for c in curves] == pytest.approx([3.0, 1.5, 4.5])


def test_of_compensator_and_model_alone_the_worse_counts() -> None:
    error = np.sin(np.linspace(0, 7, 100))
    for order in ((0.1, 0.8), (0.8, 0.1)):
        found = worst_of([left * error for left in order], error, 0.01)
        assert found.rms == pytest.approx(0.8 * found.other)
        assert found.agreement == pytest.approx(2 * 0.2 / (1 + 0.2**2))


def test_a_model_accepted_for_a_duty_fades_outside_it() -> None:
    """The same run on six days in other weather, which the sensors show."""
    days = []
    for k, phase in enumerate(np.random.default_rng(0).uniform(0, 6, 6)):
        day = small_machine((2000.0,), seed=k)
        weather = 2.0 * (np.sin(day.time / 3000.0 + phase) - np.sin(phase))
        more = {"t1_C": 1.0, "t2_C": 1.0, "t3_C": 1.0, "z_um": 1.5}
        table = day.table.assign(**{name: day.table[name] + a * weather for name, a in more.items()})
        days.append(replace(day, name=f"day {k}", table=table))
    samples = stack(days, ["z_um"], starts=COLD)
    kinds: list[tuple[Policy, Policy]] = [("clip", "fade"), ("hold", "hold")]
    for policy, expected in kinds:
        found = study.fit(samples, "ols", splits.leave_one_file_out(samples), support=Support(policy, 0.1))
        (model,) = found.models
        assert model.honest_error is not None
        assert model.honest_error.word == "accepted for this duty"
        assert "other speeds and durations are not proved" in model.honest_error.why
        assert model.accepted
        assert model.support == Support(expected, 0.1)
        assert verdict(found.comparison).endswith("; for this duty only (z_um): the drift was much the same each time.")


def test_an_output_that_overshoots_agrees_and_is_worse_all_the_same() -> None:
    """Right for the warm-up of the recording; where it is faster, it has two and a half times the size of the drift."""
    sizes = np.repeat([1.0, 0.4, 1.6, 0.7, 1.2, 0.5], 80)
    fast = 4.0 * sizes * np.tile(np.sin(np.linspace(0, 6 * np.pi, 80)), 6)
    found = cycles(warm_up(480, 150.0) + fast, warm_up(480, 150.0) + 2.5 * fast, 6)
    assert min(a.agreement for a in found.compared[SLOW]) > 0.5
    assert found.mean_ratios[SLOW] > 0
    assert (found.word, found.p_values[SLOW]) == ("unproven", 1.0)


def test_files_that_continue_each_other_are_one_recording() -> None:
    """By their time stamps each names only the file before it."""
    whole = small_machine((1000.0, 2600.0, 1800.0), seed=4)
    ends, files = [0, 200, 400, 600], list[Recording]()
    for k, (first, end) in enumerate(pairwise(ends)):
        table = whole.table.iloc[first:end].reset_index(drop=True)
        cycle = (Cycle(str(k), 0, end - first),)
        files.append(replace(whole, name=f"part {k}", time=whole.time[: end - first], table=table, cycles=cycle))
    starts = [COLD, *(Start("continued", "stated", (before,), MINUTE) for before in files[:2])]
    samples = stack(files, ["z_um"], starts=starts)
    (found,) = compare(samples, ["ols"], splits.leave_one_file_out(samples), robustness=False, refit=False).overall()
    series = [u.series for u in found.verdict.units]
    assert all(s is not None and s.record == files[0].fingerprint for s in series)
    np.testing.assert_allclose(np.concatenate([s.time for s in series if s is not None]), whole.time)


def test_the_files_of_a_day_follow_each_other_by_their_time_stamps() -> None:
    stamps = [f"2026-03-{day:02d}T{hour:02d}:00:00" for day in (2, 3) for hour in (6, 14)]
    files = [
        replace(small_machine((speed,), seed=k), name=f"run {k}", start=stamp)
        for k, (speed, stamp) in enumerate(zip((1000.0, 2600.0, 1800.0, 3000.0), stamps, strict=True))
    ]
    samples = stack(files, ["z_um"], starts=COLD)
    (found,) = compare(samples, ["ols"], splits.leave_one_day_out(samples), robustness=False, refit=False).overall()
    for unit in found.verdict.units:
        assert unit.series is not None
        own = files[0].time
        np.testing.assert_allclose(unit.series.time, np.r_[own, 8 * 3600.0 + own])
