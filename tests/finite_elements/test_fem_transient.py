"""Temperatures over time against series: cooling bar, cooling hollow cylinder; energy, order, damping of the method."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import quad
from scipy.linalg import expm
from scipy.optimize import brentq
from scipy.sparse import csr_matrix
from scipy.special import j0, j1, y0, y1
from skfem import MeshLine, MeshQuad

from finite_elements.conduction import capacity, conduction, edge
from finite_elements.space import Space
from finite_elements.transient import Stepper

FloatArray = NDArray[np.float64]

K, RHO_C = 45.0, 3.7e6
ALPHA = K / RHO_C


def outer(x: FloatArray) -> NDArray[np.bool_]:
    return np.asarray(x[0] > x[0].max() - 1e-9)


def cool(space: Space, film: float, dt: float, steps: int) -> list[FloatArray]:
    """Temperatures of a body that was at 1 degC, losing heat at its outer end to air of 0 degC."""
    matrix = conduction(space, K) + film * edge(space, outer).mass
    stepper = Stepper(capacity(space, RHO_C), csr_matrix(matrix), dt)
    return [s.temperatures for s in stepper.march(np.ones(space.n), np.zeros(space.n), steps)]


def test_cooling_bar() -> None:
    """Series with the roots of zeta tan(zeta) = Bi (Incropera, ch. 5.5), to 1e-4 of the first difference."""
    length, film = 0.2, 300.0
    biot = film * length / K
    roots = [brentq(lambda z: z * np.sin(z) - biot * np.cos(z), n * np.pi, n * np.pi + np.pi / 2) for n in range(60)]
    zeta = np.array(roots)[:, None]
    c = 4 * np.sin(zeta) / (2 * zeta + np.sin(2 * zeta))
    space = Space(MeshLine(np.linspace(0.0, length, 31)), 1e-3)
    found = cool(space, film, 4.0, 500)
    for step in (20, 100, 500):
        fourier = ALPHA * 4.0 * step / length**2
        exact = (c * np.exp(-(zeta**2) * fourier) * np.cos(zeta * space.points[0] / length)).sum(axis=0)
        assert np.abs(found[step - 1] - exact).max() < 1e-4
        assert exact.min() < 0.95  # something has happened


def test_cooling_hollow_cylinder() -> None:
    """Series of Bessel functions, insulated inside (Carslaw and Jaeger, ch. 7), to 1e-4 of the first difference."""
    a, b, film = 0.02, 0.06, 800.0

    def shape(r: FloatArray | float, s: float) -> FloatArray:
        return np.asarray(j0(s * r) * y1(s * a) - y0(s * r) * j1(s * a))

    def outside(s: float) -> float:
        slope = -s * (j1(s * b) * y1(s * a) - y1(s * b) * j1(s * a))
        return float(K * slope + film * shape(b, s))

    grid = np.linspace(1.0, 3000.0, 6000)
    signs = np.array([outside(s) for s in grid])
    roots = [brentq(outside, grid[i], grid[i + 1]) for i in np.nonzero(signs[:-1] * signs[1:] < 0)[0]]
    assert len(roots) > 30
    space = Space(MeshQuad.init_tensor(np.linspace(a, b, 17), np.linspace(0.0, 0.01, 2)), None)
    found = cool(space, film, 1.0, 120)
    for step in (10, 40, 120):
        exact = np.zeros(space.n)
        for s in roots:
            above = quad(lambda r, s=s: r * shape(r, s), a, b)[0]
            below = quad(lambda r, s=s: r * shape(r, s) ** 2, a, b, limit=200)[0]
            exact += above / below * np.exp(-ALPHA * s**2 * step) * shape(space.points[0], s)
        assert np.abs(found[step - 1] - exact).max() < 1e-4
        assert exact.min() < 0.9


def driven(space: Space) -> tuple[csr_matrix, csr_matrix, FloatArray, FloatArray]:
    """Capacity, conduction, load of the air and place of the heat of a tube."""
    air = edge(space, outer)
    heated = space.edge_mean(lambda x: x[0] < 0.02 + 1e-9)
    return capacity(space, RHO_C), csr_matrix(conduction(space, K) + 40.0 * air.mass), 40.0 * air.load, heated


def test_energy_is_accounted_for_to_rounding() -> None:
    """Heat in = heat stored + heat to the air, heating up and cooling down, with steps far beyond the fast modes."""
    space = Space(MeshQuad.init_tensor(np.linspace(0.02, 0.06, 7), np.linspace(0.0, 0.2, 11)), None)
    c, k, air, heated = driven(space)
    stepper = Stepper(c, k, 60.0)

    def heat(t: float) -> FloatArray:
        power = 200.0 * (1 + np.sin(t / 700.0)) if t < 7200 else 0.0
        return np.asarray(power * heated + air * (20.0 + 2.0 * np.cos(t / 5000.0)))

    start = np.full(space.n, 20.0)
    steps = stepper.march(start, heat, 300)
    put_in = sum(60.0 * s.heat.sum() for s in steps)
    lost = sum(60.0 * air @ s.mean for s in steps)
    stored = (c @ (steps[-1].temperatures - start)).sum()
    assert steps[119].temperatures.max() > 40.0
    assert put_in == pytest.approx(stored + lost, rel=1e-11)


def test_the_error_falls_with_the_square_of_the_step() -> None:
    """Against the matrix exponential, with heat that varies in time."""
    space = Space(MeshQuad.init_tensor(np.linspace(0.02, 0.06, 4), np.linspace(0.0, 0.02, 2)), None)
    c, k, _, heated = driven(space)
    rate, total = 2 * np.pi / 400.0, 600.0
    # exact: (T, sin, cos) is a linear system without inputs
    drive = 100.0 * np.linalg.solve(c.toarray(), heated)
    n = space.n
    system = np.zeros((n + 2, n + 2))
    system[:n, :n] = -np.linalg.solve(c.toarray(), k.toarray())
    system[:n, n] = drive
    system[n, n + 1], system[n + 1, n] = rate, -rate
    exact = (expm(system * total) @ np.concatenate([np.ones(n), [0.0, 1.0]]))[:n]
    errors = []
    for steps in (20, 40, 80, 160):
        stepper = Stepper(c, k, total / steps)
        last = stepper.march(np.ones(n), lambda t: 100.0 * np.sin(rate * t) * heated, steps)[-1]
        errors.append(np.abs(last.temperatures - exact).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx(2.0, abs=0.15)
    assert errors[-1] < 1e-3 * np.abs(exact).max()


def test_what_decays_at_once_is_gone_after_one_step() -> None:
    """L-stable: a mode a million times faster than the step neither stays nor rings."""
    one = csr_matrix([[1.0]])
    step = Stepper(one, csr_matrix([[1.0]]), 1e6).advance(np.ones(1), np.zeros(1))
    assert abs(step.temperatures[0]) < 1e-5


def test_a_constant_temperature_stays() -> None:
    space = Space(MeshQuad.init_tensor(np.linspace(0.02, 0.06, 4), np.linspace(0.0, 0.02, 2)), None)
    c, k, air, _ = driven(space)
    last = Stepper(c, k, 30.0).march(np.full(space.n, 23.0), 23.0 * air, 50)[-1]
    assert last.temperatures == pytest.approx(np.full(space.n, 23.0), abs=1e-10)
