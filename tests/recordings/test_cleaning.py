"""Steps of a cleaning: what they change, what they leave alone, what they say, what they refuse."""

from collections.abc import Sequence
from datetime import datetime
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest

from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Channel
from thermocomp.recordings.cleaning import Cut, Resample, Rezero, Shift, Step, Swap, clean
from thermocomp.recordings.rows import Rows

CHANNELS = (
    Channel("n_rpm", "spindle_speed", "1/min"),
    Channel("t1_C", "temperature", "degC"),
    Channel("t2_C", "temperature", "degC"),
    Channel("z_um", "displacement", "um"),
)


def rows(n: int = 12, every: float = 10.0, start: str = "") -> Rows:
    k = np.arange(float(n))
    table = pd.DataFrame({"n_rpm": 3000.0 * (k >= 4), "t1_C": 20 + 0.1 * k, "t2_C": 25 - 0.2 * k, "z_um": 2.0 * k})
    return Rows("test.csv", "", every * k, start, table, CHANNELS, [int(v > 5) for v in k], "line {}".format)


def same(a: Rows, b: Rows, *but: str) -> None:
    assert np.array_equal(a.time, b.time)
    pd.testing.assert_frame_equal(a.table.drop(columns=list(but)), b.table.drop(columns=list(but)), check_exact=True)


def test_a_cut_of_values_leaves_all_else() -> None:
    cut = clean(rows(), [Cut(("z_um",), times=(30.0, (50.0, 70.0)), reason="spike")])
    same(cut, rows(), "z_um")
    assert np.flatnonzero(cut.table["z_um"].isna()).tolist() == [3, 5, 6, 7]
    assert cut.changed == ("cut: 4 of 12 values of z_um (spike): line 3, line 5 to 7",)


def test_a_cut_of_rows_takes_labels_and_places_along() -> None:
    cut = clean(rows(), [Cut(times=((0.0, 20.0), 60.0))])
    assert cut.time.tolist() == [30.0, 40.0, 50.0, 70.0, 80.0, 90.0, 100.0, 110.0]
    assert cut.labels == [0, 0, 0, 1, 1, 1, 1, 1]
    assert cut.place(3) == "line 7"
    assert cut.changed == ("cut: 4 of 12 rows: line 0 to 2, line 6",)
    again = clean(cut, [Cut(("t1_C",), times=(70.0,))])  # the times are those of the file
    assert np.flatnonzero(again.table["t1_C"].isna()).tolist() == [3]
    assert again.changed[-1] == "cut: 1 of 8 values of t1_C: line 7"


def test_times_may_be_timestamps() -> None:
    stamps: Sequence[str | datetime] = ("2024-05-06T08:00:30", datetime(2024, 5, 6, 8, 0, 30))
    for at in stamps:
        cut = clean(rows(start="2024-05-06T08:00:00"), [Cut(("z_um",), times=(at,))])
        assert np.flatnonzero(cut.table["z_um"].isna()).tolist() == [3]
    with pytest.raises(InputError, match="the file has no timestamps; give seconds"):
        clean(rows(), [Cut(("z_um",), times=("2024-05-06T08:00:30",))])
    with pytest.raises(InputError, match="expected seconds since the first row of the file, or a timestamp like"):
        clean(rows(start="2024-05-06T08:00:00"), [Cut(("z_um",), times=("2024-05-06T08:00:30+02:00",))])


@pytest.mark.parametrize("by", [20.0, -20.0])
def test_a_shift_of_whole_rows_is_exact(by: float) -> None:
    given = rows()
    moved = clean(given, [Shift(("t1_C", "n_rpm"), by_s=by)])
    same(moved, given, "t1_C", "n_rpm")
    for name in ("t1_C", "n_rpm"):
        wanted = given.table[name].shift(round(by / 10)).to_numpy()
        np.testing.assert_array_equal(moved.table[name].to_numpy(), wanted)
    way = "later" if by > 0 else "earlier"
    assert moved.changed == (f"shift: t1_C, n_rpm 20 s {way}; 2 rows at the end of the test are left without a value",)


def test_a_shift_between_rows_interpolates_but_a_speed_steps() -> None:
    moved = clean(rows(), [Shift(("t1_C", "n_rpm"), by_s=4.0)])
    np.testing.assert_allclose(moved.table["t1_C"][1:], rows().table["t1_C"][:-1] + 0.06, rtol=0, atol=1e-12)
    assert set(moved.table["n_rpm"][1:]) == {0.0, 3000.0}
    gap = rows()
    gap.table.loc[5, "t1_C"] = np.nan
    assert np.flatnonzero(clean(gap, [Shift(("t1_C",), by_s=4.0)]).table["t1_C"].isna()).tolist() == [0, 5, 6]


def test_a_probe_that_was_knocked_goes_on() -> None:
    knocked = rows()
    knocked.table.loc[7:, "z_um"] += 30.0
    mended = clean(knocked, [Rezero(("z_um",), at=70.0)])
    np.testing.assert_allclose(mended.table["z_um"], rows().table["z_um"], rtol=0, atol=1e-12)
    assert mended.changed == ("rezero: z_um: 5 values from line 7 on by -30",)
    there_and_back = rows()
    there_and_back.table.loc[4:6, "z_um"] += 30.0
    mended = clean(there_and_back, [Rezero(("z_um",), at=40.0, until=70.0)])
    np.testing.assert_allclose(mended.table["z_um"], rows().table["z_um"], rtol=0, atol=1e-12)


def test_a_probe_is_zeroed_at_an_instant() -> None:
    mended = clean(rows(), [Rezero(("z_um",), at=0.0, to=5.0)])
    assert mended.table["z_um"].tolist() == [5.0 + 2.0 * k for k in range(12)]
    with pytest.raises(
        InputError, match="z_um has no value before or after the given time, so the step there is unknown; give `to`"
    ):
        clean(rows(), [Rezero(("z_um",), at=0.0)])


def test_channels_that_were_exchanged_are_exchanged_back() -> None:
    swapped = rows()
    swapped.table.loc[6:, ["t1_C", "t2_C"]] = swapped.table.loc[6:, ["t2_C", "t1_C"]].to_numpy()
    mended = clean(swapped, [Swap(("t1_C", "t2_C"), at=60.0)])
    same(mended, rows())
    assert mended.changed == ("swap: t1_C and t2_C, 6 rows from 60 s on",)


def test_rows_are_averaged_backwards() -> None:
    mean = clean(rows(), [Resample(every_s=30.0)])
    assert mean.time.tolist() == [0.0, 30.0, 60.0, 90.0, 120.0]
    assert mean.table["z_um"].tolist() == [0.0, 4.0, 10.0, 16.0, 21.0]
    assert mean.labels == [0, 0, 1, 1, 1]
    assert mean.changed == ("resample: 12 rows to 5, averages over 30 s",)
    # nothing that comes later changes what was
    for a, b in pairwise(range(2, 13)):
        short, longer = (clean(rows(n), [Resample(every_s=30.0)]).table for n in (a, b))
        whole = (a - 1) // 3 + 1
        assert longer["z_um"][:whole].tolist() == short["z_um"][:whole].tolist()
    gap = rows().kept(np.array([0, 1, 10, 11]))
    assert clean(gap, [Resample(every_s=30.0)]).time.tolist() == [0.0, 30.0, 120.0]


@pytest.mark.parametrize(
    ("step", "message"),
    [
        (Cut(("q",), times=(0.0,)), r"test.csv: \[\[clean\]\] do = 'cut': no channel is named 'q'; there are n_rpm"),
        (Cut(("z_u",), times=(0.0,)), "no channel is named 'z_u'; the nearest are z_um"),
        (Cut(("z_um",), times=(33.0,)), "there is no row at 33 s; the nearest is at 30 s"),
        (Cut(("z_um",), times=((500.0, 600.0),)), "there is no row from 500 to 600 s; the nearest is at 110 s"),
        (Cut(times=((0.0, 500.0),)), "this would remove all 12 rows"),
        (Rezero(("z_um",), at=500.0), "there is no row at or after 500 s"),
        (
            Swap(("t1_C", "z_um"), at=60.0),
            "t1_C is a temperature and z_um a displacement: only channels of the same quantity can be exchanged",
        ),
    ],
)
def test_what_is_not_there_is_refused(step: Step, message: str) -> None:
    with pytest.raises(InputError, match=message):
        clean(rows(), [step])


def test_steps_that_say_nothing_are_refused() -> None:
    for make, message in (
        (lambda: Cut(("z_um",)), "specify the rows to cut"),
        (lambda: Shift(("z_um",)), "whose clock is wrong, and the time shift"),
        (lambda: Shift(by_s=4.0), "specify the channels whose clock is wrong"),
        (lambda: Rezero(at=4.0), "specify the channel of the probe"),
        (lambda: Swap(("z_um",)), "specify the two"),
        (Resample, "give the interval"),
        (lambda: Resample(("z_um",), every_s=4.0), "no channels"),
    ):
        with pytest.raises(InputError, match=message):
            make()


def test_a_table_with_several_rows_of_one_time_has_no_clock_to_shift() -> None:
    same_times = rows(every=0.0)
    for step in (Shift(("z_um",), by_s=4.0), Resample(every_s=4.0)):
        with pytest.raises(InputError, match="requires one row per time, but several rows have the same time"):
            clean(same_times, [step])
