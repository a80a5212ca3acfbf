"""The shifts of the axes' references and the drifts of the spindle, identified from displacements (C-01)."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from thermocomp.core.components import BY_CODE, COMPONENTS
from thermocomp.core.exceptions import FitError, InputError
from thermocomp.core.machine import Axis, Machine, Vector
from thermocomp.core.structure import Structure
from thermocomp.runtime.geometry.exact import error
from thermocomp.runtime.geometry.kinematics import INDEX
from thermocomp.volumetric.models.identification import (
    THERMAL,
    Displacement,
    IdentifiedComponents,
    effects_of_components,
    identify_components,
)

TEST: Vector = (300.0, 250.0, 300.0)
BAR: Vector = (0.0, 0.0, -150.0)
AXES = tuple(Axis(a, (0.0, 600.0), TEST[k], measured_at=TEST, measured_tool=BAR) for k, a in enumerate("XYZ"))
MILL = Machine("mill", Structure.parse("w X' b Z Y (C1) t"), AXES, spindle_tool=BAR, tool=BAR)
#: the bodies of the chain, and the components of the links between them, written out for this machine
LINKS = {("X", "bed"): "X", ("bed", "Z"): "Z", ("Z", "Y"): "Y", ("Y", "tool"): "C"}
BODIES = ("X", "bed", "Z", "Y", "tool")
ORIGINS = tuple(c.code for c in COMPONENTS if c.group == "origin")
#: five probes of a nest, three of them at the tip of the bar, two nearer to the spindle (ISO 230-3)
NEST = (("X", -150.0), ("Y", -150.0), ("Z", -150.0), ("X", -50.0), ("Y", -50.0))
PLACES: tuple[Vector, ...] = ((100.0, 100.0, 100.0), TEST, (500.0, 400.0, 500.0))


def nest(*between: str, places: tuple[Vector, ...] = PLACES) -> list[Displacement]:
    first, last = between or ("workpiece", "tool")
    return [Displacement(a, at, (0.0, 0.0, z), (first, last)) for at, (a, z) in product(places, NEST)]


def measured(readings: list[Displacement], values: np.ndarray) -> np.ndarray:
    """Return what the probes read: exact transforms of the components between the two bodies, one row per state."""
    found = np.empty((len(values), len(readings)))
    for k, r in enumerate(readings):
        first, last = (BODIES.index(b.replace("workpiece", "X")) for b in r.between)
        inside = [letter for link, letter in LINKS.items() if first <= BODIES.index(link[0]) < last]
        kept = np.array([c.code[2] in inside if c.group != "spindle" else "C" in inside for c in COMPONENTS])
        for n, state in enumerate(values):
            found[n, k] = error(MILL, state * kept, np.array(r.at), r.tool)["XYZ".index(r.along)]
    return found


def planted(n: int, rng: np.random.Generator) -> np.ndarray:
    """Return thermal states with all 11 components of C-01: up to some 40 um and 100 urad."""
    values = np.zeros((n, len(COMPONENTS)))
    for code in THERMAL:
        values[:, INDEX[code]] = rng.normal(0.0, 15.0 if BY_CODE[code].unit == "um" else 30.0, n)
    return values


#: between table and tool, between table and spindle housing, and between bed and table
ENOUGH = nest() + nest("workpiece", "Y") + nest("X", "bed")


def identified(readings: list[Displacement], rng: np.random.Generator) -> tuple[np.ndarray, IdentifiedComponents]:
    values = planted(50, rng)
    noise = rng.normal(0.0, 0.5, (50, len(readings)))
    return values, identify_components(MILL, readings, measured(readings, values) + noise, uncertainty=0.5)


def test_the_six_shifts_come_back_within_two_um() -> None:
    """C-01: from nests at three places, each between three pairs of bodies, with 0.5 um of noise."""
    values, found = identified(ENOUGH, np.random.default_rng(1))
    assert len(ORIGINS) == 6
    wrong = {code: found[code] - values[:, INDEX[code]] for code in THERMAL}
    assert max(float(np.abs(wrong[code]).max()) for code in (*ORIGINS, "X0C", "Y0C", "Z0C")) < 2.0
    # the standard errors tell how far off they are
    for code, e in zip(found.codes, found.standard_errors.tolist(), strict=True):
        assert 0.7 < float(np.sqrt(np.mean(wrong[code] ** 2))) / e < 1.4
    assert 0.3 < float(np.sqrt(np.mean(found.residual**2))) < 0.6


def test_at_the_tool_alone_shifts_and_drifts_are_one() -> None:
    """C-01: however many positions of a nest between table and tool."""
    readings = nest(places=tuple((float(x), 250.0, float(z)) for x in range(0, 601, 100) for z in range(0, 601, 100)))
    with pytest.raises(FitError) as refused:
        identify_components(MILL, readings, np.zeros(len(readings)))
    for axis in "XYZ":
        assert f"{axis}0C, {axis}OX and {axis}OY cannot be separated" in str(refused.value)
    assert "measure also between X and bed, between Z and Y" in str(refused.value)
    assert "A0C" not in str(refused.value)


def test_the_housing_separates_the_spindle_from_the_references() -> None:
    """C-01: then the two references are left, which need a reading between bed and table."""
    readings = nest() + nest("workpiece", "Y")
    with pytest.raises(FitError) as refused:
        identify_components(MILL, readings, np.zeros(len(readings)))
    for axis in "XYZ":
        assert f"{axis}OX and {axis}OY cannot be separated: measure also between X and bed" in str(refused.value)
    assert "0C" not in str(refused.value)


def test_a_tilt_needs_a_second_tool_length() -> None:
    bar = [replace(r, tool=BAR) for r in ENOUGH]
    with pytest.raises(FitError, match=r"hardly depend on A0C: measure also between Y and tool, with tools of diff"):
        identify_components(MILL, bar, np.zeros(len(bar)))
    longer = [replace(r, tool=(0.0, 0.0, -300.0)) for r in ENOUGH]
    with pytest.raises(FitError, match=r"Y0C and A0C cannot be separated: measure also with tools of diff"):
        identify_components(MILL, longer, np.zeros(len(longer)))


@pytest.mark.parametrize(
    ("code", "names", "advice"),
    [
        ("w Y' X' b Z (C1) t", "X0C, XOX and XOY", "between Y and X, between X and bed"),
        ("XFZ", "X0C and XOX", "X and bed"),
    ],
)
def test_other_structures(code: str, names: str, advice: str) -> None:
    """C-01: a cross table, and a machine without Y; the default components are those that exist."""
    structure = Structure.parse(code)
    machine = replace(MILL, structure=structure, axes=tuple(a for a in AXES if a.name in structure.axes))
    with pytest.raises(FitError, match=f"{names} cannot be separated: measure also (between )?{advice}"):
        identify_components(machine, nest(), np.zeros(15))
    found = identify_components(machine, [Displacement("X", TEST, between=("X", "bed"))], [7.0], codes=["XOX"])
    assert found["XOX"] == pytest.approx(7.0)


def test_known_components_are_taken_off() -> None:
    """An angle of X, known from a laser, moves the tip by its lever; a squareness is identified as well."""
    values = planted(3, np.random.default_rng(2))
    values[:, INDEX["ECX"]], values[:, INDEX["C0Y"]] = 80.0, 25.0
    readings, codes = ENOUGH, (*THERMAL, "C0Y")
    taken = measured(readings, values)
    known = np.repeat(values[:, None], len(readings), axis=1)
    found = identify_components(MILL, readings, taken, codes=codes, known=known)
    for code in codes:
        assert found[code] == pytest.approx(values[:, INDEX[code]], abs=0.1)
    assert np.abs(identify_components(MILL, readings, taken, codes=codes).residual).max() > 2.0


def test_what_cannot_be_meant_is_refused() -> None:
    for readings, codes, match in (
        (nest("tool", "workpiece"), THERMAL, "must be nearer to the workpiece"),
        (nest("workpiece", "B"), THERMAL, "there is no body 'B'; there are workpiece, bed, tool, X, Z, Y"),
        ([Displacement("W", TEST)], THERMAL, "along 'W'"),
        (nest(), ("EXX",), "'EXX' is not one of the scalar components"),
    ):
        with pytest.raises(InputError, match=match):
            identify_components(MILL, readings, np.zeros(len(readings)), codes=codes)
    with pytest.raises(InputError, match="expected 15 finite displacements"):
        identify_components(MILL, nest(), np.full(15, np.nan))


def test_it_is_least_squares() -> None:
    """C-01: with plain numpy; a reading has 0.5 um unless stated."""
    readings = [*ENOUGH, *nest("bed", "tool")]
    values = np.random.default_rng(3).normal(size=(4, len(readings)))
    found = identify_components(MILL, readings, values)
    design = effects_of_components(MILL, readings)[:, [INDEX[code] for code in found.codes]]
    weights = np.linalg.lstsq(design, values.T)[0].T
    np.testing.assert_allclose(found.values, weights, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(found.residual, values - weights @ design.T, atol=1e-9)
    np.testing.assert_allclose(found.standard_errors, 0.5 * np.sqrt(np.diag(np.linalg.inv(design.T @ design))))
    # the effects are those of exact transforms; X is behind the bed, so it has none on the last ones
    each = np.eye(len(COMPONENTS))
    np.testing.assert_allclose(effects_of_components(MILL, ENOUGH), measured(ENOUGH, each).T, atol=1e-3)
    seen = [c.code for c, e in zip(COMPONENTS, design.T[: len(found.codes)], strict=False) if e[len(ENOUGH) :].any()]
    assert len(seen) > 0
    assert not effects_of_components(MILL, nest("bed", "tool"))[:, INDEX["XOX"]].any()


def test_known_components_at_their_own_places() -> None:
    values = planted(1, np.random.default_rng(2))[0]
    known = np.zeros((len(ENOUGH), len(values)))
    known[:, INDEX["EXX"]] = np.linspace(-30, 40, len(ENOUGH))
    each = values + known
    readings = np.array([measured([r], v[None])[0, 0] for r, v in zip(ENOUGH, each, strict=True)])
    found = identify_components(MILL, ENOUGH, readings, known=known)
    for code in THERMAL:
        assert found[code] == pytest.approx(values[INDEX[code]], abs=0.1)
