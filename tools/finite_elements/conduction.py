"""Conduction of heat: the matrices of C dT/dt = -K T + heat on a mesh.

Galerkin's method on the weak form of ``rho c dT/dt = div(k grad T)``; capacity and surfaces are consistent, not lumped.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_matrix
from skfem import BilinearForm

from finite_elements.part import Surface
from finite_elements.space import Facets, Space, Weight
from thermocomp.virtual.machine import Air

FloatArray = NDArray[np.float64]
MIDDLE = Air.REFERENCE_HEIGHT


def capacity(space: Space, heat_capacity: ArrayLike) -> csr_matrix:
    """Return C [J/K], of shape (n, n).

    Parameters
    ----------
    heat_capacity : float or array-like of shape (n_elements,)
        Density times specific heat [J/(m3 K)].
    """
    return space.mass(heat_capacity)


def conduction(space: Space, conductivity: ArrayLike) -> csr_matrix:
    """Return K of the insulated body [W/K], of shape (n, n).

    Parameters
    ----------
    conductivity : float or array-like of shape (n_elements,)
        [W/(m K)]
    """
    scale = space.cells(conductivity)
    form = BilinearForm(lambda u, v, _: scale * sum(u.grad[i] * v.grad[i] for i in range(space.dim)))
    return csr_matrix(form.assemble(space.basis))


def contact(space: Space, a: Facets, b: Facets, conductance: float, offset: ArrayLike = 0.0) -> csr_matrix:
    """Return the conduction [W/K] through a contact of two edges that lie on each other, of shape (n, n).

    Parameters
    ----------
    conductance : float
        [W/(m2 K)]
    offset : array-like of shape (dim,)
        From a point of `a` to its partner of `b` [m].
    """
    area, difference = space.jump(a, b, offset)
    return csr_matrix(conductance * (difference.T @ area @ difference))


def edge(
    space: Space, where: Facets, *, height: Weight = MIDDLE, side: Weight = 0.0, width: ArrayLike | None = None
) -> Surface:
    """Return an edge of the mesh as a surface to the air.

    Parameters
    ----------
    height, side : Weight
        Of the air there: above the floor, to the right of the machine's middle [m].
    width : float or array-like of shape (n_elements,), optional
        Of the edge, if not the section of the elements [m].
    """
    up, right = _place(height, MIDDLE), _place(side, 0.0)
    return Surface(
        space.edge_mass(where, width=width),
        space.edge_load(where, width=width),
        space.edge_load(where, up, width),
        space.edge_load(where, right, width),
    )


def faces(space: Space, exposure: ArrayLike, *, height: Weight = MIDDLE, side: Weight = 0.0) -> Surface:
    """Return the faces of a sheet, or the circumference of a bar, as a surface to the air.

    Parameters
    ----------
    exposure : float or array-like of shape (n_elements,)
        Of a sheet: how many of its two faces the air touches. Of a bar: its circumference [m].
    height, side : Weight
        Of the air there [m].
    """
    bare = Space(space.mesh, 1.0, space.degree)
    exposed = bare.per_element(exposure)

    def times(weight: Weight, zero: float) -> Weight:
        place = bare.at(weight, bare.basis, slice(None)) - zero
        return lambda _: place * exposed[:, None]

    return Surface(
        bare.mass(exposed), bare.load(exposed), bare.load(times(height, MIDDLE)), bare.load(times(side, 0.0))
    )


def together(*surfaces: Surface) -> Surface:
    """Return several surfaces of one part as one."""
    first, *others = surfaces
    mass, load, height, side = first.mass, first.load, first.height, first.side
    for s in others:
        mass, load, height, side = mass + s.mass, load + s.load, height + s.height, side + s.side
    return Surface(csr_matrix(mass), load, height, side)


def _place(weight: Weight, zero: float) -> Weight:
    if callable(weight):
        place = weight
        return lambda x: place(x) - zero
    return np.asarray(weight, dtype=np.float64) - zero
