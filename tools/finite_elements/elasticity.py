"""Linear thermo-elasticity: what temperatures displace, as rows of numbers per temperature.

Hooke's law with the thermal strain ``alpha (T - T_ref)``: bars, sheets in plane stress, bodies of revolution. The
displacements u solve ``S u = G (T - T_ref)``. Of all of them a machine tool needs a few combinations ``d u``; their
rows ``d S^-1 G`` come from one solution each of the transposed system (S is symmetric), whatever the temperatures.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import bmat, csr_matrix, diags
from scipy.sparse.linalg import splu
from skfem import BilinearForm

from finite_elements.space import Facets, Space
from thermocomp.core.exceptions import InputError

FloatArray = NDArray[np.float64]

_LOOSE = "elastic body is not held: a support against a movement is missing, or given twice"


@dataclass(frozen=True, eq=False)
class Tie:
    """A support, or what joins two places: a spring on one combination of displacements.

    Parameters
    ----------
    row : ndarray of shape (n_displacements,)
        The combination, such as the mean of a place minus the mean of another.
    stiffness : float
        [N per m of the combination]; infinite: the combination stays zero.
    """

    row: FloatArray
    stiffness: float = np.inf


class Elastic:
    """A linear-elastic body on the mesh of a temperature field, with second-order displacements.

    Parameters
    ----------
    heat : Space
        Of the temperatures.
    modulus : float or array-like of shape (n_elements,)
        Young's [Pa].
    poisson : float or array-like of shape (n_elements,)
        Poisson's ratio; without effect for a bar.
    expansion : float or array-like of shape (n_elements,)
        [1/K]

    Attributes
    ----------
    space : Space
        Of one component of the displacement.
    n : int
        Number of displacements: component after component.
    stiffness : csr_matrix of shape (n, n)
        Of the free body [N/m].
    load : csr_matrix of shape (n, heat.n)
        Forces per temperature [N/K].
    """

    def __init__(self, heat: Space, *, modulus: ArrayLike, poisson: ArrayLike = 0.0, expansion: ArrayLike) -> None:
        self.space = Space(heat.mesh, heat.section, 2)
        self.n = self.space.n * self.space.dim
        e, nu = heat.per_element(modulus), heat.per_element(poisson)
        shear = e / (2.0 * (1.0 + nu))
        # Lame's first parameter; in plane stress the free thickness softens it, in a bar there is nothing across.
        if heat.dim == 1:
            shear, lame = e / 2.0, np.zeros_like(e)
        elif heat.axisymmetric:
            lame = e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))
        else:
            lame = e * nu / (1.0 - nu**2)
        # stress of a strain that is alike in all directions of the model
        directions = 3 if heat.axisymmetric else heat.dim
        pressure = (2.0 * shear + directions * lame) * heat.per_element(expansion)
        self.stiffness = self._stiffness(lame, shear)
        self.load = self._load(heat, pressure)

    def _stiffness(self, lame: FloatArray, shear: FloatArray) -> csr_matrix:
        space, dim = self.space, self.space.dim
        lam, mu = space.cells(lame), space.cells(shear)
        radius = np.asarray(space.basis.global_coordinates())[0] if space.axisymmetric else None

        def block(i: int, j: int) -> csr_matrix:
            # v = test function of component i, u = trial function of component j
            def form(u: Any, v: Any, _: Any) -> Any:
                div_u, div_v = u.grad[j], v.grad[i]
                if radius is not None:
                    div_u = div_u + u / radius if j == 0 else div_u
                    div_v = div_v + v / radius if i == 0 else div_v
                total = lam * div_u * div_v + mu * u.grad[i] * v.grad[j]
                if i == j:
                    total = total + mu * sum(u.grad[k] * v.grad[k] for k in range(dim))
                    if radius is not None and i == 0:
                        total = total + 2.0 * mu * u * v / radius**2
                return total

            return BilinearForm(form).assemble(space.basis)

        return csr_matrix(bmat([[block(i, j) for j in range(dim)] for i in range(dim)]))

    def _load(self, heat: Space, pressure: FloatArray) -> csr_matrix:
        space = self.space
        scale = space.cells(pressure)
        radius = np.asarray(space.basis.global_coordinates())[0] if space.axisymmetric else None

        def block(i: int) -> csr_matrix:
            def form(u: Any, v: Any, _: Any) -> Any:
                div_v = v.grad[i] + v / radius if radius is not None and i == 0 else v.grad[i]
                return scale * u * div_v

            return BilinearForm(form).assemble(heat.basis, space.basis)

        return csr_matrix(bmat([[block(i)] for i in range(space.dim)]))

    def row(self, weights: FloatArray, direction: int | ArrayLike) -> FloatArray:
        """Return the row of a weighted displacement along a coordinate or a direction, of shape (n,).

        Parameters
        ----------
        weights : ndarray of shape (space.n,)
            From ``space.mean``, ``space.edge_mean``, ``space.around``.
        direction : int or array-like of shape (dim,)
            Number of the coordinate, or a unit vector.
        """
        vector = np.eye(self.space.dim)[direction] if isinstance(direction, int) else np.asarray(direction, np.float64)
        return np.concatenate([c * weights for c in vector])

    def at(self, point: ArrayLike, direction: int) -> FloatArray:
        """Return the row of the displacement of the mesh's point nearest to `point` [m]."""
        weights = np.zeros(self.space.n)
        weights[self.space.nearest(point)] = 1.0
        return self.row(weights, direction)

    def contact(self, a: Facets, b: Facets, stiffness: Sequence[float], offset: ArrayLike = 0.0) -> csr_matrix:
        """Return the stiffness [N/m] of a contact of two edges that lie on each other.

        Parameters
        ----------
        stiffness : sequence of float
            Along each coordinate [N/m3].
        offset : array-like of shape (dim,)
            From a point of `a` to its partner of `b` [m].
        """
        area, difference = self.space.jump(a, b, offset)
        joint = difference.T @ area @ difference
        return csr_matrix(
            bmat([[k * joint if i == j else None for j in range(len(stiffness))] for i, k in enumerate(stiffness)])
        )

    def observables(
        self, rows: Mapping[str, FloatArray], ties: Sequence[Tie], contacts: Sequence[csr_matrix] = ()
    ) -> dict[str, FloatArray]:
        """Return what each combination of displacements gains per temperature.

        Parameters
        ----------
        rows : mapping of str to ndarray of shape (n,)
            Combinations of displacements: of length [m], or divided by a length [rad].
        contacts : sequence of csr_matrix of shape (n, n)

        Returns
        -------
        dict of str to ndarray of shape (heat.n,)
            [um/K] or [urad/K]
        """
        if not rows:
            return {}
        stiff = csr_matrix(sum(contacts, start=self.stiffness))
        scale = stiff.diagonal().mean()
        constraints = csr_matrix(np.array([t.row for t in ties]).reshape(len(ties), self.n))
        # Multipliers carry the ties, so that a rigid one and a soft one are the same thing: row u = force / stiffness.
        yielding = diags([scale / t.stiffness for t in ties]) if ties else csr_matrix((0, 0))
        system = bmat([[stiff / scale, constraints.T], [constraints, -yielding]], format="csc")
        # On the axis of a body of revolution nothing moves sideways.
        free = np.ones(system.shape[0], dtype=np.bool_)
        if self.space.axisymmetric:
            free[: self.space.n] = self.space.points[0] > 1e-12
        system = system[free][:, free].tocsc()
        wanted = np.zeros((system.shape[0], len(rows)))
        wanted[: free[: self.n].sum()] = np.array([r[free[: self.n]] for r in rows.values()]).T
        try:
            solved = splu(system).solve(wanted)
        except RuntimeError as error:
            raise InputError(_LOOSE) from error
        answer = np.zeros((self.n, len(rows)))
        answer[free[: self.n]] = solved[: free[: self.n].sum()] / scale
        gains = 1e6 * (self.load.T @ answer)
        # A body that is nearly free lets rounding grow: the forces must come back.
        if not np.isfinite(gains).all() or np.abs(system @ solved - wanted).max() > 1e-6 * np.abs(wanted).max():
            raise InputError(_LOOSE)
        return {name: np.ascontiguousarray(gains[:, k]) for k, name in enumerate(rows)}
