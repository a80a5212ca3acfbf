"""What judged units covered: known conditions are found again, and copies count once."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from smallmachine import small_machine

from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Channel
from thermocomp.core.validity import Validity
from thermocomp.files import modelfile
from thermocomp.judging import assessing, coverage, splits, study
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack


def with_room(start: str = "2024-03-01T20:00:00") -> Recording:
    plain = small_machine()
    table = plain.table.assign(t_room_C=np.linspace(19.0, 24.0, len(plain)))
    channels = (*plain.channels, Channel("t_room_C", "temperature", "degC"))
    return replace(plain, table=table, channels=channels, start=start)


def covered(recordings: list[Recording], judging: str = "cycles") -> Validity:
    samples = stack(recordings, ["z_um"])
    by = {"cycles": splits.leave_one_cycle_out, "files": splits.leave_one_file_out}[judging]
    return coverage.find_validity(samples, by(samples), recordings)


def test_conditions_are_found_again() -> None:
    found = covered([with_room()])
    assert (found.units, found.independent) == (4, 4)
    assert found.speeds == (0.0, 1000.0, 1800.0, 2500.0, 3000.0)
    assert found.ambient == (19.0, 24.0)
    assert found.ambient_channel == "t_room_C"
    assert found.days == 2  # 800 min from eight in the evening
    assert found.hours == pytest.approx(799 / 60)
    assert found.start is not None
    assert 20 < found.start[0] < found.start[1] < 25
    assert found.nearest is not None
    assert found.nearest > 0.2


def test_only_what_was_judged_counts() -> None:
    recording = with_room()
    samples = stack([recording], ["z_um"])
    last = coverage.find_validity(samples, splits.parse("0.75/0.25", samples), [recording])
    assert (last.units, last.independent, last.nearest) == (1, 1, None)
    assert last.speeds == (0.0, 3000.0)
    assert last.ambient is not None
    assert last.ambient[0] > 22


@pytest.mark.parametrize(
    ("quantity", "unit", "values", "axes"),
    [
        ("feed", "mm/min", (0.0, 0.0), "stood still"),
        ("feed", "mm/min", (6000.0, 6000.0), "moved"),
        ("position", "mm", (250.0, 250.0), "stood still"),
        ("position", "mm", (250.0, 250.1), "moved"),
        ("position", "mm", (np.nan, np.nan), "not recorded"),
        ("dimensionless", "", (0.0, 1.0), "not recorded"),
    ],
)
def test_it_tells_whether_axes_moved(quantity: str, unit: str, values: tuple[float, float], axes: str) -> None:
    plain = small_machine()
    column = np.where(np.arange(len(plain)) % 50 == 7, values[1], values[0])
    channels = (*plain.channels, Channel("axis", quantity, unit))
    recording = replace(plain, table=plain.table.assign(axis=column), channels=channels)
    samples = stack([recording], ["z_um"], ["t1_C", "t2_C", "spindle_rpm"])
    found = coverage.find_validity(samples, splits.leave_one_cycle_out(samples), [recording])
    assert found.axes == axes
    assert {str(row[0]): row[1] for row in coverage.table({"": found}).rows}["axes"] == axes
    assert covered([plain]).axes == "not recorded"


def test_axes_that_move_before_the_judged_rows_do_not_count() -> None:
    plain = small_machine()
    moved = plain.table.assign(feed_mm_min=np.where(np.arange(len(plain)) < 50, 6000.0, 0.0))
    recording = replace(plain, table=moved, channels=(*plain.channels, Channel("feed_mm_min", "feed", "mm/min")))
    samples = stack([recording], ["z_um"])
    assert coverage.find_validity(samples, splits.parse("0.75/0.25", samples), [recording]).axes == "stood still"


def copied(times: int, noise: float, room: float = 0.0) -> list[Recording]:
    """Return the same test several times, with other noise, and in a room that is warmer each time."""
    plain = small_machine()
    rng = np.random.default_rng(1)
    found = []
    for k in range(times):
        table = plain.table.copy()
        heat = [c for c in table.columns if str(c).endswith("_C")]
        table[heat] = table[heat] + k * room + noise * rng.normal(size=(len(table), len(heat)))
        found.append(replace(plain, name=f"day {k}", table=table))
    return found


def test_copies_count_once() -> None:
    assert covered(copied(3, 0.02), "files").independent == 1
    two_kinds = [*copied(2, 0.02), replace(small_machine([2000.0, 500.0, 3000.0, 1500.0], seed=3), name="other")]
    found = covered(two_kinds, "files")
    assert (found.units, found.independent) == (3, 2)
    assert found.nearest is not None
    assert found.nearest < coverage.ALIKE
    # the same program in a room that is five degrees warmer is no copy
    assert covered(copied(3, 0.02, room=5.0), "files").independent == 3


def test_an_idle_sensor_makes_no_two_tests_different() -> None:
    rng = np.random.default_rng(2)
    idle = Channel("t_idle_C", "temperature", "degC")
    found = []
    for plain in copied(4, 0.02):
        table = plain.table.assign(t_idle_C=20 + 0.05 * rng.normal(size=len(plain.table)))
        found.append(replace(plain, table=table, channels=(*plain.channels, idle)))
    assert covered(found, "files").independent == 1


def test_one_test_at_two_rates_is_one() -> None:
    plain = small_machine()
    thin = Recording.from_dataframe(plain.table.assign(time_s=plain.time).iloc[::3], name="thin")
    assert covered([plain, thin], "files").independent == 1


def test_a_part_of_a_test_is_no_copy_of_it() -> None:
    whole = small_machine()
    half = len(whole) // 2
    part = replace(whole, name="part", time=whole.time[:half], table=whole.table[:half], cycles=whole.cycles[:2])
    assert covered([whole, part], "files").independent == 2


def test_the_same_shape_at_half_the_pace_is_no_copy() -> None:
    whole = small_machine()
    table = pd.DataFrame(np.repeat(whole.table.to_numpy(), 2, axis=0), columns=whole.table.columns)
    cycles = tuple(replace(c, start=2 * c.start, stop=2 * c.stop) for c in whole.cycles)
    slow = replace(whole, name="slow", time=np.arange(0.0, 60.0 * len(table), 60.0), table=table, cycles=cycles)
    assert covered([whole, slow], "files").independent == 2


def test_constant_inputs_and_no_units_are_no_trouble() -> None:
    plain = small_machine()
    table = plain.table.copy()
    table[["t1_C", "t2_C", "t3_C"]] = 20.0
    table["spindle_rpm"] = 0.0
    found = covered([replace(plain, table=pd.DataFrame(table))])
    assert (found.units, found.independent) == (4, 1)
    assert found.days == 0
    assert found.ambient is None
    samples = stack([plain], ["z_um"])
    nothing = coverage.find_validity(samples, splits.Judging("none", ()))
    assert (nothing.units, nothing.independent, nothing.hours) == (0, 0, 0.0)
    with pytest.raises(InputError, match="independent = 5: expected 0 to units = 4"):
        replace(found, independent=5)


def test_the_model_file_carries_it_and_assess_tells_both(samples: Samples, recording: Recording) -> None:
    judging = splits.leave_one_cycle_out(samples)
    (first, *_) = fitted = study.fit(samples, "ols", judging, recordings=[recording]).models
    assert first.validity == coverage.find_validity(samples, judging, [recording])
    assert modelfile.loads(modelfile.dumps(fitted)) == fitted
    other = replace(small_machine([2000.0, 900.0], seed=9), name="other")
    judged = assessing.assess(fitted, [other])
    assert judged.validity is not None
    assert judged.validity.speeds == (0.0, 900.0, 2000.0)
    shown = coverage.table({"when fitted": first.validity, "these recordings": judged.validity})
    assert shown.columns == ("", "when fitted", "these recordings")
    cells = {str(row[0]): row[1:] for row in shown.rows}
    assert cells["spindle speeds [1/min]"] == ("0, 1000, 1800, 2500, 3000", "0, 900, 2000")
    assert cells["cycles or files judged"] == ("4, 4 of them distinct", "2, 2 of them distinct")
    assert "copies count once" in shown.caption


NAMES = ("Luft_C", "Raumtemperatur_C", "T_Halle", "Umgebung_C", "air"), ("Kühlluft_C", "Lufter_C", "t1_C", "repair_C")


@pytest.mark.parametrize(("name", "there"), [(name, there) for there in (True, False) for name in NAMES[not there]])
def test_surroundings_are_found_by_their_name(name: str, there: bool) -> None:
    recording = small_machine()
    last = recording.temperatures[-1]
    channels = tuple(replace(c, name=name) if c is last else c for c in recording.channels)
    table = recording.table.rename(columns={last.name: name})
    found = replace(recording, channels=channels, table=table).ambient
    assert (found is not None) == there
