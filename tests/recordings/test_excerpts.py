"""Copies of training rows that were resampled, averaged, shifted in time, rounded or made noisy are known again."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray
from smallmachine import small_machine

from thermocomp.core.exceptions import InputError, SettingError
from thermocomp.core.fingerprints import Excerpt, pack_values, unpack_values
from thermocomp.core.model import ErrorModel
from thermocomp.judging import assessing, splits, study
from thermocomp.judging.leaks import refuse_leaks
from thermocomp.recordings.cycles import make_single_cycle
from thermocomp.recordings.excerpts import find_excerpts, take_excerpts
from thermocomp.recordings.readers.recordings import read
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.stacking import stack
from thermocomp.recordings.starts import COLD
from thermocomp.virtual.datasets import record

FloatArray = NDArray[np.float64]


def with_rows(like: Recording, time: FloatArray, columns: dict[str, FloatArray]) -> Recording:
    return replace(
        like,
        name="copy",
        time=time - time[0],
        table=pd.DataFrame(columns),
        channels=tuple(like.channel(c) for c in columns),
        cycles=make_single_cycle(len(time)),
    )


def columns(recording: Recording) -> dict[str, FloatArray]:
    return {c.name: recording.table[c.name].to_numpy(float) for c in recording.channels}


def interpolated(recording: Recording, time: FloatArray) -> Recording:
    return with_rows(recording, time, {n: np.interp(time, recording.time, x) for n, x in columns(recording).items()})


def slower(recording: Recording) -> Recording:
    return interpolated(recording, np.arange(recording.time[0], recording.time[-1], 1.25 * interval(recording)))


def faster(recording: Recording) -> Recording:
    return interpolated(recording, np.arange(recording.time[0], recording.time[-1], 0.7 * interval(recording)))


def averaged(recording: Recording) -> Recording:
    n = len(recording) // 3 * 3
    means = {n_: x[:n].reshape(-1, 3).mean(axis=1) for n_, x in columns(recording).items()}
    return with_rows(recording, recording.time[:n].reshape(-1, 3).mean(axis=1), means)


def shifted(recording: Recording) -> Recording:
    return interpolated(recording, np.arange(recording.time[0] + 23.0, recording.time[-1], interval(recording)))


def rounded(recording: Recording) -> Recording:
    return with_rows(recording, recording.time, {n: np.round(x, 1) for n, x in columns(recording).items()})


def noisy(recording: Recording) -> Recording:
    rng = np.random.default_rng(5)
    found = {n: x + 0.15 * rng.normal(size=len(x)) * n.endswith("_um") for n, x in columns(recording).items()}
    return with_rows(recording, recording.time, found)


def interval(recording: Recording) -> float:
    return float(np.median(np.diff(recording.time)))


DISGUISES: list[Callable[[Recording], Recording]] = [slower, faster, averaged, shifted, rounded, noisy]


def copied(one: Recording, other: Recording, target: str) -> float:
    """Return the share of the rows of another recording that count as copies."""
    first, second = (stack([r], [target]) for r in (one, other))
    excerpts = take_excerpts(first, 0, np.ones(len(first), np.bool_))
    assert excerpts
    found = find_excerpts(excerpts, [(0, len(first))], second, 0, np.arange(len(second)))
    return float(np.mean(found >= 0))


@pytest.fixture(scope="module")
def models() -> tuple[ErrorModel, ...]:
    samples = stack([small_machine()], ["z_um"])
    return study.fit(samples, "dynamic", splits.leave_one_cycle_out(samples)).models


@pytest.mark.parametrize("disguise", DISGUISES)
def test_a_disguised_copy_is_no_test(
    disguise: Callable[[Recording], Recording], models: tuple[ErrorModel, ...]
) -> None:
    (overall,) = assessing.assess(models, [disguise(small_machine())], starts=COLD).overall()
    assert overall.reason.startswith("not a test on unseen data: ")
    assert not overall.accepted


def test_disguised_copies_of_a_real_test(shared_data: Path) -> None:
    real = read(shared_data / "fl_thermal" / "recording.csv")
    for disguise in DISGUISES:
        copy = disguise(real)
        for target in ("ch1_um", "ch4_um"):
            assert copied(real, copy, target) > 0.99


@pytest.mark.parametrize("disguise", DISGUISES)
def test_of_a_copy_between_new_rows_the_copy_is_found(disguise: Callable[[Recording], Recording]) -> None:
    day, new = disguise(small_machine()), small_machine((2200.0, 1200.0, 1700.0, 2600.0), seed=5)
    step = interval(day)
    new = interpolated(new, np.arange(0, new.time[-1], step))
    joined = {n: np.concatenate([columns(new)[n], x]) for n, x in columns(day).items()}
    both = with_rows(day, np.arange(float(len(new) + len(day))) * step, joined)
    first, second = (stack([r], ["z_um"]) for r in (small_machine(), both))
    excerpts = take_excerpts(first, 0, np.ones(len(first), np.bool_))
    found = find_excerpts(excerpts, [(0, len(first))], second, 0, np.arange(len(second)))
    assert np.abs(np.flatnonzero(found >= 0)[0] - len(new)) <= 2
    assert np.mean(found[len(new) + 2 :] >= 0) > 0.99
    rows = np.flatnonzero(found >= 0)
    there = (rows - len(new)) * step / 60.0
    assert np.abs(found[rows] - there).max() <= 2.0


def test_a_piece_of_a_copy_ends_where_it_ends() -> None:
    one, new = small_machine(), small_machine((2200.0, 1200.0, 1700.0, 2600.0), seed=5)
    piece, rest = columns(noisy(one)), columns(new)
    joined = {n: np.concatenate([piece[n][:400], rest[n][400:]]) for n in piece}
    assert 0.4 < copied(one, with_rows(one, one.time, joined), "z_um") < 0.5 + 120 / 800


@pytest.mark.parametrize("shift", [0.25, 0.5, 0.75])
def test_a_short_copy_between_its_rows(shift: float) -> None:
    day = small_machine()
    short = with_rows(day, day.time[:80], {n: x[:80] for n, x in columns(day).items()})
    assert copied(short, interpolated(short, short.time[:-1] + 60.0 * shift), "z_um") > 0.9


def test_means_over_many_rows_are_a_copy() -> None:
    day = small_machine(dt=20.0)
    n = len(day) // 6 * 6
    means = {k: x[:n].reshape(-1, 6).mean(axis=1) for k, x in columns(day).items()}
    assert copied(day, with_rows(day, day.time[:n].reshape(-1, 6).mean(axis=1), means), "z_um") > 0.9


def test_copies_are_found_in_the_target_that_drifts() -> None:
    days = [small_machine(), small_machine((2200.0, 1200.0, 1700.0, 2600.0), seed=5)]
    days = [replace(d, table=d.table.assign(x_um=1e-3 * d.table["x_um"])) for d in days]
    samples = stack([*days, replace(noisy(days[0]), name="again")], ["x_um", "z_um"])
    with pytest.raises(InputError, match="again#3"):
        refuse_leaks(samples, splits.leave_one_file_out(samples))


@pytest.mark.parametrize("disguise", DISGUISES)
def test_a_disguised_copy_is_not_judged_by_its_original(disguise: Callable[[Recording], Recording]) -> None:
    days = [small_machine(), small_machine((2200.0, 1200.0, 1700.0, 2600.0), seed=5)]
    samples = stack([*days, replace(disguise(days[0]), name="again")], ["z_um"])
    with pytest.raises(InputError, match=r"again#3: rows \d+-\d+ repeat rows \d+-\d+ of small#1"):
        refuse_leaks(samples, splits.leave_one_file_out(samples))


def test_repeats_of_a_duty_are_no_copies() -> None:
    """The same speeds in the same weather: only the noise is another, and it may be rounded."""
    recorded = [record("demo", seed=seed, sensor_noise=0.003)[0] for seed in range(3)]
    for step in (0.0, 0.1):
        days = []
        for day in recorded:
            told = {n: np.round(x / step) * step if step and n.endswith("_C") else x for n, x in columns(day).items()}
            days.append(with_rows(day, day.time, told))
        for k in range(3):
            assert [copied(days[k], other, t) for other in days[:k] for t in ("x1_um", "z_um")] == [0.0] * 2 * k


def test_the_same_drift_with_other_temperatures_is_no_copy() -> None:
    one, other = small_machine(), small_machine(seed=1)
    assert copied(one, other, "z_um") == 0.0
    same = {**columns(other), "z_um": columns(one)["z_um"]}
    assert copied(one, with_rows(other, other.time, same), "z_um") == 0.0
    first, second = (
        with_rows(r, r.time, {n: table[n] for n in ("t1_C", "spindle_rpm", "z_um")})
        for r, table in ((one, columns(one)), (other, same))
    )
    assert copied(first, second, "z_um") == 0.0


def test_without_noise_or_movement_there_is_nothing_to_know_again() -> None:
    one = small_machine()
    kernel = np.exp(-0.5 * (np.arange(-40, 41) / 8.0) ** 2)
    smooth = {n: np.convolve(np.pad(x, 40, "edge"), kernel / kernel.sum(), "valid") for n, x in columns(one).items()}
    still = {n: 0.01 * np.random.default_rng(3).normal(size=len(x)) for n, x in columns(one).items()}
    for told in (smooth, still):
        samples = stack([with_rows(one, one.time, told)], ["z_um"])
        assert take_excerpts(samples, 0, np.ones(len(samples), np.bool_)) == ()
    short = stack([with_rows(one, one.time[:20], {n: x[:20] for n, x in columns(one).items()})], ["z_um"])
    assert take_excerpts(short, 0, np.ones(20, np.bool_)) == ()


def test_values_are_stored_to_a_step() -> None:
    x = np.random.default_rng(0).normal(size=100).cumsum()
    assert np.abs(unpack_values(pack_values(x, 0.01)) - x).max() <= 0.0051
    assert np.abs(unpack_values(pack_values(1e6 * x, 0.01)) - 1e6 * x).max() <= 1e6 * np.abs(np.diff(x)).max() / 2**15


def test_excerpts_are_small(models: tuple[ErrorModel, ...]) -> None:
    assert models[0].provenance is not None
    assert models[0].provenance.prints is not None
    assert sum(len(t) for e in models[0].provenance.prints.excerpts for t in e.values.values()) < 9_000


@pytest.mark.parametrize("step", ["nan", "inf", "0", "-1", "", "x"])
def test_a_damaged_excerpt_is_refused(step: str) -> None:
    packed = pack_values(np.arange(9.0), 0.5).split()[1]
    assert Excerpt(0, 60.0, {"z_um": f"0.5 {packed}"})
    for text in (f"{step} {packed}", "0.5 ?", "0.5 " + packed[:8]):
        if text != f"0.5 {packed}":
            with pytest.raises(SettingError, match="excerpt"):
                Excerpt(0, 60.0, {"z_um": text, "t1_C": f"0.5 {packed}"})
    with pytest.raises(SettingError, match="there are no values"):
        Excerpt(0, 60.0, {})
    with pytest.raises(SettingError, match="must not be negative or zero"):
        Excerpt(0, float("nan"), {"z_um": f"0.5 {packed}"})
