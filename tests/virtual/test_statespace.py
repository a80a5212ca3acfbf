"""A reduced model steps exactly, whatever the step."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from thermocomp.core.exceptions import InputError
from thermocomp.virtual.statespace import ReducedModel

FloatArray = NDArray[np.float64]


def made(seed: int = 0, *, insulated: bool = False) -> ReducedModel:
    """Return a model of six states whose time constants reach from a minute to a day."""
    rng = np.random.default_rng(seed)
    modes, _ = np.linalg.qr(rng.standard_normal((6, 6)))
    rates = np.array([0.0 if insulated else 1e-5, 3e-5, 1e-4, 5e-4, 2e-3, 2e-2])
    extra = rng.standard_normal((2, 6, 1))
    return ReducedModel(
        conduction=(modes * rates) @ modes.T,
        conduction_theta=1e-4 * extra @ extra.transpose(0, 2, 1),
        heat=1e-2 * rng.standard_normal((6, 3)),
        air=1e-4 * rng.standard_normal((6, 3)),
        air_theta=1e-4 * rng.standard_normal((2, 6, 3)),
        temperature=rng.standard_normal((4, 6)),
        observable=rng.standard_normal((2, 6)),
        one=np.ones(6),
        theta=("rotation", "flow"),
        inputs=("front", "rear", "motor"),
        places=("a", "b", "c", "d"),
        observables=("x", "z"),
    )


HEAT, AIR, THETA = np.array([200.0, -50.0, 10.0]), np.array([21.0, 0.5, -0.2]), (0.5, 1.0)


def test_a_step_follows_the_differential_equation() -> None:
    model, start = made(), np.linspace(-1.0, 2.0, 6)
    after = {}
    for dt in (60.0, 3600.0):
        step = model.operators(THETA, dt, ("c", "a"))
        whole = step.state @ start + step.heat @ HEAT + step.air @ AIR
        load = model.heat @ HEAT + model.to_air(THETA) @ AIR
        matrix = model.stiffness(THETA)
        exact = solve_ivp(lambda _, z: load - matrix @ z, (0.0, dt), start, rtol=1e-10, atol=1e-12, method="LSODA")  # noqa: B023
        np.testing.assert_allclose(whole[:6], exact.y[:, -1], rtol=1e-7, atol=1e-8)
        np.testing.assert_allclose(whole[6:], model.rows(("c", "a")) @ whole[:6], rtol=1e-12)
        after[dt] = whole[:6]
    parts, short = start, model.operators(THETA, 60.0)
    for _ in range(60):
        parts = short.state @ parts + short.heat @ HEAT + short.air @ AIR
    np.testing.assert_allclose(parts, after[3600.0], rtol=1e-10)


def test_steady_state_stays() -> None:
    model = made()
    rest = model.steady(HEAT, AIR, THETA)
    step = model.operators(THETA, 1e4)
    np.testing.assert_allclose(step.state @ rest + step.heat @ HEAT + step.air @ AIR, rest, rtol=1e-9)


def test_without_any_loss_heat_is_stored() -> None:
    model = made(insulated=True)
    model = ReducedModel(**{f: getattr(model, f) for f in FIELDS} | {"conduction_theta": np.zeros((2, 6, 6))})
    step = model.operators((0.0, 0.0), 1e5)
    slowest = np.linalg.eigh(model.conduction)[1][:, 0]
    assert slowest @ step.heat @ HEAT == pytest.approx(1e5 * slowest @ model.heat @ HEAT, rel=1e-6)


FIELDS = (
    "conduction",
    "conduction_theta",
    "heat",
    "air",
    "air_theta",
    "temperature",
    "observable",
    "one",
    "theta",
    "inputs",
    "places",
    "observables",
)


def test_time_constants() -> None:
    np.testing.assert_allclose(made().time_constants((0.0, 0.0))[[0, -1]], [1e5, 50.0], rtol=1e-6)


def test_a_file_brings_back_the_same_numbers(tmp_path: Path) -> None:
    model, path = made(), tmp_path / "m.npz"
    arrays: dict[str, Any] = {f: np.asarray(getattr(model, f)) for f in FIELDS}
    np.savez(path, **arrays)
    again = ReducedModel.read(path)
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(again, name), getattr(model, name))
    assert again.places == model.places


def test_an_unknown_place_is_named() -> None:
    with pytest.raises(InputError, match="no place 'z' among a, b, c, d"):
        made().operators(THETA, 1.0, ("z",))


def test_regimes_are_kept_but_not_without_end() -> None:
    model = made()
    first = model.operators((0.0, 0.0), 1.0)
    assert model.operators((0.0, 0.0), 1.0) is first
    for k in range(300):
        model.operators((k / 300.0, 0.0), 1.0)
    assert len(model._kept) <= model._KEEP
