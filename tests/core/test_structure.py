"""Structure codes: both notations, and what is refused."""

from itertools import permutations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from thermocomp.core.exceptions import SettingError
from thermocomp.core.structure import Structure


@pytest.mark.parametrize(
    ("code", "workpiece", "tool"),
    [
        ("w X' b Z Y (C1) t", "X", "ZY"),
        ("w X' b Y Z (C1) t", "X", "YZ"),
        ("w X' Y' b Z t", "XY", "Z"),
        ("w X1' Y1' b Z1 (C1) t", "XY", "Z"),
        ("  w Z' Y' X' b (C) t ", "ZYX", ""),
        ("w b X Y Z C1 t", "", "XYZ"),
        ("w X’ b Z Y (C1) t", "X", "ZY"),  # a typographic apostrophe
        ("w X′ b Z t", "X", "Z"),  # a prime
        ("XFZY", "X", "ZY"),
        ("FXYZ", "", "XYZ"),
        ("XYZ", "", "XYZ"),
        ("XYZF", "XYZ", ""),
        ("XY FZ", "XY", "Z"),
        ("ZF", "Z", ""),
        ("wX'bZYt", "X", "ZY"),
        ("wX'bZY(C1)t", "X", "ZY"),
        ("w x' y' b z (c1) t", "XY", "Z"),
        ("wbxyzt", "", "XYZ"),
        ("W X' B Z T", "X", "Z"),
        ("xfzy", "X", "ZY"),
    ],
)
def test_codes(code: str, workpiece: str, tool: str) -> None:
    found = Structure.parse(code)
    assert found.workpiece == tuple(workpiece)
    assert found.tool == tuple(tool)
    assert found.axes == tuple(workpiece + tool)


@given(st.sampled_from(list(permutations("XYZ"))), st.integers(1, 3), st.integers(0, 3))
def test_a_written_code_is_read_as_it_was(axes: tuple[str, ...], count: int, split: int) -> None:
    structure = Structure(axes[:count][:split], axes[:count][split:])
    assert Structure.parse(structure.code) == structure
    assert Structure.parse("".join(structure.workpiece) + "F" + "".join(structure.tool)) == structure


@pytest.mark.parametrize(
    ("code", "linear", "rotary", "written"),
    [
        ("w C' A' X' b Y Z (C1) t", "XYZ", {"C": "table", "A": "table"}, "w C' A' X' b Y Z (C1) t"),
        ("w X' A' b Y Z C1 t", "XYZ", {"A": "table"}, "w A' X' b Y Z (C1) t"),
        ("w X' b B Z Y t", "XZY", {"B": "head"}, "w X' b Z Y B (C1) t"),
        ("w X' b Z Y C B (C1) t", "XZY", {"C": "head", "B": "head"}, "w X' b Z Y C B (C1) t"),
        ("w C1' X' b Z Y B1 t", "XZY", {"C": "table", "B": "head"}, "w C' X' b Z Y B (C1) t"),
        ("CAXFYZ", "XYZ", {"C": "table", "A": "table"}, "w C' A' X' b Y Z (C1) t"),
        ("XFZYB", "XZY", {"B": "head"}, "w X' b Z Y B (C1) t"),
    ],
)
def test_rotary_axes_are_in_the_table_or_in_the_head(
    code: str, linear: str, rotary: dict[str, str], written: str
) -> None:
    found = Structure.parse(code)
    assert found.axes == tuple(linear)
    assert found.rotary == rotary
    assert found.code == written
    assert Structure.parse(written) == found
    assert hash(found) == hash(Structure.parse(written))


def test_beyond_an_axis_is_what_moves_the_tool_against_it() -> None:
    """On a table-moving machine too: seen from the X slide of the table, Y and Z move the tool."""
    structure = Structure.parse("w X' Y' b Z (C1) t")
    assert structure.beyond("X") == ("Y", "Z")
    assert structure.beyond("Y") == ("Z",)
    assert structure.beyond("Z") == ()


@pytest.mark.parametrize(
    ("code", "message"),
    [
        ("", "is not a structure code"),
        ("mill", "is not a structure code"),
        ("XFZF", "is not a structure code"),
        ("w X' Z t", "is not a structure code"),
        ("w X' b Z", "is not a structure code"),
        ("F", "has no axis"),
        ("w b t", "has no axis"),
        ("XFXY", "axis X occurs twice"),
        ("w X' b X t", "axis X occurs twice"),
        ("w X b Z t", "'X' .* is on the workpiece's side and needs a prime: X'"),
        ("w X' b Z' Y t", "\"Z'\" .* is on the tool's side and must have no prime: Z"),
        ("w U' b Y Z t", "axis U: only the linear axes X, Y and Z and the rotary axes A, B and C"),
        ("w C' b B t", "has no axis"),
        ("w C' C' X' b Z t", "axis C occurs twice"),
        ("w B' X' b B Z t", "axis B occurs twice"),
        ("w C X' b Z t", "'C' .* is on the workpiece's side and needs a prime: C'"),
        ("w X' b A' Z t", "\"A'\" .* is on the tool's side and must have no prime: A"),
        ("w x b Z t", "'X' .* is on the workpiece's side and needs a prime: X'"),
        ("w X' b (C1) Z t", "is not an axis: expected X, Y, Z, A, B or C"),
        ("w X'- b Z t", "is not an axis: expected X, Y, Z, A, B or C"),
        ("w (C1) b Z X t", r"\(C1\) .*: a spindle on the workpiece's side is not supported"),
        ("w (C) Z' X' b t", r"\(C\) .*: a spindle on the workpiece's side is not supported"),
        ("w(c')z'bxt", "a spindle on the workpiece's side is not supported"),
    ],
)
def test_codes_that_are_none(code: str, message: str) -> None:
    with pytest.raises(SettingError, match=message):
        Structure.parse(code)
