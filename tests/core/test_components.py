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
