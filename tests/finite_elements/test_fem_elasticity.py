"""Thermal displacement against closed forms: free growth, bending, thick tube, springs; order of convergence."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse.linalg import spsolve
from skfem import MeshLine, MeshQuad, MeshTri

from finite_elements.conduction import conduction, edge
from finite_elements.elasticity import Elastic, Tie
from finite_elements.space import Space
from thermocomp.core.exceptions import InputError

FloatArray = NDArray[np.float64]

E, NU, ALPHA = 210e9, 0.3, 12e-6
LENGTH, HEIGHT = 0.5, 0.05


def sheet(kind: type[MeshQuad] | type[MeshTri], n: int = 10, degree: int = 2) -> tuple[Space, Elastic, list[Tie]]:
    """A bar lying on x, held against rigid movement only."""
    mesh = kind.init_tensor(np.linspace(0.0, LENGTH, n + 1), np.linspace(0.0, HEIGHT, 4))
    space = Space(mesh, 0.02, degree)
    elastic = Elastic(space, modulus=E, poisson=NU, expansion=ALPHA)
    ties = [Tie(elastic.at((0.0, 0.0), 0)), Tie(elastic.at((0.0, 0.0), 1)), Tie(elastic.at((0.0, HEIGHT), 0))]
    return space, elastic, ties


@pytest.mark.parametrize("kind", [MeshQuad, MeshTri])
class TestSheet:
    def test_uniform_warmth_makes_it_longer(self, kind: type[MeshQuad]) -> None:
        _, elastic, ties = sheet(kind)
        rows = {"x": elastic.at((LENGTH, HEIGHT / 2), 0), "y": elastic.at((0.0, HEIGHT), 1)}
        gain = elastic.observables(rows, ties)
        assert gain["x"].sum() == pytest.approx(1e6 * ALPHA * LENGTH, rel=1e-9)
        assert gain["y"].sum() == pytest.approx(1e6 * ALPHA * HEIGHT, rel=1e-9)

    def test_a_linear_gradient_bends_it_without_stress(self, kind: type[MeshQuad]) -> None:
        """Curvature alpha dT/h: the end tilts by alpha dT/h L, and moves by half of that times L."""
        space, elastic, ties = sheet(kind)
        top, bottom = elastic.at((LENGTH, HEIGHT), 0), elastic.at((LENGTH, 0.0), 0)
        rows = {"y": elastic.at((LENGTH, 0.0), 1), "tilt": (bottom - top) / HEIGHT}
        gain = elastic.observables(rows, ties)
        warm = 10.0 * (0.5 - space.points[1] / HEIGHT)  # 10 K warmer below, so it bends upwards
        curvature = 1e6 * ALPHA * 10.0 / HEIGHT
        assert gain["tilt"] @ warm == pytest.approx(curvature * LENGTH, rel=1e-8)
        assert gain["y"] @ warm == pytest.approx(curvature * LENGTH**2 / 2, rel=1e-8)

    def test_warmth_that_rises_along_it(self, kind: type[MeshQuad]) -> None:
        """T = s x: u_x = alpha s (x^2 - y^2) / 2, u_y = alpha s x y, turned until the foot stands on its ties."""
        space, elastic, ties = sheet(kind)
        gain = elastic.observables({"x": elastic.at((LENGTH, 0.0), 0), "y": elastic.at((LENGTH, 0.0), 1)}, ties)
        warm = 8.0 * space.points[0]
        assert gain["x"] @ warm == pytest.approx(1e6 * ALPHA * 8.0 * LENGTH**2 / 2, rel=1e-9)
        assert gain["y"] @ warm == pytest.approx(-1e6 * ALPHA * 8.0 * HEIGHT / 2 * LENGTH, rel=1e-8)


def test_bar_between_wall_and_spring() -> None:
    """u = alpha T L (EA/L) / (EA/L + k), alike as a bar and as a sheet without cross contraction."""
    stiffness, section = 3e7, 0.02 * HEIGHT
    own = E * section / LENGTH
    want = 1e6 * ALPHA * LENGTH * own / (own + stiffness)
    bar = Elastic(Space(MeshLine(np.linspace(0.0, LENGTH, 6)), section), modulus=E, expansion=ALPHA)
    ends = [bar.at([0.0], 0), bar.at([LENGTH], 0)]
    found = bar.observables({"end": ends[1]}, [Tie(ends[0]), Tie(ends[1], stiffness)])["end"].sum()
    assert found == pytest.approx(want, rel=1e-10)

    mesh = MeshQuad.init_tensor(np.linspace(0.0, LENGTH, 6), np.linspace(0.0, HEIGHT, 3))
    space = Space(mesh, 0.02)
    plane = Elastic(space, modulus=E, poisson=0.0, expansion=ALPHA)
    end = plane.row(plane.space.edge_mean(lambda x: x[0] > LENGTH - 1e-9), 0)
    foot = [Tie(plane.at((0.0, y), 0)) for y in np.linspace(0.0, HEIGHT, 5)]
    # a soft mean spring lets the end bulge by nothing, as nu = 0
    found = plane.observables({"end": end}, [*foot, Tie(plane.at((0.0, 0.0), 1)), Tie(end, stiffness)])["end"].sum()
    assert found == pytest.approx(want, rel=1e-6)


def tube(n: int, degree: int, length: float = 0.01) -> tuple[Space, Elastic, list[Tie]]:
    """A slice of a long tube: its faces stay plane, but may move apart."""
    mesh = MeshQuad.init_tensor(np.linspace(0.03, 0.06, n + 1), np.linspace(0.0, length, 2))
    space = Space(mesh, None, degree)
    elastic = Elastic(space, modulus=E, poisson=NU, expansion=ALPHA)
    radii = np.unique(np.round(elastic.space.points[0], 12))
    top = [elastic.at((r, length), 1) for r in radii]
    ties = [Tie(elastic.at((r, 0.0), 1)) for r in radii] + [Tie(t - top[0]) for t in top[1:]]
    return space, elastic, ties


class TestTube:
    """Heat from inside to outside. u(b) = 2 alpha b / (b^2 - a^2) int T r dr (Timoshenko and Goodier, ch. 13)."""

    A, B = 0.03, 0.06

    def grown(self, field: Callable[[FloatArray], FloatArray], n: int = 10_000) -> tuple[float, float]:
        """Exact growth of the inner and outer radius [um]; Simpson's rule."""
        r = np.linspace(self.A, self.B, 2 * n + 1)
        w = np.full(2 * n + 1, 2.0)
        w[1::2], w[[0, -1]] = 4.0, 1.0
        integral = (w * field(r) * r).sum() * (r[1] - r[0]) / 3
        mean = 2e6 * ALPHA * integral / (self.B**2 - self.A**2)
        return self.A * mean, self.B * mean

    def found(self, n: int, degree: int, field: Callable[[FloatArray], FloatArray]) -> tuple[float, float]:
        space, elastic, ties = tube(n, degree)
        rows = {"a": elastic.at((self.A, 0.0), 0), "b": elastic.at((self.B, 0.0), 0)}
        gain = elastic.observables(rows, ties)
        t = field(space.points[0])
        return float(gain["a"] @ t), float(gain["b"] @ t)

    def test_growth_of_both_radii(self) -> None:
        def field(r: FloatArray) -> FloatArray:
            return np.asarray(30.0 * np.log(self.B / r) / np.log(2.0))

        assert self.found(12, 2, field) == pytest.approx(self.grown(field), rel=1e-5)

    @pytest.mark.parametrize(("degree", "order"), [(1, 2.0), (2, 4.0)])
    def test_order_of_convergence(self, degree: int, order: float) -> None:
        """Of the growth by a temperature field that is itself computed: twice the degree."""

        def growth(n: int) -> float:
            space, elastic, ties = tube(n, degree)
            matrix = conduction(space, 45.0) + 200.0 * edge(space, lambda x: x[0] > self.B - 1e-9).mass
            t = spsolve(matrix.tocsc(), 50.0 * space.edge_mean(lambda x: x[0] < self.A + 1e-9))
            return float(elastic.observables({"b": elastic.at((self.B, 0.0), 0)}, ties)["b"] @ t)

        outer = 50.0 / (200.0 * 2 * np.pi * self.B * 0.01)
        step = 50.0 / (2 * np.pi * 45.0 * 0.01)
        exact = self.grown(lambda r: outer + step * np.log(self.B / r))[1]
        errors = np.array([abs(growth(n) - exact) for n in (2, 4, 8)])
        assert np.log2(errors[:-1] / errors[1:]) == pytest.approx(order, abs=0.35)


def test_solid_shaft_grows_freely_in_length_and_radius() -> None:
    mesh = MeshQuad.init_tensor(np.linspace(0.0, 0.04, 4), np.linspace(0.0, 0.3, 11))
    space = Space(mesh, None)
    elastic = Elastic(space, modulus=E, poisson=NU, expansion=ALPHA)
    foot = Tie(elastic.row(elastic.space.edge_mean(lambda x: x[1] < 1e-9), 1))
    rows = {"z": elastic.at((0.0, 0.3), 1), "r": elastic.at((0.04, 0.1), 0)}
    gain = elastic.observables(rows, [foot])
    assert gain["z"].sum() == pytest.approx(1e6 * ALPHA * 0.3, rel=1e-9)
    assert gain["r"].sum() == pytest.approx(1e6 * ALPHA * 0.04, rel=1e-9)
    # T = z: u_z = alpha (z^2 - r^2) / 2, so that the mean of the foot stands alpha R^2 / 4 below the axis
    assert gain["z"] @ space.points[1] == pytest.approx(1e6 * ALPHA * (0.3**2 / 2 + 0.04**2 / 4), rel=1e-9)


def test_a_contact_is_as_stiff_as_it_says() -> None:
    """Two bars end to end between walls: the joint's spring takes its share of the growth."""
    mesh = MeshQuad.init_tensor(np.linspace(0.0, 0.1, 6), np.linspace(0.0, 0.02, 3))
    both = MeshQuad(
        np.hstack([mesh.p, mesh.p + np.array([[0.1], [0.0]])]), np.hstack([mesh.t, mesh.t + mesh.nvertices])
    )
    at = np.abs(both.p[0, both.facets] - 0.1).max(axis=0) < 1e-9
    first = (both.facets < mesh.nvertices).all(axis=0)
    a, b = np.nonzero(at & first)[0], np.nonzero(at & ~first)[0]
    space = Space(both, 0.01)
    elastic = Elastic(space, modulus=E, poisson=0.0, expansion=ALPHA)
    k, area = 2e12, 0.01 * 0.02
    joint = elastic.contact(a, b, (k, 1e9))
    ys = np.linspace(0.0, 0.02, 5)
    walls = [Tie(elastic.at((x, y), 0)) for x in (0.0, 0.2) for y in ys]
    walls += [Tie(elastic.at((x, 0.0), 1)) for x in (0.0, 0.2)]
    left = elastic.row(elastic.space.edge_mean(a), 0)
    right = elastic.row(elastic.space.edge_mean(b), 0)
    gain = elastic.observables({"squeeze": left - right}, walls, [joint])["squeeze"].sum()
    # force = alpha 2 L / (2 L / EA + 1 / (k A)); squeeze = force / (k A)
    force = ALPHA * 0.2 / (0.2 / (E * area) + 1 / (k * area))
    assert gain == pytest.approx(1e6 * force / (k * area), rel=1e-6)


def test_a_body_that_is_not_held_is_refused() -> None:
    _, elastic, ties = sheet(MeshQuad)
    row = {"x": elastic.at((LENGTH, 0.0), 0), "y": elastic.at((LENGTH, 0.0), 1)}
    for missing in range(3):
        with pytest.raises(InputError, match="not held"):
            elastic.observables(row, [t for k, t in enumerate(ties) if k != missing])
    with pytest.raises(InputError, match="not held"):
        elastic.observables(row, [])
    with pytest.raises(InputError, match="or given twice"):
        elastic.observables(row, [*ties, ties[0]])
    assert elastic.observables({}, []) == {}


def test_a_direction_may_be_a_vector() -> None:
    _, elastic, ties = sheet(MeshQuad)
    end = elastic.space.edge_mean(lambda x: x[0] > LENGTH - 1e-9)
    rows = {"x": elastic.row(end, 0), "y": elastic.row(end, 1), "mixed": elastic.row(end, (0.6, -0.8))}
    gain = elastic.observables(rows, ties)
    assert gain["mixed"] == pytest.approx(0.6 * gain["x"] - 0.8 * gain["y"], abs=1e-12)
