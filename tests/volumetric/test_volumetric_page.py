"""The volumetric page: all numbers and figures on one page, nothing from outside, any machine of up to three axes."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from smallmill import write_mill

from thermocomp.core.machine import Axis, Machine
from thermocomp.core.structure import Structure
from thermocomp.files.draft import write_text
from thermocomp.files.machines import read_machine
from thermocomp.recordings.readers import recordings
from thermocomp.recordings.recording import Recording
from thermocomp.volumetric.judging.volumetric import Volumetric, study
from thermocomp.volumetric.report import volumetric as page
from thermocomp.volumetric.report import volumetric_figures as figures
from thermocomp.volumetric.report import volumetric_space as space
from thermocomp.volumetric.report import volumetric_tables


@pytest.fixture(scope="module")
def mill(tmp_path_factory: pytest.TempPathFactory) -> tuple[Machine, Recording]:
    machine, recording = write_mill(tmp_path_factory.mktemp("mill"))
    return read_machine(machine), recordings.read(recording)


@pytest.fixture(scope="module")
def found(mill: tuple[Machine, Recording]) -> Volumetric:
    return study(*mill, at=(500.0, 100.0, 50.0), grid=3)


def texts(svg: str) -> list[str]:
    return re.findall(r"<text[^>]*>([^<]*)</text>", svg)


def test_the_page_says_all_of_it(found: Volumetric, tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    write_text(page.render(found), path, overwrite=False)
    text = path.read_text(encoding="utf-8")
    assert volumetric_tables.headline(found) in text
    assert "X 0 to 600 mm, Y -200 to 200 mm, Z 0 to 500 mm" in text
    assert text.count("<svg") == 6
    assert text.count("<tr") == (1 + 9) + (1 + 3) + (1 + 9) + (1 + 32)
    assert "Not judged on unseen cycles: EXX, Z0C." in text
    worst = found.worst.straight
    assert f"<td>{worst.before.rms:.2f}</td><td>{worst.before.largest:.2f}</td>" in text
    assert f"<td>{worst.lines[0].correction.slope:.2f}</td>" in text
    assert ">-0.00<" not in text
    assert "<script" not in text
    assert "http" not in re.sub(r"http://(www\.w3|purl|creativecommons)\.org|https://matplotlib\.org", "", text)
    assert len(text) < 1_500_000
    assert page.render(found) == text  # the same from run to run


def test_the_boxes_tell_states_and_scale(found: Volumetric) -> None:
    said = texts(space.boxes(found))
    for moment in found.moments:
        assert moment.name in said
        size = moment.straight.before
        assert f"RMS {size.rms:.1f} um, largest {size.largest:.1f} um" in said
    assert said.count("corrected by straight lines") == 3
    (scale,) = (t for t in said if "magnified" in t)
    told = re.fullmatch(r"([\d.]+) um of error, magnified ([\d,]+) times", scale)
    assert told is not None
    largest = found.worst.straight.before.largest
    # the largest error is drawn as some share of the longest travel, the scale is not longer than it
    assert 0.5 * space.DRAWN * 600 < 1e-3 * largest * float(told[2].replace(",", "")) <= space.DRAWN * 600
    assert 0.3 * largest < float(told[1]) <= largest


def test_the_components_are_drawn(found: Volumetric) -> None:
    curves = texts(figures.curves(found))
    assert any("EXX" in t for t in curves)
    assert not any("EYX" in t for t in curves)
    scalars = " ".join(texts(figures.scalars(found)))
    for code in ("Z0C", "C0Y", "B0C"):
        assert code in scalars
    shares = texts(figures.contributions(found))
    order = [t for t in shares if t.endswith(("Z0C", "EXX", "C0Y"))]
    assert [t.split()[-1] for t in order] == ["Z0C", "EXX", "C0Y"]
    row = found.worst.row
    assert f"{found.course.error[row, 2]:.1f}".replace("-", "−") in {t.replace("-", "−") for t in shares}


def test_a_projection_keeps_what_is_up() -> None:
    ahead = space._seen(np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]))
    assert ahead[0] == pytest.approx([0.0, np.cos(np.radians(space.ELEVATION))])
    assert ahead[1, 0] > 0 > ahead[1, 1]  # X to the right and towards the reader
    assert ahead[2, 0] > 0
    assert ahead[2, 1] > 0


@pytest.mark.parametrize(("value", "nice"), [(1.0, 1.0), (1.4, 1.0), (99.0, 50.0), (0.29, 0.2), (1600.0, 1500.0)])
def test_round_numbers(value: float, nice: float) -> None:
    assert space._nice(value) == pytest.approx(nice)


def test_machines_of_fewer_axes_and_of_no_errors(mill: tuple[Machine, Recording]) -> None:
    machine, recording = mill
    x, z = machine.axis("X"), machine.axis("Z")
    exx = machine.components["EXX"]
    one = Machine("one", Structure.parse("XF"), (x,), {"EXX": exx})
    two = Machine("two", Structure.parse("XFZ"), (x, z), {"EXX": exx, "X0C": 2.0, "Y0C": 3.0})
    for made, drawn in ((one, 3), (two, 5)):
        text = page.render(study(made, recording))
        assert text.count("<svg") == drawn
    nothing = study(replace(machine, components={}))
    assert page.render(nothing).count("<svg") == 2
    assert volumetric_tables.headline(nothing).startswith(
        "Largest error in the work volume in the reference state: 0.0 um"
    )
    # what an axis that is not there would have to correct, stays
    sizes = study(two).worst.sizes
    assert sizes["everything"].largest == pytest.approx(3.0, abs=1e-3)
    assert volumetric_tables.headline(study(two)).endswith("3.00 um")


def test_the_largest_error_is_looked_for_at_the_corners_too() -> None:
    model = read_only_slope()
    recording = model[1]
    found = study(*model, grid=2)
    moment = next(m for m in found.moments if "largest" in m.label)
    heat = recording.table["t1_C"].to_numpy()
    assert moment.row == int(np.argmax(np.abs(heat - heat[0])))
    assert np.abs(found.course.error).max() == 0.0  # nothing moves in the middle


def read_only_slope() -> tuple[Machine, Recording]:
    from smallmachine import small_machine
    from smallmill import warmed

    from thermocomp.core.position import PositionModel

    slope = PositionModel(
        target="EXX",
        unit="um",
        axis="X",
        travel=(0.0, 600.0),
        reference_position=300.0,
        slopes=(warmed("k_1", "um/m", 2.0),),
    )
    return Machine("one", Structure.parse("XF"), (Axis("X", (0.0, 600.0)),), {"EXX": slope}), small_machine()
