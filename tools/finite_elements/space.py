"""Functions on the mesh of a part, and what is integrated over its volume, edges and points."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_matrix
from scipy.spatial import KDTree
from skfem import (
    Basis,
    BilinearForm,
    ElementLineP1,
    ElementLineP2,
    ElementQuad1,
    ElementQuad2,
    ElementTriP1,
    ElementTriP2,
    FacetBasis,
    LinearForm,
    Mesh,
    MeshLine,
    MeshQuad,
    MeshTri,
)

from thermocomp.core.exceptions import InputError

FloatArray = NDArray[np.float64]
#: facets: by the mesh's name for them, by their numbers, or those of the boundary whose midpoints satisfy a condition
Facets = str | NDArray[np.integer[Any]] | Callable[[FloatArray], NDArray[np.bool_]]
#: a weight: one number, one per element, or a function of the position (dim, ...) [m]
Weight = ArrayLike | Callable[[FloatArray], FloatArray]

_ELEMENTS = {
    (MeshLine, 1): ElementLineP1,
    (MeshLine, 2): ElementLineP2,
    (MeshQuad, 1): ElementQuad1,
    (MeshQuad, 2): ElementQuad2,
    (MeshTri, 1): ElementTriP1,
    (MeshTri, 2): ElementTriP2,
}
#: exact for products of two second-order functions and the radius
_ORDER = 5


class Space:
    """Piecewise polynomials on a mesh, with what the mesh does not know: thickness, or rotation about an axis.

    Parameters
    ----------
    mesh : skfem.Mesh
        Of lines, quadrilaterals or triangles [m]. It may consist of several pieces that do not share vertices.
    section : float, array-like of shape (n_elements,) or None
        Cross section of a line [m2], thickness of a sheet [m]; None: the mesh is the half plane (r, z) of a body of
        revolution.
    degree : {1, 2}
        Of the polynomials.

    Attributes
    ----------
    n : int
        Number of degrees of freedom.
    points : ndarray of shape (dim, n)
        Where they are [m].
    volume : float
        [m3]

    Raises
    ------
    InputError
        There is no such element, or the section is not positive.
    """

    def __init__(self, mesh: Mesh, section: ArrayLike | None, degree: int = 2) -> None:
        kind = next((e for (m, d), e in _ELEMENTS.items() if isinstance(mesh, m) and d == degree), None)
        if kind is None or (section is None and mesh.dim() != 2):
            about = "axisymmetric " if section is None else ""
            raise InputError(f"no {about}element of degree {degree} on a {type(mesh).__name__}; use 1 or 2")
        self.mesh = mesh
        self.dim = int(mesh.dim())
        self.degree = degree
        self.section = None if section is None else self.per_element(section)
        if self.section is not None and not (self.section > 0).all():
            raise InputError("thickness or cross section of an element is not positive")
        self._element = kind()
        self.basis = Basis(mesh, self._element, intorder=_ORDER)
        self.n = int(self.basis.N)
        self.points: FloatArray = np.asarray(self.basis.doflocs)
        self.volume = float(self.load().sum())

    @property
    def axisymmetric(self) -> bool:
        """True for a body of revolution."""
        return self.section is None

    def per_element(self, values: ArrayLike) -> FloatArray:
        """Return one value per element."""
        given = np.asarray(values, dtype=np.float64)
        if given.shape not in ((), (self.mesh.nelements,)):
            raise InputError(f"{given.shape} values for {self.mesh.nelements} elements; want one, or one each")
        return np.broadcast_to(given, (self.mesh.nelements,))

    def at(self, weight: Weight, basis: Basis, elements: NDArray[np.integer[Any]] | slice) -> FloatArray:
        """Return a weight at the quadrature points, of shape (n_cells, n_points)."""
        shape = basis.dx.shape
        if callable(weight):
            return np.broadcast_to(np.asarray(weight(np.asarray(basis.global_coordinates())), dtype=np.float64), shape)
        return np.broadcast_to(self.per_element(weight)[elements][:, None], shape)

    def cells(self, weight: Weight = 1.0) -> FloatArray:
        """Return a weight times thickness, cross section or circumference at the quadrature points."""
        return self.at(weight, self.basis, slice(None)) * self._around(self.basis, slice(None))

    def load(self, weight: Weight = 1.0) -> FloatArray:
        """Return the integral of phi_i times `weight` over the volume, of shape (n,)."""
        scale = self.cells(weight)
        return np.asarray(LinearForm(lambda v, _: scale * v).assemble(self.basis), dtype=np.float64)

    def mass(self, weight: Weight = 1.0) -> csr_matrix:
        """Return the integral of phi_i phi_j times `weight` over the volume, of shape (n, n)."""
        scale = self.cells(weight)
        return csr_matrix(BilinearForm(lambda u, v, _: scale * u * v).assemble(self.basis))

    def facets(self, where: Facets) -> NDArray[np.integer[Any]]:
        """Return the numbers of facets."""
        if isinstance(where, str):
            found = (self.mesh.boundaries or {}).get(where)
            if found is None:
                raise InputError(f"mesh has no boundary {where!r}; it has {', '.join(self.mesh.boundaries or {})}")
        elif callable(where):
            found = self.mesh.facets_satisfying(where, boundaries_only=True)
        else:
            found = where
        found = np.asarray(found)
        if not found.size:
            raise InputError("no facet of the mesh is at the place asked for")
        return found

    def edge_load(self, where: Facets, weight: Weight = 1.0, width: ArrayLike | None = None) -> FloatArray:
        """Return the integral of phi_i times `weight` over an edge, of shape (n,).

        Parameters
        ----------
        width : float or array-like of shape (n_elements,), optional
            Of the edge across the mesh [m] (of a line's end: area [m2]), if not the section or the circumference.
        """
        basis, scale = self._edge(where, weight, width)
        return np.asarray(LinearForm(lambda v, _: scale * v).assemble(basis), dtype=np.float64)

    def edge_mass(self, where: Facets, weight: Weight = 1.0, width: ArrayLike | None = None) -> csr_matrix:
        """Return the integral of phi_i phi_j times `weight` over an edge; parameters as of `edge_load`."""
        basis, scale = self._edge(where, weight, width)
        return csr_matrix(BilinearForm(lambda u, v, _: scale * u * v).assemble(basis))

    def mean(self, weight: Weight = 1.0) -> FloatArray:
        """Return the row that averages over the volume with a weight, of shape (n,); it sums to 1."""
        return _normalised(self.load(weight))

    def edge_mean(self, where: Facets, weight: Weight = 1.0) -> FloatArray:
        """Return the row that averages over an edge, of shape (n,); it sums to 1."""
        return _normalised(self.edge_load(where, weight))

    def around(self, point: ArrayLike, radius: float, of: Weight = 1.0) -> FloatArray:
        """Return the row that averages round a point: weight 1 there, falling smoothly to 0 at the radius [m].

        Parameters
        ----------
        point : array-like of shape (dim,)
            [m]
        radius : float
            Not much less than an element, else nothing is seen of it [m].
        """
        centre = np.asarray(point, dtype=np.float64).reshape(-1, 1, 1)
        share = self.at(of, self.basis, slice(None))

        def bell(x: FloatArray) -> FloatArray:
            away = ((x - centre) ** 2).sum(axis=0) / radius**2
            return np.asarray(share * np.maximum(0.0, 1.0 - away) ** 2)

        return self.mean(bell)

    def nearest(self, point: ArrayLike) -> int:
        """Return the number of the degree of freedom nearest to a point [m]."""
        away = ((self.points - np.asarray(point, dtype=np.float64).reshape(-1, 1)) ** 2).sum(axis=0)
        return int(away.argmin())

    def jump(self, a: Facets, b: Facets, offset: ArrayLike = 0.0) -> tuple[csr_matrix, csr_matrix]:
        """Return what couples two edges that lie on each other: (area, difference).

        Parameters
        ----------
        offset : array-like of shape (dim,)
            From a point of `a` to its partner of `b` [m].

        Returns
        -------
        area : csr_matrix of shape (m, m)
            Integral of phi_i phi_j over edge `a` [m2].
        difference : csr_matrix of shape (m, n)
            Takes a field to its value on `a` minus that on `b`. ``h * difference.T @ area @ difference`` is the
            conduction of a contact.
        """
        mass = self.edge_mass(a)
        mine = np.unique(self.basis.get_dofs(self.facets(a)).all())
        theirs = np.setdiff1d(self.basis.get_dofs(self.facets(b)).all(), mine)
        if theirs.size != mine.size:
            raise InputError(f"edges of {mine.size} and {theirs.size} points do not lie on each other")
        target = (self.points[:, mine] + np.asarray(offset, dtype=np.float64).reshape(-1, 1)).T
        away, partner = KDTree(self.points[:, theirs].T).query(target)
        if away.max() > 1e-9 or np.unique(partner).size != partner.size:
            raise InputError(f"edges do not lie on each other: a point is {away.max():.3g} m from the other edge")
        rows = np.arange(mine.size)
        plus = csr_matrix((np.ones(mine.size), (rows, mine)), shape=(mine.size, self.n))
        minus = csr_matrix((np.ones(mine.size), (rows, theirs[partner])), shape=(mine.size, self.n))
        return mass[mine][:, mine], plus - minus

    def _edge(self, where: Facets, weight: Weight, width: ArrayLike | None) -> tuple[FacetBasis, FloatArray]:
        basis = FacetBasis(self.mesh, self._element, intorder=_ORDER, facets=self.facets(where))
        around = self._around(basis, basis.tind) if width is None else self.at(width, basis, basis.tind)
        return basis, self.at(weight, basis, basis.tind) * around

    def _around(self, basis: Basis, elements: NDArray[np.integer[Any]] | slice) -> FloatArray:
        if self.section is None:
            radius: FloatArray = 2.0 * np.pi * np.asarray(basis.global_coordinates())[0]
            return radius
        return np.broadcast_to(self.section[elements][:, None], basis.dx.shape)


def _normalised(row: FloatArray) -> FloatArray:
    total = row.sum()
    if not total > 0:
        raise InputError("no part of the mesh is at the place to be averaged")
    return np.asarray(row / total, dtype=np.float64)


def spot(axis: int, at: float, radius: float) -> Callable[[FloatArray], FloatArray]:
    """Return a weight that falls smoothly from 1 at a coordinate to 0 at the radius [m].

    Smooth, because integrals over elements are exact for polynomials only.
    """
    return lambda x: np.asarray(0.5 + 0.5 * np.cos(np.pi * np.minimum(1.0, np.abs(x[axis] - at) / radius)))
