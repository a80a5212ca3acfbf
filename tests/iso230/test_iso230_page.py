"""The page of ISO 230 tests: offline, complete, and drawn for every kind of test."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from smallmachine import small_machine

from thermocomp.core.inputs import Input
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.terms import Variable
from thermocomp.files.draft import write_text
from thermocomp.iso230 import part2, part3
from thermocomp.iso230.report import iso230 as pages
from thermocomp.iso230.report import iso230figures as figures
from thermocomp.iso230.thermaltest import ThermalTest
from thermocomp.judging.settling.settling import time_constants
from thermocomp.virtual.datasets import record
from thermocomp.volumetric.positioning import Positioning


def positioning_test(*, both: bool = True) -> Positioning:
    positions = np.linspace(0, 500, 6)
    rng = np.random.default_rng(2)
    up = 0.02 * positions + rng.normal(size=(5, 6))
    return Positioning("Y", "cold", "um", positions, up, up - 2 if both else None, "y.csv")


def model(target: str, coefficient: float, sensor: str) -> Polynomial:
    heat = Input(sensor, "temperature", "degC", 20.0, True, -5.0, 30.0)
    variables = (Variable.single(sensor, 0),)
    return Polynomial(
        target=target, unit="um", inputs=(heat,), variables=variables, terms=((0,),), coefficients=(coefficient,)
    )


@pytest.fixture(scope="module")
def spindle() -> ThermalTest:
    recording = record("iso230-spindle")[0]
    pairs = part3.find_pairs(recording, 100.0)
    (test,) = part3.assess(recording, pairs=pairs, models=[model("z_um", -4.0, "t_front_seat_C")])
    return test


def test_the_page_is_offline_and_complete(spindle: ThermalTest, tmp_path: Path) -> None:
    axis = part3.assess(record("iso230-axis")[1])[0]
    etve = part3.assess(record("etve")[0])[0]
    settlings = [(t.recording, time_constants(t.recording)) for t in (spindle, axis, etve)]
    results = [part2.assess(positioning_test())]
    path = tmp_path / "page.html"
    write_text(pages.render([spindle, axis, etve], settlings, results), path, overwrite=False)
    text = path.read_text(encoding="utf-8")
    for word in ("http://www.w3.org", "https://matplotlib.org", "http://purl.org", "http://creativecommons.org"):
        text = text.replace(word, "")
    assert "http" not in text
    assert "<script" not in text
    for said in (
        "Environmental temperature variation error (ETVE)",
        "Thermal distortion caused by the rotating spindle",
        "Thermal distortion caused by the moving linear axis",
        "spindle at 2600 1/min",
        "y1_um and y2_um 100 mm apart",
        "z_um, with model",
        "Axis Y: change of the length over 550 mm [µm]",
        "Time constants: cool-down [min]",
        "The text of ISO 230-3:2020 was not available",
        "computed by its formulas as textbooks quote them",
    ):
        assert said in text, said
    for curve in (*spindle.all_curves, *axis.all_curves):
        assert f"{round(curve.figures.range_all, 2):.4g}" in text, curve.name
    # ETVE has no warm-up: no time constants
    assert text.count(": time constants</h2>") == 2
    assert text.count("<svg") == 3 + 1 + 2 + 1


def test_a_page_of_positioning_only() -> None:
    text = pages.render([], [], [part2.assess(positioning_test()), part2.assess(positioning_test(both=False))])
    assert "ISO 230-3" not in text
    assert "y.csv" in text
    assert text.count("<svg") == 2
    assert "approached from one direction only" in text


def test_a_single_run_on_the_page() -> None:
    positions = np.linspace(0, 3000, 13)
    up = 0.01 * positions[None]
    text = pages.render([], [], [part2.assess(Positioning("X", "", "um", positions, up, up - 2, "x.csv"))])
    assert "mean ↑ of a single run" in text
    assert "a single run in direction +: s, R and A need at least two" in text
    assert "measurement uncertainty is not given" in text
    assert "nan" not in text.lower().replace("finance", "")


def test_figures_say_what_they_show(spindle: ThermalTest) -> None:
    drawn = figures.thermal(spindle)
    for said in ("60 min", "tilts A (about X) and B (about Y)", "urad = um/m", "with model", "t_air_C: surroundings"):
        assert said in drawn, said
    r = part2.assess(positioning_test())
    drawn = figures.positioning(r)
    for symbol in ("A", "E", "M"):
        assert f"{symbol} {r.axis_values[symbol]:.3g}" in drawn
    assert "↑" in figures.positioning(part2.assess(positioning_test(both=False)))


def test_an_axis_before_and_after_over_its_travel() -> None:
    recording = record("iso230-axis")[0]
    models = [model(c.name, 1.0, "t_x_bearing_C") for c in recording.displacements]
    (test,) = part3.assess(recording, models=models)
    assert "residual with the model" in figures.profiles(test, 0)
    (without,) = part3.assess(recording)
    assert "residual with the model" not in figures.profiles(without, 0)


def test_odd_recordings_are_drawn_too() -> None:
    recording = small_machine()
    assert "small, 4" in pages.render(part3.assess(recording), [(recording, time_constants(recording))], [])
    bare = replace(
        recording,
        table=recording.table[["z_um"]],
        channels=tuple(c for c in recording.channels if c.name == "z_um"),
    )
    (test,) = part3.assess(bare)
    assert test.kind == "etve"
    assert "<svg" in pages.render([test], [(bare, time_constants(bare))], [])
    holes = recording.table.copy()
    holes.loc[holes.index % 10 != 0, "z_um"] = np.nan
    (first, *_) = part3.assess(replace(recording, table=holes))
    assert "<svg" in figures.thermal(first)
