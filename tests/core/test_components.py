"""The 32 error components (C-01, C-02)."""

from collections import Counter

from thermocomp.core.components import BY_CODE, COMPONENTS


def test_counts_of_chen() -> None:
    groups = Counter(c.group for c in COMPONENTS)
    assert groups == {"axis": 18, "squareness": 3, "spindle": 5, "origin": 6}
    assert len(COMPONENTS) == len(BY_CODE) == 32
    assert sum(c.is_scalar for c in COMPONENTS) == 14
    assert sum(not c.is_scalar for c in COMPONENTS) == 18


def test_units_follow_the_kind_of_motion() -> None:
    for c in COMPONENTS:
        rotation = c.code[0] in "ABC" or c.code[1] in "ABC"
        if c.group == "spindle":
            rotation = c.code[0] in "AB"
        assert c.unit == ("urad" if rotation else "um"), c.code


def test_axis_components_depend_on_their_axis() -> None:
    assert BY_CODE["EXX"].depends_on == "X"
    assert BY_CODE["EAY"].depends_on == "Y"
    assert BY_CODE["EYY"].description == "positioning of Y"
    assert BY_CODE["ECZ"].description == "roll of Z"


def test_codes_and_axes_written_out() -> None:
    """C-01, C-02: three translations and three rotations per axis, three squarenesses, drifts, tilts, shifts."""
    axes = [f"E{motion}{axis}" for axis in "XYZ" for motion in "XYZABC"]
    scalars = ["C0Y", "B0Z", "A0Z", "X0C", "Y0C", "Z0C", "A0C", "B0C", "XOX", "YOX", "ZOX", "XOY", "YOY", "ZOY"]
    assert [c.code for c in COMPONENTS] == [*axes, *scalars]
    pairs = [("Y", "X"), ("Z", "X"), ("Z", "Y")]
    assert [c.axes for c in COMPONENTS[18:]] == [*pairs, *[()] * 5, *[("X",)] * 3, *[("Y",)] * 3]
