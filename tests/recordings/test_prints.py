"""Fingerprints of rows: copies are found however they were made, other recordings never are."""

import json
from collections.abc import Sequence
from dataclasses import asdict, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from smallmachine import small_machine

from thermocomp.core.fingerprints import Prints, unpack_marks
from thermocomp.core.machine import Channel
from thermocomp.recordings.cycles import make_single_cycle
from thermocomp.recordings.fingerprints import LENGTH, fingerprint
from thermocomp.recordings.overlaps import overlap, repeats
from thermocomp.recordings.readers.recordings import read
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.virtual import datasets as virtual

FloatArray = NDArray[np.float64]


@cache
def learned() -> Samples:
    return stack([small_machine()], ["z_um"])


@cache
def kept() -> Prints:
    return of(learned())


def of(samples: Samples, target: int = 0) -> Prints:
    found = fingerprint(samples, target, np.ones(len(samples), dtype=np.bool_))
    assert found is not None
    return found


def share(prints: Prints | None, samples: Samples, target: int = 0) -> float:
    """Return the share of rows that are known."""
    return 0.0 if prints is None else float((overlap(prints, samples, target) >= 0).mean())


def joined(*parts: Samples) -> Samples:
    """Return one test of several, one after the other."""
    return replace(
        parts[0],
        values=np.concatenate([p.values for p in parts]),
        deviations=np.concatenate([p.deviations for p in parts]),
        time=60.0 * np.arange(sum(len(p) for p in parts), dtype=np.float64),
        test=np.zeros(sum(len(p) for p in parts), dtype=np.intp),
        cycle=np.zeros(sum(len(p) for p in parts), dtype=np.intp),
        row=np.arange(sum(len(p) for p in parts)),
    )


def series(values: FloatArray, deviation: FloatArray) -> Samples:
    """Return one test from plain numbers."""
    n = len(deviation)
    return Samples(
        inputs=tuple(Channel(f"t{j}_C", "temperature", "degC") for j in range(values.shape[1])),
        targets=(Channel("z_um", "displacement", "um"),),
        values=values,
        deviations=deviation[:, None],
        time=10.0 * np.arange(n, dtype=np.float64),
        test=np.zeros(n, dtype=np.intp),
        cycle=np.zeros(n, dtype=np.intp),
        row=np.arange(n),
        test_names=("a",),
        cycle_names=("whole test",),
        hashes=("",),
    )


# -- copies --------------------------------------------------------------------------------------------------------


@settings(max_examples=40, deadline=None)
@given(gone=st.sets(st.integers(0, 799), min_size=0, max_size=12))
def test_rows_that_are_gone_hide_nothing(gone: set[int]) -> None:
    copy = learned().take(~np.isin(np.arange(800), list(gone)))
    found = overlap(kept(), copy, 0)
    stretch = np.cumsum(np.diff(copy.row, prepend=copy.row[0]) > 1)
    long = np.bincount(stretch)[stretch] > LENGTH  # what is left between two that are gone may be too short for a run
    assert (found[long] >= 0).all()
    assert np.abs(found - copy.row)[found >= 0].max() <= 2 * LENGTH


@settings(max_examples=30, deadline=None)
@given(
    column=st.integers(0, 3), offset=st.floats(-300, 300), zero=st.floats(-500, 500), digits=st.sampled_from([2, 3, 6])
)
def test_neither_do_a_column_a_zero_and_the_digits(column: int, offset: float, zero: float, digits: int) -> None:
    names = [c.name for k, c in enumerate(learned().inputs) if k != column]
    copy = learned().only(names)
    copy = replace(
        copy, values=np.round(copy.values + offset, digits), deviations=np.round(copy.deviations + zero, digits)
    )
    # half the noise of a thermometer away, a run is found here and there; what little is left `assess` leaves out too
    assert share(kept(), copy) > (0.95 if digits == 2 else 0.999)


@settings(max_examples=30, deadline=None)
@given(first=st.integers(0, 700), rows=st.integers(80, 800), seed=st.integers(1, 1000))
def test_of_a_piece_and_another_day_the_other_day_is_left(first: int, rows: int, seed: int) -> None:
    piece = learned().take(slice_of(first, first + rows))
    day = stack([small_machine((2200.0, 1200.0), seed=seed)], ["z_um"])
    for parts in ([piece, day], [day, piece]):
        found = overlap(kept(), joined(*parts), 0) >= 0
        mine = slice(0, len(piece)) if parts[0] is piece else slice(len(day), None)
        if len(piece) >= 80:
            assert found[mine].all()
        assert found.sum() - found[mine].sum() <= 100


def slice_of(first: int, stop: int) -> NDArray[np.bool_]:
    rows = np.arange(800)
    return np.asarray((rows >= first) & (rows < stop))


def test_the_whole_training_and_a_day_is_cut_where_the_day_begins() -> None:
    day = stack([small_machine((2200.0, 1200.0), seed=3)], ["z_um"])
    found = overlap(kept(), joined(learned(), day), 0) >= 0
    assert found[:800].all()
    assert not found[800:].any()


def test_a_day_between_two_pieces_is_left_and_a_few_new_rows_are_not() -> None:
    first, second = learned().take(slice_of(0, 350)), learned().take(slice_of(350, 800))
    day = stack([small_machine((2200.0, 1200.0), seed=3)], ["z_um"])
    found = overlap(kept(), joined(first, day, second), 0) >= 0
    assert found[:350].all()
    assert found[750:].all()
    assert found[350:750].sum() <= 150
    few = day.take(np.arange(10))
    assert (overlap(kept(), joined(first, few, second), 0) >= 0).all()


def test_altered_rows_and_missing_values_are_bridged() -> None:
    deviations = learned().deviations.copy()
    deviations[::70] += 40.0
    assert share(kept(), replace(learned(), deviations=deviations)) == 1.0
    deviations[::70] = np.nan
    found = overlap(kept(), replace(learned(), deviations=deviations), 0) >= 0
    assert found[np.isfinite(deviations[:, 0])].all()
    values = learned().values.copy()
    values[100:500, 0] = np.nan
    assert share(kept(), replace(learned(), values=values)) == 1.0


@pytest.mark.parametrize("step", [2, 4])
def test_a_copy_with_fewer_rows_is_found_and_one_with_more(step: int) -> None:
    fewer = learned().take(np.arange(0, 800, step))
    assert share(kept(), fewer) > 0.9
    assert share(of(fewer), learned()) > 0.9


def test_other_units_and_back() -> None:
    fahrenheit = np.round(learned().values[:, :3] * 1.8 + 32, 3)
    values = np.column_stack([(fahrenheit - 32) / 1.8, learned().values[:, 3]])
    deviations = np.round(learned().deviations / 1000, 6) * 1000
    assert share(kept(), replace(learned(), values=values, deviations=deviations)) == 1.0


def test_what_is_not_found_is_as_the_decision_says() -> None:
    """All channels rounded to far more than their noise."""
    rounded = replace(learned(), values=np.round(learned().values), deviations=np.round(learned().deviations, -1))
    assert share(kept(), rounded) == 0.0


def test_another_column_under_the_name_of_the_target_is_no_copy() -> None:
    both = stack([small_machine()], ["z_um", "x_um"])
    assert share(kept(), both, 0) == 1.0
    assert share(kept(), both, 1) == 0.0


# -- two files, or one file twice ----------------------------------------------------------------------------------


@settings(max_examples=20, deadline=None)
@given(first=st.integers(0, 300), rows=st.integers(60, 100), gap=st.integers(0, 300), zero=st.floats(-50, 50))
def test_a_stretch_that_comes_again_is_found_with_its_origin(first: int, rows: int, gap: int, zero: float) -> None:
    again = learned().take(slice_of(first, first + rows))
    again = replace(again, deviations=again.deviations + zero)
    parts = [learned().take(slice_of(0, 400 + gap)), again]
    found = repeats(joined(*parts), 0)
    copy = found[400 + gap :]
    assert (found[: 400 + gap] < 0).all()
    assert (copy >= 0).mean() > 0.9
    np.testing.assert_array_equal(copy[copy >= 0], np.arange(first, first + rows)[copy >= 0])


def test_a_recording_repeats_nothing_of_itself() -> None:
    for seed in range(10):
        assert (repeats(stack([small_machine(seed=seed)], ["z_um"]), 0) < 0).all()


# -- no copies -----------------------------------------------------------------------------------------------------


@pytest.mark.long
def test_two_hundred_random_walks_in_coarse_steps() -> None:
    rng = np.random.default_rng(14)
    before: list[Prints] = []
    for _ in range(200):
        steps = rng.normal(0, rng.choice([0.03, 0.1, 0.3]), (600, 4))
        walk = np.cumsum(steps, axis=0, dtype=np.float64).round(1)
        test = series(walk[:, 1:], walk[:, 0])
        assert not any(share(p, test) for p in before[-10:])
        assert (repeats(test, 0) < 0).all()
        if (mine := fingerprint(test, 0, np.ones(600, dtype=np.bool_))) is not None:
            before.append(mine)
            assert share(mine, test.take(np.arange(600) != 300)) > 0.9
    assert len(before) > 150


def lag(drive: FloatArray, rows: float) -> FloatArray:
    found = np.zeros(len(drive))
    for k in range(1, len(drive)):
        found[k] = found[k - 1] + (drive[k] - found[k - 1]) / rows
    return found


@pytest.mark.parametrize(("um", "degc"), [(1.0, 0.1), (0.25, 0.0625), (0.1, 0.1), (0.01, 0.01), (5.0, 1.0)])
@pytest.mark.parametrize("noise", [0.2, 0.5, 2.0])
def test_the_same_profile_on_another_day_in_steps_of_an_instrument(um: float, degc: float, noise: float) -> None:
    """Same machine, same speeds, same weather, resolutions of dial gauges and PLCs; `noise` counts in resolutions."""
    rng = np.random.default_rng([int(um * 100), int(noise * 10)])
    spindle = np.tile(np.r_[np.ones(60), np.zeros(60)], 3)
    warm = np.column_stack([g * lag(spindle, tau) for g, tau in ((30, 15), (8, 15), (5, 30), (2, 60))])
    days = []
    for _ in range(8):
        steps = np.array([um, degc, degc, degc])
        day = warm + steps * (rng.uniform(-0.5, 0.5, 4) + noise * rng.normal(size=warm.shape))
        day = np.round(day / steps) * steps
        days.append(series(day[:, 1:], day[:, 0]))
    prints = [fingerprint(day, 0, np.ones(len(spindle), dtype=np.bool_)) for day in days]
    assert [share(p, d) for k, p in enumerate(prints) for m, d in enumerate(days) if m != k] == [0.0] * 56
    assert all((repeats(day, 0) < 0).all() for day in days)
    if um < 5:  # else the warm-up hardly moves beyond its noise
        assert np.mean([share(p, d.take(np.arange(360) != 180)) for p, d in zip(prints, days, strict=True)]) > 0.8


@pytest.mark.parametrize("noise", [0.05, 0.1])
def test_the_same_profile_with_noise_that_rounding_all_but_hides(noise: float) -> None:
    """Slow enough that each step of an instrument lasts for many rows: runs that come again and again say nothing."""
    rng = np.random.default_rng(1)
    spindle = np.tile(np.r_[np.ones(375), np.zeros(375)], 4)
    rows = np.arange(3000) / 3000
    warm = np.column_stack([g * lag(spindle, 375 / k) for g, k in ((30, 4), (8, 4), (5, 2), (2, 1))])
    steps = np.array([0.25, 0.0625, 0.0625, 0.0625])
    days = []
    for _ in range(8):
        weather = 0.1 * np.sin(2 * np.pi * rows * rng.uniform(0.3, 3) + rng.uniform(0, 6))
        day = warm + weather[:, None] * [3, 1, 1, 1] + steps * (rng.uniform(-0.5, 0.5, 4))
        day = np.round((day + steps * noise * rng.normal(size=warm.shape)) / steps) * steps
        days.append(series(day[:, 1:], day[:, 0]))
    prints = [fingerprint(day, 0, np.ones(3000, dtype=np.bool_)) for day in days]
    assert [share(p, d) for k, p in enumerate(prints) for m, d in enumerate(days) if m != k] == [0.0] * 56
    assert all((repeats(day, 0) < 0).all() for day in days)


def test_a_smooth_warm_up_in_steps_of_an_instrument_says_nothing() -> None:
    spindle = np.r_[np.zeros(5), np.ones(900)]
    warm = np.column_stack([g * lag(spindle, tau) for g, tau in ((30, 150), (8, 150), (5, 300), (2, 600))])
    steps = np.array([1.0, 0.1, 0.1, 0.1])
    warm = np.round(warm / steps) * steps
    assert fingerprint(series(warm[:, 1:], warm[:, 0]), 0, np.ones(905, dtype=np.bool_)) is None


def test_a_plateau_and_a_ramp_give_none() -> None:
    rng = np.random.default_rng(2)
    rows = np.arange(1000, dtype=np.float64)
    everything = np.ones(1000, dtype=np.bool_)
    ramp = series(np.round(rows[:, None] * [0.013, 0.007], 1), np.round(rows * 0.03, 1))
    assert fingerprint(ramp, 0, everything) is None
    still = series(np.full((1000, 2), 21.5), np.full(1000, 3.0))
    assert fingerprint(still, 0, everything) is None
    # noise alone is told apart, yet nothing moves: the very same rows are no overlap
    noise = series(21 + 0.1 * rng.normal(size=(1000, 2)), 0.2 * rng.normal(size=1000))
    found = fingerprint(noise, 0, everything)
    assert found is not None
    assert not any(unpack_marks(run.moving).any() for run in found.runs)
    assert share(found, noise) == 0.0


def test_a_spindle_that_stands_or_turns_is_no_input() -> None:
    rows = np.arange(1000, dtype=np.float64)
    rng = np.random.default_rng(3)
    speed = np.where(rows % 200 < 100, 2000.0, 0.0)
    drift = 30 * lag(speed / 2000, 50) + 0.1 * rng.normal(size=1000)
    assert fingerprint(series(speed[:, None], drift), 0, np.ones(1000, dtype=np.bool_)) is None


@pytest.mark.parametrize("experiment", ["random", "stepwise2017", "iso230-spindle", "wessel-tool"])
def test_the_virtual_machine_on_two_days(experiment: str) -> None:
    """One protocol, two seeds of weather and noise, every target."""
    days = [virtual.record(virtual.find_experiment(experiment), seed=seed)[0] for seed in (0, 1)]
    targets = [c.name for c in days[0].displacements]
    first, second = (stack([day], targets) for day in days)
    for k in range(len(targets)):
        prints = of(first, k)
        assert share(prints, second, k) == 0.0
        assert share(prints, first.take(np.arange(len(first)) != len(first) // 2), k) == 1.0
        assert len(json.dumps(asdict(prints))) <= 32_000
        assert (repeats(first, k) < 0).all()


def test_the_measured_spindle_test(shared_data: Path) -> None:
    """Cycles of fl_thermal against each other: 5 targets, 20 pairs; and every target's whole, minus a row."""
    recording = read(shared_data / "fl_thermal" / "recording.csv")
    targets = [c.name for c in recording.displacements]
    samples = stack([recording], targets)
    cycles = [samples.take(samples.cycle == k) for k in range(5)]
    for k in range(len(targets)):
        prints = of(samples, k)
        assert len(json.dumps(asdict(prints))) <= 32_000
        copy = samples.take(np.arange(len(samples)) != 4321)
        assert share(prints, replace(copy, deviations=np.round(copy.deviations + 7.7, 3)), k) == 1.0
        assert share(prints, samples.take(np.arange(0, len(samples), 2)), k) > 0.9
        assert (repeats(samples, k) < 0).all()
        for a, known in enumerate(of(c, k) for c in cycles):
            assert [share(known, c, k) for b, c in enumerate(cycles) if b != a] == [0.0] * 4


# -- what is kept --------------------------------------------------------------------------------------------------


def test_only_learned_rows_are_known() -> None:
    first = fingerprint(learned(), 0, slice_of(0, 400))
    assert first is not None
    found = overlap(first, learned(), 0) >= 0
    assert found[:400].all()
    assert not found[400:].any()
    assert first.learned == ((0, 400),)


def test_several_tests_are_kept_and_known_one_by_one() -> None:
    tests = [replace(small_machine(seed=k), name=f"day {k}", cycles=make_single_cycle(800)) for k in range(3)]
    samples = stack(tests, ["z_um"])
    prints = of(samples)
    assert prints.learned == ((0, 800), (800, 1600), (1600, 2400))
    for run in prints.runs:
        rows = unpack_marks(run.rows).astype(np.int64)
        assert len(rows) > 100
        assert ((rows % 800) + LENGTH * run.stride < 800).all()  # no run continues in another test
    for k, test in enumerate(tests):
        found = overlap(prints, stack([test], ["z_um"]), 0)
        assert np.abs(found - np.arange(800 * k, 800 * (k + 1))).max() <= 2 * LENGTH
    assert share(prints, stack([small_machine(seed=9)], ["z_um"])) == 0.0


def test_the_size_does_not_grow_with_the_recording() -> None:
    rng = np.random.default_rng(5)
    size = []
    for n in (1_000, 10_000, 100_000):
        walk = np.cumsum(rng.normal(0, 0.02, (n, 6)), axis=0, dtype=np.float64) + 0.02 * rng.normal(size=(n, 6))
        test = series(walk[:, 1:], walk[:, 0])
        prints = of(test)
        size.append(len(json.dumps(asdict(prints))))
        assert share(prints, test.take(np.arange(n) != n // 3)) == 1.0
    assert max(size) <= 32_000


def names(prints: Prints) -> Sequence[str]:
    return list(prints.steps)


def test_a_few_inputs_are_kept_those_that_say_most() -> None:
    assert names(kept())[0] == "z_um"
    assert set(names(kept())[1:]) == {"t1_C", "t2_C", "t3_C"}
    assert fingerprint(learned().take(np.arange(LENGTH)), 0, np.ones(LENGTH, dtype=np.bool_)) is None


@pytest.mark.parametrize("copies", [2, 5, 9])
def test_as_many_copies_as_one_likes_are_found(copies: int) -> None:
    day = learned()
    n = len(day)
    found = repeats(joined(*(day.take(slice_of(0, n - 3 * k)) for k in range(copies))), 0)
    assert (found[:n] == -1).mean() > 0.95
    assert (found[n + 2 * LENGTH : n + 400] >= 0).all()
    assert (found[n:] >= 0).mean() > 0.95


def test_a_copy_that_was_read_at_another_rate_is_found_beside_the_original() -> None:
    day = learned()
    for every in (2, 3):
        thin = day.take(np.arange(0, len(day), every))
        both = replace(
            day,
            values=np.concatenate([day.values, thin.values]),
            deviations=np.concatenate([day.deviations, thin.deviations]),
            time=np.concatenate([day.time, thin.time]),
            test=np.concatenate([day.test, thin.test + 1]),
            cycle=np.concatenate([day.cycle, thin.cycle]),
            row=np.concatenate([day.row, thin.row]),
            resting=None,
            test_names=("a", "b"),
            hashes=("", ""),
            starts=(),
        )
        assert (repeats(both, 0)[len(day) :] >= 0).mean() > 0.9


def test_a_target_beside_the_speed_alone_is_known_if_it_comes_again_for_long() -> None:
    walk = np.cumsum(np.random.default_rng(3).normal(size=700))
    speed = Channel("spindle_rpm", "spindle_speed", "1/min")
    once = replace(series(np.zeros((700, 1)), walk), inputs=(speed,))
    assert (repeats(once, 0) == -1).all()
    assert (repeats(joined(once, once), 0)[700:] >= 0).mean() > 0.95
