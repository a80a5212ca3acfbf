"""Recordings stacked into samples: references, time steps, what may be an input."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from thermocomp.core.exceptions import InputError, RecordingError
from thermocomp.core.machine import Channel
from thermocomp.core.zero import FIRST_READING, Zeroing, mean_over_time
from thermocomp.recordings import stacking
from thermocomp.recordings.cycles import Cycle, make_single_cycle
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.starts import COLD, Start

CHANNELS = (
    Channel("t1_C", "temperature", "degC"),
    Channel("spindle_rpm", "spindle_speed", "1/min"),
    Channel("t2_C", "temperature", "degC"),
    Channel("z_um", "displacement", "um"),
)


def stack(recordings: list[Recording], targets: list[str], inputs: list[str] | None = None, **how: bool) -> Samples:
    """Stack tests of random numbers: their zero is the first row, and they begin cold whatever they measured there."""
    return stacking.stack(recordings, targets, inputs, zeroing=FIRST_READING, starts=COLD, **how)


def _test(name: str, steps: list[float], seed: int, first_missing: int = 0) -> Recording:
    values = np.random.default_rng(seed).normal(20, 5, size=(len(steps) + 1, len(CHANNELS)))
    values[:first_missing, 2] = np.nan
    table = pd.DataFrame(values, columns=[c.name for c in CHANNELS])
    return Recording(
        name, np.cumsum([0.0, *steps]), table, CHANNELS, make_single_cycle(len(table)), sha256=f"{seed:064d}"
    )


TESTS = st.lists(st.lists(st.floats(0.5, 100.0), min_size=2, max_size=8), min_size=1, max_size=4)


@given(steps=TESTS)
def test_the_first_row_of_each_test_has_no_row_before_it(steps: list[list[float]]) -> None:
    samples = stack([_test(f"test {k}", s, k) for k, s in enumerate(steps)], ["z_um"])

    first = samples.row == 0
    assert first.sum() == len(steps)
    np.testing.assert_array_equal(np.isinf(samples.dt()), first)
    np.testing.assert_allclose(samples.dt()[~first], np.concatenate(steps), rtol=1e-9)


@settings(deadline=None)
@given(steps=TESTS, first_missing=st.integers(0, 2))
def test_temperatures_are_counted_from_the_first_complete_row_of_their_test(
    steps: list[list[float]], first_missing: int
) -> None:
    recordings = [_test(f"test {k}", s, k, first_missing) for k, s in enumerate(steps)]

    samples = stack(recordings, ["z_um"])
    absolute = stack(recordings, ["z_um"], rezero=False)

    assert [c.name for c in samples.inputs] == ["t1_C", "t2_C", "spindle_rpm"]
    for k, recording in enumerate(recordings):
        temperatures = recording.table[["t1_C", "t2_C"]].to_numpy()
        change = samples.change()[samples.test == k]
        np.testing.assert_array_equal(change[:, :2], temperatures - temperatures[first_missing])
        np.testing.assert_array_equal(change[:, 2], recording.table["spindle_rpm"])
    np.testing.assert_array_equal(absolute.change(), absolute.values)
    assert samples.frame().columns.tolist() == ["t1_C", "t2_C", "spindle_rpm"]


@given(keep=st.lists(st.booleans(), min_size=9, max_size=9))
def test_taking_rows_keeps_what_belongs_to_them(keep: list[bool]) -> None:
    samples = stack([_test("a", [1.0] * 4, 1), _test("b", [2.0] * 3, 2)], ["z_um"])

    taken = samples.take(np.array(keep))

    np.testing.assert_array_equal(taken.values, samples.values[keep])
    np.testing.assert_array_equal(taken.deviations, samples.deviations[keep])
    np.testing.assert_array_equal(taken.row, samples.row[keep])
    assert len(taken) == sum(keep)
    assert (taken.test_names, taken.hashes) == (samples.test_names, samples.hashes)


def test_cycles_and_names_are_those_of_the_tests() -> None:
    first = _test("a", [1.0] * 3, 1).with_cycles([Cycle("one", 0, 1), Cycle("two", 1, 4)])

    alone = stack([first], ["z_um"])
    both = stack([first, _test("a", [1.0], 2)], ["z_um"])

    assert alone.cycle_names == ("one", "two")
    assert alone.cycle.tolist() == [0, 1, 1, 1]
    assert both.test_names == ("a#1", "a#2")
    assert both.cycle_names == ("a#1: one", "a#1: two", "a#2: whole test")
    assert both.cycle.tolist() == [0, 1, 1, 1, 2, 2]
    assert both.row.tolist() == [0, 1, 2, 3, 0, 1]


def test_a_model_is_told_reference_and_trained_range() -> None:
    recording = _test("a", [1.0] * 5, 3)
    samples = stack([recording], ["z_um"])

    temperature, speed = samples.model_inputs([0, 2], np.arange(1, 5))

    values = recording.table["t1_C"].to_numpy()
    assert (temperature.name, temperature.rezero, temperature.reference) == ("t1_C", True, values[0])
    assert temperature.low == (values[1:5] - values[0]).min()
    assert temperature.high == (values[1:5] - values[0]).max()
    assert (speed.name, speed.rezero, speed.reference) == ("spindle_rpm", False, 0.0)
    assert speed.high == recording.table["spindle_rpm"].iloc[1:5].max()


def test_what_cannot_be_stacked_is_told() -> None:
    recording = _test("a", [1.0], 1)
    blind = Recording("blind", recording.time, recording.table[["z_um"]], CHANNELS[3:], make_single_cycle(2))

    with pytest.raises(InputError, match="no recording given"):
        stack([], ["z_um"])
    with pytest.raises(InputError, match="no target given"):
        stack([recording], [])
    with pytest.raises(InputError, match="target t1_C measures temperature"):
        stack([recording], ["t1_C"])
    with pytest.raises(InputError, match="input z_um is a displacement"):
        stack([recording], ["z_um"], ["t1_C", "z_um"])
    with pytest.raises(InputError, match="blind: no temperature and no spindle speed"):
        stack([blind], ["z_um"])
    with pytest.raises(InputError, match="only one of them has spindle_rpm, t1_C, t2_C"):
        stack([recording, blind], ["z_um"])
    with pytest.raises(InputError, match=r"blind: no channel is named 't1_C'"):
        stack([recording, blind], ["z_um"], ["t1_C"])
    with pytest.raises(RecordingError, match="a: no row has a number in all of the inputs"):
        stack([_test("a", [1.0], 1, first_missing=2)], ["z_um"]).reference()


def test_a_position_is_no_input_yet() -> None:
    """Nor a way in for a displacement that a mapping calls a position."""
    recording = _test("a", [1.0], 1)
    channels = tuple(replace(c, quantity="position", unit="mm") if c.name == "t2_C" else c for c in recording.channels)
    with pytest.raises(InputError, match="input t2_C is a position"):
        stack([replace(recording, channels=channels)], ["z_um"], ["t1_C", "t2_C"])


def test_numbers_beyond_all_machines_are_refused() -> None:
    recording = _test("a", [1.0], 1)
    recording.table.loc[1, "z_um"] = 1e201
    with pytest.raises(RecordingError, match=r"a: z_um is 1e\+201 um in row 1: correct it"):
        stack([recording], ["z_um"])


def test_a_recording_finds_its_channels_by_any_of_their_names() -> None:
    recording = _test("a", [1.0, 3.0], 1)

    assert recording.channel("z_um") == CHANNELS[3]
    assert [c.name for c in recording.temperatures] == ["t1_C", "t2_C"]
    assert [c.name for c in recording.displacements] == ["z_um"]
    assert recording.speed == CHANNELS[1]
    assert recording.sampling_interval == 2.0
    assert np.isnan(
        Recording("one", np.zeros(1), recording.table[:1], CHANNELS, make_single_cycle(1)).sampling_interval
    )
    with pytest.raises(InputError, match=r"no channel is named 't3_C'; the nearest are t2_C, t1_C"):
        recording.channel("t3_C")


@pytest.mark.parametrize(
    ("time", "cycles", "says"),
    [
        ([0.0], make_single_cycle(2), "1 times for 2 rows"),
        ([0.0, 0.0], make_single_cycle(2), "time does not increase at row 1"),
        ([0.0, np.nan], make_single_cycle(2), "time does not increase at row 1"),
        ([0.0, 1.0], make_single_cycle(1), "expected consecutive cycles that cover rows 0 to 2"),
        ([0.0, 1.0], (), "expected consecutive cycles that cover rows 0 to 2"),
    ],
)
def test_a_recording_that_contradicts_itself_is_refused(
    time: list[float], cycles: tuple[Cycle, ...], says: str
) -> None:
    table = _test("a", [1.0], 1).table

    with pytest.raises(RecordingError, match=says):
        Recording("a", np.array(time), table, CHANNELS, cycles)
    with pytest.raises(RecordingError, match="are not the channels"):
        Recording("a", np.array([0.0, 1.0]), table, CHANNELS[:2], make_single_cycle(2))


def _drift(start: float = 0.0, *, at_rest: int = 30, interval: float = 15.0, stamp: str = "") -> Recording:
    """Return a test that stands for some rows and then warms up; its readings are noisy."""
    rng, n = np.random.default_rng(0), 200
    warm = np.maximum(np.arange(n) - at_rest, 0) * 0.1
    columns = [
        20 + warm + 0.4 * rng.normal(size=n), np.where(np.arange(n) < at_rest, 0.0, 3000.0),
        21 + warm + 0.4 * rng.normal(size=n), start + 3 * warm + 0.1 * rng.normal(size=n),
    ]  # fmt: skip
    table = pd.DataFrame(dict(zip((c.name for c in CHANNELS), columns, strict=True)))
    return Recording(
        f"d{start:g}", np.array([interval * k for k in range(n)]), table, CHANNELS, make_single_cycle(n), start=stamp
    )


def test_the_zero_is_the_mean_over_five_minutes_at_rest() -> None:
    recording = _drift()
    values, time = recording.table[["t1_C", "t2_C"]].to_numpy(), recording.time
    found = stacking.stack([recording], ["z_um"])
    assert found.zeroing == Zeroing(300.0, 10.0, "spindle_rpm")
    assert found.reference()[0] == pytest.approx([*mean_over_time(time[:21], values[:21]), 0.0], abs=1e-12)
    assert found.deviations[:, 0].tolist() == recording.table["z_um"].tolist()  # what is measured stays as it is
    longer = stacking.stack([recording], ["z_um"], zeroing=Zeroing(1e4, 0.0, "spindle_rpm"))
    assert longer.reference()[0] == pytest.approx([*mean_over_time(time[:30], values[:30]), 0.0], abs=1e-12)
    short = stacking.stack([_drift(at_rest=5)], ["z_um"])
    values = _drift(at_rest=5).table[["t1_C", "t2_C"]].to_numpy()
    assert short.reference()[0] == pytest.approx([*mean_over_time(time[:5], values[:5]), 0.0], abs=1e-12)


def test_what_starts_at_once_has_its_first_row_for_a_zero() -> None:
    for recording in (_drift(at_rest=0), replace(_drift(at_rest=0, interval=60.0), name="slow")):
        assert stacking.stack([recording], ["z_um"]).reference()[0][0] == recording.table["t1_C"][0]
    quick = _drift(at_rest=0, interval=2.0)
    mean = mean_over_time(quick.time[:6], quick.table[["t1_C"]].to_numpy()[:6])
    assert stacking.stack([quick], ["z_um"]).reference()[0][0] == pytest.approx(mean[0], abs=1e-12)
    mute = stacking.stack([_drift()], ["z_um"], ["t1_C"], zeroing=Zeroing())  # nothing says that it stands
    assert mute.reference()[0][0] == _drift().table["t1_C"][0]


def test_an_outlier_and_a_gap_are_not_in_the_zero() -> None:
    recording = _drift()
    recording.table.loc[4, "t1_C"] = 85.0
    recording.table.loc[6, "t2_C"] = np.nan
    rows, read = [k for k in range(21) if k != 6], recording.table["t1_C"].to_numpy()
    zero = stacking.stack([recording], ["z_um"]).reference()[0][0]
    assert zero == pytest.approx(mean_over_time(recording.time[rows], read[rows]), abs=1e-12)
    assert zero == pytest.approx(np.delete(read[:21], [4, 6]).mean(), abs=0.1)


@pytest.mark.parametrize(("level", "word"), [(0.0, "cold"), (2.5, "cold"), (5.0, "cold"), (6.0, ""), (-20.0, "")])
def test_a_displacement_that_does_not_begin_near_zero(level: float, word: str) -> None:
    """Its range is 51 um: a tenth of it is taken for zero."""
    recording = _drift(level)
    if word:
        assert stacking.stack([recording], ["z_um"]).starts[0].word == word
        return
    with pytest.raises(InputError, match=rf"d{level:g}: z_um begins at {level:.1f} um, so it was not zeroed"):
        stacking.stack([recording], ["z_um"])
    assert stacking.stack([recording], ["z_um"], rezero=False).starts[0].word == "known"  # its zero is that of 20 degC
    anew = stacking.stack([recording], ["z_um"], starts=Start("rezeroed"))
    assert anew.deviations[:21].mean() == pytest.approx(0.0, abs=0.01)


@pytest.mark.parametrize(
    ("stamp", "level", "word"),
    [
        ("2026-03-01T08:49:55", 50.7, "continued"),
        ("2026-03-01T08:49:55", 0.0, "rezeroed"),
        ("2026-03-01T09:09:55", 50.7, ""),  # twenty minutes later is another day
        ("2026-03-01T08:40:00", 50.7, ""),  # before the end of the first
        ("2026-03-01T08:49:55", 20.0, ""),  # not where the first ended
        ("", 50.7, ""),
    ],
)
def test_files_that_follow_each_other(stamp: str, level: float, word: str) -> None:
    first, second = _drift(stamp="2026-03-01T08:00:00"), _drift(level, stamp=stamp)
    second = replace(second, name="second", time=second.time + 0.0)
    second.table["t1_C"] += 0.01
    if not word:
        with pytest.raises(InputError, match="second: z_um begins at"):
            stacking.stack([second, first], ["z_um"])
        return
    found = stacking.stack([second, first], ["z_um"])
    assert [s.word for s in found.starts] == [word, "cold"]
    assert (found.cycle < 0).sum() == (200 if word == "continued" else 0)
    assert found.test.tolist() == sorted(found.test.tolist())
    if word == "continued":
        own = (found.test == 0) & (found.cycle >= 0)
        assert found.time[own][0] == 2995.0
        assert np.isnan(found.deviations[(found.test == 0) & ~own]).all()


def test_three_files_of_one_test() -> None:
    """What the last one continues from is both others, in the order of time."""
    first = _drift(stamp="2026-03-01T08:00:00")
    second = replace(_drift(50.7, stamp="2026-03-01T08:49:55"), name="second")
    second.table["z_um"] = 50.7
    third = replace(_drift(50.7, stamp="2026-03-01T09:39:50"), name="third")
    found = stacking.stack([third, first, second], ["z_um"])
    assert [[r.name for r in s.earlier] for s in found.starts] == [["d0", "second"], [], ["d0"]]
    assert found.reference()[0].tolist() == found.reference()[1].tolist() == found.reference()[2].tolist()
    assert found.time[found.test == 0][[0, 200, 400]].tolist() == [0.0, 2995.0, 5990.0]


def test_a_test_without_a_complete_row_has_no_zero() -> None:
    samples = stack([_test("a", [1.0, 1.0], 0), _test("b", [1.0, 1.0], 1, first_missing=3)], ["z_um"])
    with pytest.raises(RecordingError, match="b: no row has a number in all of the inputs"):
        samples.change()
