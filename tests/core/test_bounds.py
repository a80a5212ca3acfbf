"""Numbers that lose digits keep to their bounds."""

import ast
import importlib
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import thermocomp.core
from thermocomp.core import bounds
from thermocomp.core.bounds import round_single, round_within

FINITE = st.floats(allow_nan=False, allow_infinity=False)
SINGLE = st.floats(allow_nan=False, allow_infinity=False, width=32)
#: what is checked in the classes of the core, least and most, as numbers
CHECKED = {"check_between": (1, 3), "check_finite": (1, 2)}


def bounds_in_source() -> list[tuple[str, float]]:
    """Return the bounds of all checks: where each is, and the number."""
    found = []
    for path in sorted(Path(thermocomp.core.__path__[0]).glob("*.py")):
        module = importlib.import_module(f"thermocomp.core.{path.stem}")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in CHECKED:
                first, end = CHECKED[node.func.id]
                for part in node.args[first:end]:
                    text = ast.unparse(part)
                    if "self" not in text and not (path.stem == "bounds" and text in ("least", "most")):
                        found.append((f"{path.name}: {text}", float(eval(text, vars(module)))))
    return found


@pytest.mark.parametrize(("where", "bound"), bounds_in_source())
def test_no_bound_of_a_check_is_crossed(where: str, bound: float) -> None:
    least = bound in (bounds.LEAST, bounds.LEAST**2, bounds.TICK)
    most = bound in (bounds.COEFFICIENT, bounds.READING, bounds.MEMORY, 1.0 - bounds.LEAST)
    exact = float(np.float32(bound)) == bound
    assert least or most or exact, f"{where}: round_single does not know this bound"
    found = float(round_single(bound))
    assert found == bound if exact else found > bound if least else found < bound
    for near in (float(np.nextafter(bound, -np.inf)), float(np.nextafter(bound, np.inf))):
        moved = float(round_single(near))
        if least and near >= bound:
            assert moved >= bound
        if most and near <= bound:
            assert moved <= bound
        assert -float(round_single(-near)) == moved


def test_there_are_bounds_to_check() -> None:
    assert len(bounds_in_source()) > 30


@given(FINITE, SINGLE, SINGLE)
def test_rounded_within_bounds_as_near_as_can_be(value: float, one: float, other: float) -> None:
    least, most = min(one, other), max(one, other)
    found = float(round_within(value, least, most))
    assert least <= found <= most
    assert float(np.float32(found)) == found
    check_nearest(min(max(value, least), most), found, least, most)


@given(FINITE, FINITE, FINITE)
def test_the_same_of_bounds_that_single_precision_does_not_hold(value: float, one: float, other: float) -> None:
    least, most = min(one, other), max(one, other)
    with np.errstate(over="ignore"):
        inner = np.float32(least)
        inner = np.nextafter(inner, np.float32(np.inf)) if float(inner) < least else inner
    assume(least <= float(inner) <= most)  # one is between them
    found = float(round_within(value, least, most))
    assert least <= found <= most
    check_nearest(min(max(value, least), most), found, least, most)


def check_nearest(value: float, found: float, least: float, most: float) -> None:
    """Check that no neighbour within the bounds is nearer to a value."""
    with np.errstate(over="ignore", under="ignore"):
        for end in (-np.inf, np.inf):
            other = float(np.nextafter(np.float32(found), np.float32(end)))
            if least <= other <= most and np.isfinite(other):
                assert abs(other - value) >= abs(found - value)


@given(st.floats())
def test_what_is_something_stays_it(value: float) -> None:
    found = float(round_single(value))
    assert np.isnan(found) == np.isnan(value)
    if not np.isnan(value):
        assert np.isinf(found) == np.isinf(value)
        assert (found == 0) == (value == 0)
        assert np.sign(found) == np.sign(value)
    if 1e-37 < abs(value) < 3e38:
        assert abs(found - value) <= 2.0**-23 * abs(value)


@given(
    st.lists(st.floats(-1e15, 1e15), min_size=2, max_size=30, unique=True),
    st.integers(0, 2**20),
    st.sampled_from([0.0, 1e-6, 1.0, -1e15]),
)
def test_a_row_that_rises_strictly_does_so_afterwards(values: list[float], steps: int, base: float) -> None:
    close = [base]
    for _ in range(steps % 40 + 1):  # neighbours of double precision
        close.append(float(np.nextafter(close[-1], np.inf)))
    for row in (sorted(values), close, sorted({-v for v in close})):
        found = round_single(row)
        assert all(a < b for a, b in pairwise(found))
        assert (np.abs(found) <= bounds.COEFFICIENT).all()
        assert (found == found.astype(np.float32)).all()
