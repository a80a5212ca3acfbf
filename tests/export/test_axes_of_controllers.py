"""What SINUMERIK and TwinCAT CNC take: offset, slope and place, run by the machine of structured text."""

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from compiledblock import check_block as check_c99
from driftmodels import ACCEPTED, growing
from stmachine import Machine, check_block

from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError
from thermocomp.core.inputs import Input
from thermocomp.core.model import ErrorModel
from thermocomp.core.polynomial import Polynomial
from thermocomp.core.position import PositionModel
from thermocomp.core.reading import Reading
from thermocomp.core.terms import Variable
from thermocomp.core.zero import Zeroing
from thermocomp.export.axes import find_drives, write_values
from thermocomp.export.beckhoff import package as beckhoff
from thermocomp.export.c99 import package as cpackage
from thermocomp.export.facts import Facts
from thermocomp.export.siemens import package as siemens
from thermocomp.export.st import package as stpackage
from thermocomp.export.st.structuredtext import translate
from thermocomp.export.vectors import Readings
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.program.tables import gather

FACTS = Facts("model.json", "0" * 64, "0", "2026-01-31")
FREE = Limits(magnitude=1e9, rate=1e9)


def model(unit: str, per_kelvin: float) -> ErrorModel:
    return Polynomial(
        target="EXX",
        unit=unit,
        inputs=(Input("screw_C", "temperature", "degC", 23.0, False, 0.0, 25.0),),
        variables=(Variable.single("screw_C", 0),),
        terms=((0,),),
        coefficients=(per_kelvin,),
        zeroing=Zeroing(0.0, 0.0),
        honest_error=ACCEPTED,
    )


def screw(slope: float, offset: float = 0.0) -> PositionModel:
    """A screw that grows [um/m per K], and its bearing that moves [um/K]."""
    return PositionModel(
        target="EXX",
        unit="um",
        axis="X",
        travel=(-200.0, 600.0),
        reference_position=100.0,
        offset=model("um", offset) if offset else None,
        slopes=(model("um/m", slope),),
    )


def taken(source: PositionModel, temperature: float, dialect: Any, what: Any, direction: float) -> Any:
    """Return what a controller is given at a temperature, the block and the one behind it being run."""
    compensator = Compensator.of([source], FREE)
    tables = gather(compensator)
    block = Machine(translate(tables, "tc_x", "codesys"))
    values = Machine([write_values("tc_x_nc", "codesys", find_drives(tables, {"EXX": "X"}), what, direction)])
    for _ in range(2):
        said = block.call(value=[temperature], good=[True], age=0.0, elapsed=1.0, cold=True)
    return values.call(correction=list(said.correction), slope=list(said.slope), direction=direction)


def test_the_vendors_worked_example() -> None:
    # T0 = 23, Tmax = 42 degC, 270 um/m: tan beta at 32.3 degC
    found = taken(screw(270.0 / (42.0 - 23.0)), 32.3, "scl", siemens.TAKEN, -1.0)
    assert f"{found.tan_beta[0]:.6f}" == "0.000132"
    assert found.k0[0] == 0.0
    assert found.p0[0] == 100.0


def test_the_correction_is_what_the_controller_makes_of_it() -> None:
    source = screw(12.0, offset=-3.0)
    for temperature in (21.0, 27.5):
        grown = temperature - 23.0
        nc = taken(source, temperature, "scl", siemens.TAKEN, -1.0)
        cnc = taken(source, temperature, "twincat", beckhoff.TAKEN, 1.0)
        for at in (-200.0, 100.0, 480.0):
            deviation = grown * (-3.0 + 12.0 * (at - 100.0) / 1000.0)
            dk = 1000.0 * (nc.k0[0] + nc.tan_beta[0] * (at - nc.p0[0]))
            assert dk == pytest.approx(deviation, abs=1e-9)
            ds = 0.1 * cnc.offset_value[0] + cnc.coefficient[0] * (at - 1e-4 * cnc.position_value[0]) / 1000.0
            assert ds == pytest.approx(-deviation, abs=0.051)  # a tenth of a micrometre


def test_slopes_run_in_c_and_in_structured_text() -> None:
    rng = np.random.default_rng(1)
    rows = 23.0 + np.cumsum(rng.normal(0.0, 0.4, 200))[:, None]
    limits = Limits(magnitude=30.0, rate=0.2, hold=60.0, fade=120.0)
    rows[50:70] = np.nan
    for source in (screw(12.0), screw(12.0, offset=-3.0)):
        compensator = Compensator.of([source], limits)
        said = check_c99(compensator, rows, np.full(200, 10.0))
        assert np.abs(said.slope).max() > 10.0
        assert set(said.status.ravel()) == {1, 2, 3}
        check_block(compensator, Readings(rows, np.zeros(200), np.full(200, 10.0)))


def three_axes() -> list[PositionModel]:
    """Screws of X, Y and Z, each with a bearing and an end of its own."""
    found = []
    for k, axis in enumerate("XYZ"):
        slopes = (replace(model("um/m", 12.0 + k), target=f"E{axis}{axis}"),)
        offset = replace(model("um", -3.0 * k), target=f"E{axis}{axis}") if k else None
        one = replace(screw(1.0), target=f"E{axis}{axis}", axis=axis, offset=offset, slopes=slopes)
        found.append(replace(one, travel=(-200.0, 600.0 + 100.0 * k), reference_position=100.0 * k))
    return found


def test_three_axes_are_one_block_and_the_page_tells_the_correction_at_a_position() -> None:
    """The formula of the page, with its numbers, is `Correction.at` along the travel."""
    compensator = Compensator.of(three_axes(), Limits(magnitude=30.0, rate=1e6))
    rows = np.concatenate([np.full((40, 1), 23.0), np.full((40, 1), 24.5), np.full((40, 1), 35.0)])
    said = check_c99(compensator, rows, np.full(len(rows), 10.0))
    check_block(compensator, Readings(rows, np.zeros(len(rows)), np.full(len(rows), 10.0)))
    page = cpackage.write_package(compensator, "mill", FACTS)["tc_mill.md"].decode()
    assert (
        "`correction[k] + slope[k] * (p - p0) / 1000`"
        in stpackage.write_package(compensator, "mill", FACTS)["tc_mill.md"].decode()
    )
    table = {
        t: (int(k), float(p)) for k, t, p in re.findall(r"\| `correction\[(\d)\]` \[um\] \| (\w+) \| (\S+) mm \|", page)
    }
    travels = {t: (float(a), float(b)) for t, a, b in re.findall(r"(E\w\w) (-?\d+) to (\d+) mm", page)}
    assert set(table) == set(travels) == {"EXX", "EYY", "EZZ"}
    state, now = compensator.start(), 0.0
    for row in rows:
        now += 10.0
        state, out = compensator.step(state, Reading(now, {"screw_C": float(row[0])}), now)
    for target, (k, p0) in table.items():
        for p in np.linspace(*travels[target], 5):
            value = said.correction[-1, k] + said.slope[-1, k] * (p - p0) / 1000.0
            assert value == pytest.approx(out.corrections[target].at(float(p)), abs=1e-9)
            assert abs(value) <= 30.0 + 1e-9
    assert max(abs(said.slope[-1])) > 20.0


@pytest.mark.parametrize("of", [siemens, beckhoff])
def test_the_files_say_what_goes_where_and_what_nobody_confirmed(of: Any) -> None:
    compensator = Compensator.of([screw(12.0, offset=-3.0)], Limits(magnitude=40.0, rate=0.5))
    files = of.write_package(compensator, "mill", FACTS, {"EXX": "X"})
    assert files == of.write_package(compensator, "mill", FACTS, {"EXX": "X"})
    page = files["tc_mill.md"].decode()
    assert page.startswith("EXX: accepted on unseen cycles")
    assert "UNCONFIRMED" in page
    assert "| 0 | X | EXX |" in page
    if of is siemens:
        assert "3 (bits 0, 1) | 0.0001 for tan beta" in page  # 80 um over 800 mm
        assert "0.5 um/s = 0.03 mm/min" in page
        assert b"tc_mill_sd" in files["tc_mill.scl"]
    else:
        assert "tc_mill_axis.TcPOU" in files


def test_axes_are_told_by_name_or_said() -> None:
    targets = ("z_um", "x1_um", "x2_um")
    tables = gather(Compensator.of([replace(growing(t, 2.0), honest_error=ACCEPTED) for t in targets], FREE))
    with pytest.raises(InputError, match="x1_um and x2_um are both X: state which one"):
        find_drives(tables, {})
    assert [d[:2] for d in find_drives(tables, {"x2_um": "Z", "z_um": "Y"})] == [("Y", 0), ("Z", 2)]
    with pytest.raises(InputError, match="--axes a: no such target"):
        find_drives(tables, {"a": "X"})
    nowhere = gather(Compensator.of([replace(growing("ch5_um", 2.0), honest_error=ACCEPTED)], FREE))
    with pytest.raises(InputError, match="the axis of ch5_um is not known"):
        find_drives(nowhere, {})


def test_a_position_that_is_no_whole_number_of_32_bits_is_refused() -> None:
    far = replace(screw(12.0), travel=(3e5, 4e5), reference_position=3e5)
    with pytest.raises(
        InputError,
        match=r"X: the reference position of its slope is 300000 mm, but P-AXIS-00272 .* is limited to 214748 mm",
    ):
        beckhoff.write_package(Compensator.of([far]), "mill", FACTS, {"EXX": "X"})
    assert siemens.write_package(Compensator.of([far]), "mill", FACTS, {"EXX": "X"})
