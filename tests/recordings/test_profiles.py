"""Profiles: what is refused, the thermal part, slopes and their standard errors."""

from dataclasses import replace

import numpy as np
import pytest
from profilemachine import along_y, profiles

from thermocomp.core.exceptions import InputError, RecordingError
from thermocomp.recordings.profiles import Profiles


def at(positions: list[float], values: np.ndarray | None = None) -> Profiles:
    made = profiles()
    points = along_y(np.array(positions))
    return replace(made, points=points, values=np.zeros((len(made), len(points))) if values is None else values)


@pytest.mark.parametrize(
    ("positions", "message"),
    [
        ([0.0, 100.0], r"made: profiles of EYY: 2 positions along Y \(0, 100 mm\); a profile needs at least 3"),
        ([0.0, 100.0, 50.0], "positions along Y must increase, but 50 mm follows 100 mm: sort them"),
        ([0.0, 50.0, 50.0, 100.0], "two values of a state at X 0, Y 50, Z 0 mm: take their mean, or read the two dir"),
        ([0.0, np.nan, 100.0], "point 2 at .* must be finite"),
    ],
)
def test_positions_that_are_no_profile(positions: list[float], message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        at(positions)


def test_lines_beside_each_other_rise_one_by_one() -> None:
    points = np.array([[x, y, 0.0] for x in (0.0, 300.0) for y in (0.0, 100.0, 200.0)])
    made = replace(profiles(), points=points, values=np.zeros((len(profiles()), 6)))
    assert made.varying == "YX"
    with pytest.raises(RecordingError, match="100 mm follows 200 mm"):
        replace(made, points=points[[0, 2, 1, 3, 4, 5]])


def test_shapes_numbers_units_and_components() -> None:
    made = profiles()
    with pytest.raises(RecordingError, match=r"values of shape \(72, 11\): expected \(72, 12\)"):
        replace(made, values=made.values[:, 1:])
    with pytest.raises(RecordingError, match="points of shape"):
        replace(made, points=made.points[:, :2])
    infinite = made.values.copy()
    infinite[3, 2] = np.inf
    with pytest.raises(RecordingError, match="infinite in state 4 at X 0, Y 100, Z 0 mm"):
        replace(made, values=infinite)
    with pytest.raises(InputError, match="positioning of X is one along X; the given profiles are along Y"):
        replace(made, target="EXX")
    with pytest.raises(InputError, match="tilt about X of Y is in urad; the given profiles are in um"):
        replace(made, target="EAY")
    with pytest.raises(InputError, match="spindle drift in X has no profile"):
        replace(made, target="X0C")
    with pytest.raises(InputError, match="unit 'mm'"):
        replace(made, unit="mm")  # type: ignore[arg-type]
    with pytest.raises(InputError, match="axis 'A'"):
        replace(made, axis="A")
    assert replace(made, target="my laser").target == "my laser"


def test_the_thermal_part_is_what_is_beyond_the_cold_profile() -> None:
    made = profiles(noise=0.0)
    q, change = 1e-3 * made.position, made.states.table - made.states.table.iloc[0]
    slope = (3 * change["t1_C"] + 2 * change["t2_C"]).to_numpy()
    np.testing.assert_allclose(made.thermal(), np.outer(slope, q), atol=1e-12)
    np.testing.assert_allclose(made.cold([0, 1]), made.values[:2].mean(axis=0))
    np.testing.assert_allclose(made.thermal(-1)[0], -slope[-1] * q, atol=1e-12)
    np.testing.assert_allclose(made.slopes().factors[:, 0], slope, atol=1e-9)
    with pytest.raises(InputError, match=r"reference state .99.: expected numbers from 0 to 71"):
        made.thermal(99)
    with pytest.raises(InputError, match="reference state missing"):
        made.thermal([])


@pytest.mark.parametrize("offset", [False, True])
@pytest.mark.parametrize("order", [1, 2])
def test_factors_of_every_power(order: int, offset: bool) -> None:
    made = profiles(noise=0.0, second=40.0 if order == 2 else 0.0, offset=0.7 if offset else 0.0)
    t1, t2 = (made.states.table - made.states.table.iloc[0]).to_numpy().T
    found = made.slopes(order, offset=offset, reference_position=0.0)
    wanted = {0: 0.7 * t1, 1: 3 * t1 + 2 * t2, 2: 40.0 * t1}
    assert found.powers == tuple(range(0 if offset else 1, order + 1))
    for j, power in enumerate(found.powers):
        np.testing.assert_allclose(found.factors[:, j], wanted[power], atol=1e-8)
    assert found.remainder < 1e-9


def test_the_reference_position_is_where_the_line_turns() -> None:
    made = profiles(noise=0.0)
    turned = replace(made, values=made.values - 1e-3 * 250.0 * made.slopes().factors)
    found = turned.slopes(reference_position=250.0)
    np.testing.assert_allclose(found.factors, made.slopes().factors, atol=1e-9)


def test_missed_points_are_passed_over() -> None:
    made = profiles(noise=0.0)
    values = made.values.copy()
    values[5, [0, 3, 7]] = np.nan
    values[6, 1:] = np.nan  # a single point left, at position 0
    holed = replace(made, values=values)
    slope = made.slopes().factors[:, 0]
    found = holed.slopes()
    np.testing.assert_allclose(np.delete(found.factors[:, 0], 6), np.delete(slope, 6), atol=1e-9)
    assert np.isnan(found.factors[6, 0])
    cold = made.values.copy()
    cold[0, 4] = np.nan
    assert np.isnan(replace(made, values=cold).thermal()[:, 4]).all()
    np.testing.assert_allclose(replace(made, values=cold).slopes().factors[:, 0], slope, atol=1e-9)
    np.testing.assert_allclose(replace(made, values=cold).cold([0, 1])[4], made.values[1, 4])


def test_too_many_powers_for_the_positions() -> None:
    made = at([0.0, 100.0, 200.0])
    with pytest.raises(InputError, match="2 coefficients cannot be fitted to 2 positions"):
        made.slopes(2)
    with pytest.raises(InputError, match="0 coefficients"):
        made.slopes(0)


def test_standard_errors_are_those_of_many_draws() -> None:
    """Error over standard error is about 1 RMS; the cold profile's noise is in all slopes of a test (`shared`)."""
    scores, shifts, told = [], [], []
    for draw in range(200):
        made = profiles(noise=0.3, seed=draw, n_cycles=1)
        t1, t2 = (made.states.table - made.states.table.iloc[0]).to_numpy().T
        found = made.slopes()
        error = found.factors[1:, 0] - (3 * t1 + 2 * t2)[1:]
        scores.append(error / found.errors[1:, 0])
        shifts.append(error.mean())
        told.append(found.shared * np.mean(found.errors[1:, 0] ** 2))
    assert found.shared == 0.5
    assert np.sqrt(np.mean(np.square(scores))) == pytest.approx(1.0, abs=0.15)
    assert np.std(shifts) == pytest.approx(np.sqrt(np.mean(told)), rel=0.2)
    assert profiles(noise=0.3).slopes().remainder == pytest.approx(0.3 * np.sqrt(2), rel=0.2)


def test_the_fingerprint_knows_points_values_and_states() -> None:
    made = profiles()
    again = profiles()
    assert made.fingerprint == again.fingerprint
    others = [
        replace(made, points=made.points + 1.0),
        replace(made, values=made.values + 1.0),
        replace(made, states=replace(made.states, time=2 * made.states.time)),
    ]
    assert len({made.fingerprint, *(p.fingerprint for p in others)}) == 4
