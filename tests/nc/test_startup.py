"""Codes in force when a program starts."""

import pytest

from thermocomp.core.exceptions import InputError
from thermocomp.nc.interpreter.block import Modal, Setup
from thermocomp.nc.interpreter.interpret import follow_program
from thermocomp.nc.interpreter.startup import complete_codes, modal, tidy
from thermocomp.nc.linuxcnc.verification.states import build_stored
from thermocomp.nc.parser.line import Controller
from thermocomp.nc.parser.tokens import read_lines
from thermocomp.nc.planner.timeline import MotionLimits, time_blocks


@pytest.mark.parametrize(
    ("text", "tidied"),
    [
        ("G64 P0.01 G98", "G64 P0.01 G98"),
        ("g99g61.1", "G61.1 G99"),
        (" g 64 q 0. 02 p.1 ", "G64 P.1 Q0.02"),
        ("G98", "G98"),
    ],
)
def test_codes_are_tidied(text: str, tidied: str) -> None:
    assert tidy(text, "linuxcnc") == tidied


@pytest.mark.parametrize(
    ("text", "controller", "message"),
    [
        ("", "linuxcnc", "startup codes may only be G61, G61.1 or G64, and G98 or G99"),
        ("G7", "linuxcnc", "startup codes may only be G61, G61.1 or G64, and G98 or G99"),
        ("G98 M3", "linuxcnc", "put all other codes in the program"),
        ("G98 G99", "linuxcnc", "G98 and G99 exclude each other"),
        ("G64 G61", "linuxcnc", "G64 and G61 exclude each other"),
        ("G98 P1", "linuxcnc", "tolerances of LinuxCNC's G64"),
        ("G61 P1", "linuxcnc", "tolerances of LinuxCNC's G64"),
        ("G64 Q1", "linuxcnc", "P alone or P and Q"),
        ("G64 P-1", "linuxcnc", "not negative"),
        ("G64 P1", "fanuc", "tolerances of LinuxCNC's G64"),
        ("G64 P[1]", "linuxcnc", "expected codes and plain numbers only"),
        ("N1 G64", "linuxcnc", "expected codes and plain numbers only"),
        ("G64 (why)", "linuxcnc", "expected codes and plain numbers only"),
        ("G64 Px", "linuxcnc", "column 6"),
    ],
)
def test_other_codes_are_refused(text: str, controller: Controller, message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        tidy(text, controller)
    assert repr(text) in str(caught.value)


@pytest.mark.parametrize(
    ("startup", "expected"),
    [
        ("", Modal(retract=99)),
        ("G98", Modal(retract=98, retract_stated=True)),
        ("G64 P0.1 Q0.02 G99", Modal(retract=99, retract_stated=True, blend=0.1, naive=0.02)),
        ("G64 P0.1", Modal(retract=99, blend=0.1, naive=0.1)),
        ("G61", Modal(retract=99, blend=None)),
        ("G61.1", Modal(retract=99, blend=None, exact_stop=True)),
    ],
)
def test_the_follower_starts_as_if_the_program_had_said_it(startup: str, expected: Modal) -> None:
    setup = Setup(inch=False, startup=startup)
    (block,) = follow_program(read_lines(["(nothing)\n"]), setup)
    assert block.modal == modal(setup) == expected
    if startup:
        (block,) = follow_program(read_lines([f"{startup}\n"]), Setup(inch=False))
        assert block.modal == expected


def test_startup_codes_are_in_mm_also_where_the_program_is_in_inches() -> None:
    (block,) = follow_program(read_lines(["(nothing)\n"]), Setup(inch=True, startup="G64 P0.1"))
    assert (block.modal.inch, block.modal.blend) == (True, 0.1)
    lines = ["G20 G64 P0.01 Q0.005\n", "G21 G64 P0.01\n"]
    inch, mm = (b.modal for b in follow_program(read_lines(lines), Setup()))
    assert (inch.blend, inch.naive) == pytest.approx((0.254, 0.127))
    assert (mm.blend, mm.naive) == (0.01, 0.01)


@pytest.mark.parametrize("startup", ["G61", "G61.1", "G64", "G64 P0.05", "G64 P0.001 Q0"])
def test_the_program_takes_as_long_as_if_it_had_said_it(startup: str) -> None:
    zigzag = [f"X{0.1 * k:.3f} Y{0.02 * (k % 2):.3f}\n" for k in range(100)]
    program = ["G21\n", "F3000 S1000 M3\n", "G1 X0 Y0\n", *zigzag, "M2\n"]

    def seconds(lines: list[str], setup: Setup) -> float:
        *_, last = time_blocks(follow_program(read_lines(lines), setup), MotionLimits())
        return last.end

    found = seconds(program, Setup(startup=startup))
    assert found == pytest.approx(seconds([f"G21 {startup}\n", *program], Setup()), rel=1e-12)
    assert (found != seconds(program, Setup())) == (startup != "G64")


def test_the_interpreter_starts_as_the_follower() -> None:
    assert build_stored(Setup()).startup == "G64 G99"
    assert build_stored(Setup(startup="G64 P0.01 G98")).startup == "G64 P0.01 G98"
    assert complete_codes(Setup(startup="G61")) == "G61 G99"
    assert complete_codes(Setup(startup="G98")) == "G64 G98"
    assert complete_codes(Setup(controller="fanuc")) == "G64 G98"
