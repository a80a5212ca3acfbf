"""Conduction against closed forms: bar and hollow cylinder, steady; contacts, surfaces, places; orders."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import spsolve
from skfem import Mesh, MeshLine, MeshQuad, MeshTri

from finite_elements.conduction import MIDDLE, capacity, conduction, contact, edge, faces, together
from finite_elements.part import Part, Surface
from finite_elements.space import Space
from thermocomp.core.exceptions import InputError

FloatArray = NDArray[np.float64]

K = 45.0  # W/(m K)
RHO_C = 3.7e6  # J/(m3 K)


def l2_error(space: Space, found: FloatArray, exact: Callable[[FloatArray], FloatArray]) -> float:
    """Root of the mean square of the error over the volume."""
    x = np.asarray(space.basis.global_coordinates())
    error = np.asarray(space.basis.interpolate(found)) - exact(x)
    return float(np.sqrt((error**2 * space.cells() * space.basis.dx).sum() / space.volume))


def left(x: FloatArray) -> NDArray[np.bool_]:
    return np.asarray(x[0] < x[0].min() + 1e-9)


def right(x: FloatArray) -> NDArray[np.bool_]:
    return np.asarray(x[0] > x[0].max() - 1e-9)


def bars(n: int) -> dict[str, Mesh]:
    x = np.linspace(0.0, 0.3, n + 1)
    y = np.linspace(0.0, 0.02, 3)
    return {"line": MeshLine(x), "quad": MeshQuad.init_tensor(x, y), "tri": MeshTri.init_tensor(x, y)}


class TestFin:
    """A bar warm at one end, giving heat to the air all along: T = cosh(m (L - x)) / cosh(m L) (Incropera, ch. 3.6)."""

    LENGTH, THICKNESS, FILM, HEAT = 0.3, 0.01, 20.0, 3.0
    M = float(np.sqrt(2 * FILM / (K * THICKNESS)))

    def exact(self, x: FloatArray) -> FloatArray:
        # heat Q = k A m sinh(m L) / cosh(m L) enters at x = 0
        scale = self.HEAT / (K * self.THICKNESS * 0.02 * self.M * np.sinh(self.M * self.LENGTH))
        return np.asarray(scale * np.cosh(self.M * (self.LENGTH - x[0])))

    def solve(self, mesh: Mesh, degree: int) -> tuple[Space, FloatArray]:
        if isinstance(mesh, MeshLine):
            space, exposure = Space(mesh, self.THICKNESS * 0.02, degree), 2 * 0.02
        else:
            space, exposure = Space(mesh, self.THICKNESS, degree), 2.0
        matrix = conduction(space, K) + self.FILM * faces(space, exposure).mass
        return space, spsolve(matrix.tocsc(), self.HEAT * space.edge_mean(left))

    @pytest.mark.parametrize("kind", ["line", "quad", "tri"])
    def test_agrees_with_the_closed_form(self, kind: str) -> None:
        space, found = self.solve(bars(20)[kind], 2)
        assert l2_error(space, found, self.exact) < 1e-4 * self.exact(np.zeros(1))[()].max()

    @pytest.mark.parametrize("degree", [1, 2])
    @pytest.mark.parametrize("kind", ["line", "quad", "tri"])
    def test_the_mean_error_falls_with_the_element_by_one_order_more_than_its_degree(
        self, kind: str, degree: int
    ) -> None:
        errors = [l2_error(*self.solve(bars(n)[kind], degree), self.exact) for n in (10, 20, 40)]
        orders = np.log2(np.array(errors[:-1]) / errors[1:])
        assert orders == pytest.approx(degree + 1, abs=0.1)


class TestHollowCylinder:
    """Heat through a tube: T = T_outer + Q ln(b / r) / (2 pi k L)."""

    A, B, LENGTH, FILM, HEAT, AIR = 0.03, 0.06, 0.1, 200.0, 500.0, 20.0

    def exact(self, x: FloatArray) -> FloatArray:
        outer = self.AIR + self.HEAT / (self.FILM * 2 * np.pi * self.B * self.LENGTH)
        return np.asarray(outer + self.HEAT * np.log(self.B / x[0]) / (2 * np.pi * K * self.LENGTH))

    def solve(self, n: int, degree: int) -> tuple[Space, FloatArray]:
        mesh = MeshQuad.init_tensor(np.linspace(self.A, self.B, n + 1), np.linspace(0.0, self.LENGTH, 3))
        space = Space(mesh, None, degree)
        air = edge(space, right)
        matrix = conduction(space, K) + self.FILM * air.mass
        heat = self.HEAT * space.edge_mean(left) + self.FILM * self.AIR * air.load
        return space, spsolve(matrix.tocsc(), heat)

    def test_agrees_with_the_logarithm_to_a_millikelvin(self) -> None:
        space, found = self.solve(8, 2)
        assert np.abs(found - self.exact(space.points)).max() < 1e-3

    @pytest.mark.parametrize("degree", [1, 2])
    def test_the_mean_error_falls_by_one_order_more_than_the_degree(self, degree: int) -> None:
        errors = [l2_error(*self.solve(n, degree), self.exact) for n in (4, 8, 16)]
        orders = np.log2(np.array(errors[:-1]) / errors[1:])
        assert orders == pytest.approx(degree + 1, abs=0.15)


def two_bars(degree: int = 2) -> Space:
    """Two bars of 0.1 m end to end, without a common vertex."""
    first = MeshQuad.init_tensor(np.linspace(0.0, 0.1, 6), np.linspace(0.0, 0.02, 3))
    n = first.nvertices
    shifted = first.p + np.array([[0.1], [0.0]])
    return Space(MeshQuad(np.hstack([first.p, shifted]), np.hstack([first.t, first.t + n])), 0.01, degree)


def joint(space: Space, side: int) -> NDArray[np.integer]:
    """Facets of the first (0) or second (1) bar at x = 0.1 m."""
    mesh = space.mesh
    at = np.abs(mesh.p[0, mesh.facets] - 0.1).max(axis=0) < 1e-9
    return np.nonzero(at & ((mesh.facets >= mesh.nvertices // 2).all(axis=0) == bool(side)))[0]


def test_a_contact_makes_the_step_in_temperature_that_its_conductance_asks_for() -> None:
    space = two_bars()
    flux, film, conductance, area = 8.0, 500.0, 2500.0, 0.01 * 0.02
    matrix = conduction(space, K) + contact(space, joint(space, 0), joint(space, 1), conductance)
    matrix += film * edge(space, right).mass
    found = spsolve(matrix.tocsc(), flux * space.edge_mean(left))
    ends = [space.edge_mean(w) @ found for w in (left, joint(space, 0), joint(space, 1), right)]
    steps = [0.1 / (K * area), 1 / (conductance * area), 0.1 / (K * area), 1 / (film * area)]
    assert -np.diff([*ends, 0.0]) == pytest.approx(flux * np.array(steps), rel=1e-9)


def test_a_contact_finds_the_other_side_at_a_distance() -> None:
    space = two_bars()
    # insulated but for a wall that conducts between the far ends, 0.2 m apart
    apart = contact(space, left, right, 100.0, offset=(0.2, 0.0))
    difference = space.edge_mean(left) - space.edge_mean(right)
    field = 3.0 * (space.points[0] < 0.1 - 1e-9) + 1.0
    field[joint(space, 0)] = 4.0
    assert field @ apart @ field == pytest.approx(100.0 * 0.01 * 0.02 * (difference @ field) ** 2, rel=1e-12)
    with pytest.raises(InputError, match="lie on each other"):
        contact(space, left, right, 100.0)


def test_edges_of_different_division_do_not_touch() -> None:
    space = two_bars()
    with pytest.raises(InputError, match="5 and 3 points"):
        contact(space, left, joint(space, 1)[:1], 1.0)


class TestMeasures:
    """Volumes, areas and means are those of the body, not of the drawing."""

    def test_tube(self) -> None:
        mesh = MeshQuad.init_tensor(np.linspace(0.02, 0.05, 4), np.linspace(0.0, 0.2, 7))
        space = Space(mesh, None)
        volume = np.pi * (0.05**2 - 0.02**2) * 0.2
        assert space.volume == pytest.approx(volume, rel=1e-12)
        assert capacity(space, RHO_C).sum() == pytest.approx(RHO_C * volume, rel=1e-12)
        assert edge(space, right).area == pytest.approx(2 * np.pi * 0.05 * 0.2, rel=1e-12)
        end = edge(space, lambda x: x[1] > 0.2 - 1e-9, height=1.5, side=lambda x: x[1])
        assert end.area == pytest.approx(volume / 0.2, rel=1e-12)
        assert end.height.sum() == pytest.approx((1.5 - MIDDLE) * end.area, rel=1e-12)
        assert end.side.sum() == pytest.approx(0.2 * end.area, rel=1e-12)
        assert end.mass.sum() == pytest.approx(end.area, rel=1e-12)

    def test_sheet_of_two_thicknesses(self) -> None:
        mesh = MeshQuad.init_tensor(np.linspace(0.0, 0.4, 9), np.linspace(0.0, 1.0, 11))
        thick = np.where(mesh.p[0, mesh.t].mean(axis=0) < 0.2, 0.03, 0.01)
        space = Space(mesh, thick)
        assert space.volume == pytest.approx(0.2 * 0.03 + 0.2 * 0.01, rel=1e-12)
        assert edge(space, left).area == pytest.approx(0.03, rel=1e-12)
        assert edge(space, left, width=0.5).area == pytest.approx(0.5, rel=1e-12)
        both = together(
            faces(space, np.where(thick > 0.02, 2.0, 1.0), height=lambda x: 0.3 + x[1], side=0.4), edge(space, right)
        )
        assert both.area == pytest.approx(0.4 + 0.2 + 0.01, rel=1e-12)
        assert both.height.sum() == pytest.approx((0.8 - MIDDLE) * 0.6, rel=1e-12)
        assert both.side.sum() == pytest.approx(0.4 * 0.6, rel=1e-12)

    def test_a_boundary_may_have_a_name(self) -> None:
        mesh = MeshQuad.init_tensor(np.linspace(0.0, 0.4, 9), np.linspace(0.0, 1.0, 11))
        space = Space(mesh.with_boundaries({"end": right}), 0.02)
        assert space.edge_mean("end") == pytest.approx(space.edge_mean(right), abs=1e-15)

    def test_bar(self) -> None:
        space = Space(MeshLine(np.linspace(0.0, 2.0, 21)), 1e-3)
        assert faces(space, 0.12).area == pytest.approx(0.24, rel=1e-12)
        assert edge(space, right).area == pytest.approx(1e-3, rel=1e-12)

    @pytest.mark.parametrize("degree", [1, 2])
    def test_places_average_a_linear_field_to_its_value_at_their_middle(self, degree: int) -> None:
        mesh = MeshQuad.init_tensor(np.linspace(0.0, 0.4, 17), np.linspace(0.0, 1.0, 41))
        space = Space(mesh, 0.02, degree)
        field = 3.0 * space.points[0] - space.points[1]
        assert space.around((0.2, 0.5), 0.06) @ field == pytest.approx(0.1, abs=1e-9)
        assert space.mean((mesh.p[1, mesh.t].mean(axis=0) < 0.5).astype(float)) @ field == pytest.approx(0.35)
        assert space.edge_mean(right) @ field == pytest.approx(0.7)
        assert space.points[:, space.nearest((0.21, 0.49))] == pytest.approx((0.2, 0.5), abs=0.0126)


class TestRefusals:
    def test_space(self) -> None:
        with pytest.raises(InputError, match="degree 3"):
            Space(MeshLine(np.linspace(0, 1, 3)), 1.0, 3)
        with pytest.raises(InputError, match="axisymmetric"):
            Space(MeshLine(np.linspace(0, 1, 3)), None)
        with pytest.raises(InputError, match="not positive"):
            Space(MeshLine(np.linspace(0, 1, 3)), 0.0)
        with pytest.raises(InputError, match="for 2 elements"):
            Space(MeshLine(np.linspace(0, 1, 3)), [1.0, 2.0, 3.0])

    def test_places_off_the_mesh(self) -> None:
        space = two_bars()
        with pytest.raises(InputError, match="no boundary 'top'"):
            space.edge_mean("top")
        with pytest.raises(InputError, match="no facet"):
            space.edge_mean(lambda x: x[0] > 9.0)
        with pytest.raises(InputError, match="to be averaged"):
            space.around((5.0, 5.0), 0.1)

    def test_part(self) -> None:
        space = two_bars()
        c, k, air = capacity(space, RHO_C), conduction(space, K), edge(space, left)
        one = space.edge_mean(left)
        assert Part("bar", c, k, {"air": air}, {"end": one}, {"x": one}, {"on": k}).n == space.n
        with pytest.raises(InputError, match="bar: patch end sums to 2"):
            Part("bar", c, k, {}, {"end": 2 * one}, {})
        with pytest.raises(InputError, match="conduction makes heat"):
            Part("bar", c, csr_matrix(k + air.mass), {}, {}, {})
        with pytest.raises(InputError, match="on makes heat"):
            Part("bar", c, k, {}, {}, {}, {"on": air.mass})
        with pytest.raises(InputError, match="conduction is of shape"):
            Part("bar", c, k[:-1], {}, {}, {})
        with pytest.raises(InputError, match="observable x is of shape"):
            Part("bar", c, k, {}, {}, {"x": one[1:]})
        with pytest.raises(InputError, match="load of surface air"):
            Part("bar", c, k, {"air": Surface(air.mass, air.load * np.nan, air.height, air.side)}, {}, {})
