"""Copies that were smoothed, thinned, stretched or made very noisy are found by their whole curves; repeats are not."""

from collections.abc import Callable
from dataclasses import replace
from functools import cache
from itertools import combinations
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from numpy.typing import NDArray
from smallmachine import small_machine

from thermocomp.core.exceptions import InputError
from thermocomp.core.fingerprints import unpack_values
from thermocomp.files import modelfile
from thermocomp.judging import splits, study
from thermocomp.judging.leaks import find_learned_rows, refuse_leaks
from thermocomp.recordings import curves
from thermocomp.recordings.curves import find_curves, take_curves
from thermocomp.recordings.cycles import make_single_cycle
from thermocomp.recordings.fingerprints import fingerprint
from thermocomp.recordings.overlaps import overlap
from thermocomp.recordings.readers.recordings import read
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.recordings.starts import COLD
from thermocomp.virtual.datasets import record

FloatArray = NDArray[np.float64]
Columns = dict[str, FloatArray]


@cache
def day(seed: int = 0, protocol: str = "demo") -> Recording:
    return record(protocol, seed=seed)[0]


def columns(recording: Recording) -> Columns:
    return {c.name: recording.table[c.name].to_numpy(float) for c in recording.channels}


def with_rows(like: Recording, time: FloatArray, table: Columns, name: str = "copy") -> Recording:
    channels = tuple(like.channel(c) for c in table)
    cycles = make_single_cycle(len(time))
    return replace(like, name=name, time=time - time[0], table=pd.DataFrame(table), channels=channels, cycles=cycles)


def samples_of(recording: Recording, target: str, inputs: list[str] | None = None) -> Samples:
    return stack([recording], [target], inputs, starts=COLD)


def found_rows(one: Samples, other: Samples) -> NDArray[np.intp]:
    """Return the rows of one test that are found in another, by whole curves alone."""
    taken = take_curves(one, 0, np.ones(len(one), np.bool_))
    interval = float(np.median(np.diff(one.time)))
    return find_curves(taken, [(0, len(one))], interval, other, 0, np.arange(len(other)))


def share(one: Recording, other: Recording, target: str, inputs: list[str] | None = None) -> float:
    return float(np.mean(found_rows(samples_of(one, target, inputs), samples_of(other, target, inputs)) >= 0))


def is_read(name: str) -> bool:
    return name.endswith(("_C", "_um"))


# -- disguises ---------------------------------------------------------------------------------------------------------


def smoothed(r: Recording, rows: int = 21) -> Recording:
    means = r.table.rolling(rows, center=True, min_periods=1).mean()
    return with_rows(r, r.time, {n: means[n].to_numpy() if is_read(n) else x for n, x in columns(r).items()})


def noisy(r: Recording, temperature: float = 0.1, displacement: float = 0.3) -> Recording:
    rng = np.random.default_rng(3)
    noise = {"_C": temperature, "_um": displacement}
    table = {n: x + noise.get(n[n.rfind("_") :], 0.0) * rng.normal(size=len(x)) for n, x in columns(r).items()}
    return with_rows(r, r.time, table)


def thinned(r: Recording, rows: int = 3) -> Recording:
    step = rows * float(np.median(np.diff(r.time)))
    time = np.arange(r.time[0] + 7.0, r.time[-1], step)
    return with_rows(r, time, {n: np.interp(time, r.time, x) for n, x in columns(r).items()})


def stretched(r: Recording) -> Recording:
    time = r.time[: int(0.95 * len(r))]
    return with_rows(r, time, {n: np.interp(1.03 * time, r.time, x) for n, x in columns(r).items()})


def turned(r: Recording) -> Recording:
    return with_rows(r, r.time, {n: -x if n.endswith("_um") else x for n, x in columns(noisy(r)).items()})


def larger(r: Recording) -> Recording:
    return with_rows(r, r.time, {n: 1.4 * x if n.endswith("_um") else x for n, x in columns(noisy(r)).items()})


Disguise = Callable[[Recording], Recording]
DISGUISES: list[Disguise] = [smoothed, noisy, thinned, stretched, turned, larger]


@pytest.mark.parametrize("disguise", DISGUISES)
def test_disguised_copies_are_found(disguise: Disguise) -> None:
    copy = disguise(day())
    assert share(day(), copy, "y1_um") > 0.99
    assert share(copy, day(), "y1_um") > 0.93  # the copy ends earlier if it was stretched


@pytest.mark.parametrize("disguise", DISGUISES)
def test_disguised_copies_of_a_real_test_are_left_out(disguise: Disguise, shared_data: Path) -> None:
    real = read(shared_data / "fl_thermal" / "recording.csv")
    assert share(real, disguise(real), "ch1_um") > 0.99


@pytest.mark.parametrize("rows", [10, 20])
def test_every_tenth_or_twentieth_row_of_a_real_test(rows: int, shared_data: Path) -> None:
    real = read(shared_data / "fl_thermal" / "recording.csv")
    assert share(real, thinned(real, rows), "ch3_um") > 0.99


def test_copies_of_which_a_part_is_recognised_are_left_out_whole() -> None:
    one, copy = (samples_of(r, "y1_um") for r in (day(), noisy(day(), 0.04, 0.3)))
    prints = fingerprint(one, 0, np.ones(len(one), np.bool_))
    assert prints is not None
    assert 0.1 < np.mean(overlap(replace(prints, curves=()), copy, 0) >= 0) < 0.9
    assert np.mean(overlap(prints, copy, 0) >= 0) > 0.99


def test_rows_are_those_of_the_original() -> None:
    copy = stretched(smoothed(day(), 5))
    found = found_rows(*(samples_of(r, "z_um") for r in (day(), copy)))
    there = 1.03 * copy.time / 20.0
    assert np.abs(found - there)[found >= 0].max() <= 12


def test_of_a_second_half_and_another_day_only_the_half_is_found() -> None:
    half = len(day()) // 2
    new = columns(day(5, "random"))
    new = {n: np.repeat(new[n], 3)[:1500] for n in columns(day()) if n in new}
    old = {n: x for n, x in columns(smoothed(day(), 9)).items() if n in new}
    joined = {n: np.concatenate([x[half:] + (new[n][0] - x[-1]), new[n]]) for n, x in old.items()}
    both = with_rows(day(), np.asarray(20.0 * np.arange(len(joined["z_um"]))), joined)
    found = found_rows(*(samples_of(r, "z_um") for r in (day(), both)))
    rest = len(day()) - half
    assert np.mean(found[:rest] >= 0) > 0.99
    assert (found[rest + 30 :] < 0).all()


def test_of_two_files_both_are_named_with_their_rows() -> None:
    days = [day(), day(1), replace(smoothed(day()), name="again")]
    samples = stack(days, ["y1_um"], starts=[COLD] * 3)
    with pytest.raises(InputError, match=r"again#3: rows \d+-\d+ repeat rows \d+-\d+ of demo#1"):
        refuse_leaks(samples, splits.leave_one_file_out(samples))


def test_models_recognise_them_after_reading_their_file(tmp_path: Path) -> None:
    inputs = ["t_front_seat_C", "t_air_C", "t_bed_front_C", "t_column_rear_left_C"]
    samples = stack([day(0, "random")], ["z_um"], inputs, starts=COLD)
    model = study.fit(samples, "ols", splits.leave_one_cycle_out(samples)).models[0]
    modelfile.write([model], tmp_path / "m.json")
    (again,) = modelfile.read(tmp_path / "m.json")
    assert again.provenance == model.provenance
    copy = stack([smoothed(day(0, "random"), 9)], ["z_um"], inputs, starts=COLD)
    assert find_learned_rows(again, copy).all()
    assert not find_learned_rows(again, stack([day(1, "random")], ["z_um"], inputs, starts=COLD)).any()


# -- repeats of a duty -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("protocol", "target"), [("demo", "y1_um"), ("random", "z_um"), ("etve", "z_um")])
def test_other_days_of_a_duty_are_no_copies(protocol: str, target: str) -> None:
    days = [day(seed, protocol) for seed in range(3)]
    for one, other in combinations(days, 2):
        assert share(one, other, target) == 0.0
    assert share(days[2], noisy(days[0]), target) == 0.0


def test_nor_are_they_with_few_sensors_that_the_duty_heats() -> None:
    hot = ["t_front_seat_C", "t_rear_seat_C", "t_motor_C", "t_y_bearing_C"]
    for one, other in combinations([day(seed, "random") for seed in range(4)], 2):
        assert share(one, other, "z_um", [*hot, "spindle_rpm"]) == 0.0


def test_nor_are_cycles_of_a_real_test(shared_data: Path) -> None:
    real = read(shared_data / "fl_thermal" / "recording.csv")
    cycles = [
        with_rows(real, real.time[a : a + 1667], {n: x[a : a + 1667] for n, x in columns(real).items()})
        for a in range(0, 4 * 1667, 1667)
    ]
    for one, other in combinations(cycles, 2):
        assert share(one, other, "ch3_um") == 0.0


def hot(seed: int, gain: float = 1.0, noise: float = 0.02) -> Recording:
    """Return a test without weather: four temperatures follow the duty, and nothing else."""
    like, rng = small_machine(), np.random.default_rng(seed)
    plain = columns(small_machine(noise=0.0))
    speed = plain["spindle_rpm"]
    often = 1 + 0.5 * np.sign(np.sin(np.arange(len(speed)) / 7.0) - 0.3)
    load = np.convolve(speed * often, np.exp(-np.arange(40) / 8.0) / 8.0)[: len(speed)]
    x, y = plain["t1_C"] - plain["t3_C"], plain["t2_C"] - plain["t3_C"]
    heat = {"t1_C": x + load / 500, "t2_C": y + load / 900, "t3_C": x + y + load / 700, "z_um": 5.0 * x + load / 200}
    return with_rows(like, like.time, {n: 20 + gain * h + noise * rng.normal(size=len(h)) for n, h in heat.items()})


def test_without_weather_only_the_noise_tells_copies_from_repeats(monkeypatch: pytest.MonkeyPatch) -> None:
    assert share(hot(0), hot(1), "z_um") == 0.0
    assert share(hot(0), smoothed(hot(0), 5), "z_um") > 0.99
    monkeypatch.setattr(curves, "INDEPENDENT", np.inf)
    assert share(hot(0), hot(1), "z_um") > 0.99


def test_the_same_course_with_more_heat_is_another_test(monkeypatch: pytest.MonkeyPatch) -> None:
    assert share(hot(0), hot(1, gain=1.5, noise=0.1), "z_um") == 0.0
    monkeypatch.setattr(curves, "GAIN", 2.0)
    assert share(hot(0), hot(1, gain=1.5, noise=0.1), "z_um") > 0.99


def test_weather_must_be_the_same_all_the_way(monkeypatch: pytest.MonkeyPatch) -> None:
    one, table = hot(0), columns(hot(1, noise=0.1))
    wave = 0.5 * np.sin(2 * np.pi * one.time / 20_000)
    other = with_rows(one, one.time, {n: x + wave if n.endswith("_C") else x for n, x in table.items()})
    assert share(one, other, "z_um") == 0.0
    monkeypatch.setattr(curves, "APART", 1.0)
    assert share(one, other, "z_um") > 0.99


def test_fluctuations_must_be_the_same() -> None:
    """Smooth drift that is repeated exactly, with other noise, says nothing."""
    assert share(small_machine(), small_machine(seed=1), "z_um") == 0.0
    assert share(small_machine(), small_machine(seed=2, noise=0.2), "z_um") == 0.0


# -- what is stored ----------------------------------------------------------------------------------------------------


def test_two_temperatures_or_few_rows_are_not_enough() -> None:
    two = samples_of(day(), "z_um", ["t_air_C", "t_motor_C"])
    assert take_curves(two, 0, np.ones(len(two), np.bool_)) == ()
    few = samples_of(with_rows(day(), day().time[:140], {n: x[:140] for n, x in columns(day()).items()}), "z_um")
    assert take_curves(few, 0, np.ones(len(few), np.bool_)) == ()
    whole = samples_of(day(), "z_um")
    assert (found_rows(whole, two) < 0).all()
    assert (found_rows(whole, whole.take(np.arange(len(whole)) < 20)) < 0).all()


def test_curves_are_small_and_each_section_has_its_own() -> None:
    samples = stack([day(), day(1)], ["z_um"], starts=[COLD] * 2)
    taken = take_curves(samples, 0, np.ones(len(samples), np.bool_))
    assert [c.row for c in taken] == [0, len(day())]
    assert sum(len(text) for c in taken for text in c.values.values()) < 11_000
    assert all(len(c.values) == 1 + curves.CHANNELS for c in taken)
    assert sum(len(unpack_values(c.values["z_um"])) for c in taken) <= curves.BLOCKS
