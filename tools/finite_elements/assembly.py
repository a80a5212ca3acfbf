"""Parts, films and links put together: the sparse equations of a whole machine."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.sparse import csr_matrix

from finite_elements.part import Part, Surface
from thermocomp.core.exceptions import InputError
from thermocomp.virtual.machine import Air

FloatArray = NDArray[np.float64]

#: columns of the air: its temperature [degC], its rise with height [K/m], its rise to the right [K/m]
AIR = ("temperature", "stratification", "side")


@dataclass(frozen=True)
class Film:
    """Heat that passes a surface: to the air, or to a place of another part all along it.

    Parameters
    ----------
    surface : str
        As ``part.surface``.
    coefficient : float
        [W/(m2 K)]
    to : str, optional
        Place on the other side, as ``part.patch``, or ``part`` alone if it is a lump; the room's air if not given.
    theta : str, optional
        Share of the film in force, if it is not always there whole.
    """

    surface: str
    coefficient: float
    to: str | None = None
    theta: str | None = None


@dataclass(frozen=True)
class Link:
    """A path of heat between two places.

    Parameters
    ----------
    a, b : str
        Places, as ``part.patch``, or ``part`` alone if it is a lump.
    conductance : float
        [W/K]
    theta : str, optional
        Share of the link in force, if it is not always there whole.
    """

    a: str
    b: str
    conductance: float
    theta: str | None = None


def lump(name: str, capacity: float, height: float = Air.REFERENCE_HEIGHT, side: float = 0.0) -> Part:
    """Return a part with one temperature, and a surface ``air`` of 1 m2: its film's coefficient is in W/K.

    Parameters
    ----------
    capacity : float
        [J/K]
    height, side : float
        Above the floor, and to the right of the middle [m].
    """
    one = np.ones(1)
    surface = Surface(csr_matrix([[1.0]]), one, one * (height - Air.REFERENCE_HEIGHT), one * side)
    return Part(name, csr_matrix([[float(capacity)]]), csr_matrix((1, 1)), {"air": surface}, {"": one}, {})


@dataclass(frozen=True, eq=False)
class FullModel:
    """C dT/dt = -(K0 + sum_j theta_j K_j) T + B u + (A0 + sum_j theta_j A_j) air.

    Parameters
    ----------
    capacity, conduction : csr_matrix of shape (n, n)
        C [J/K] and K0 [W/K], symmetric.
    conduction_theta : mapping of str to csr_matrix of shape (n, n)
        K_j [W/K] by the name of the share, symmetric.
    heat : ndarray of shape (n, n_inputs)
        B: where a watt of each input goes.
    air : ndarray of shape (n, 3)
        A0, see `AIR` [W/K, W m/K, W m/K].
    air_theta : mapping of str to ndarray of shape (n, 3)
        A_j by the name of the share.
    inputs : tuple of str
        Columns of `heat`.
    places : mapping of str to ndarray of shape (n,)
        Weights whose sum is 1: temperature there = weights @ T [degC].
    observables : mapping of str to ndarray of shape (n,)
        Displacement = row @ (T - 20 degC) [um, urad].
    """

    capacity: csr_matrix
    conduction: csr_matrix
    conduction_theta: Mapping[str, csr_matrix]
    heat: FloatArray
    air: FloatArray
    air_theta: Mapping[str, FloatArray]
    inputs: tuple[str, ...]
    places: Mapping[str, FloatArray]
    observables: Mapping[str, FloatArray]

    @property
    def size(self) -> int:
        """Number of temperatures."""
        return int(self.capacity.shape[0])

    @cached_property
    def one(self) -> FloatArray:
        """The field that is 1 everywhere, of shape (n,)."""
        return np.ones(self.size)

    def stiffness(self, theta: Mapping[str, float]) -> csr_matrix:
        """Return K [W/K] under these shares; those not named are 0."""
        return self.conduction + sum((theta[j] * k for j, k in self.conduction_theta.items() if theta.get(j)), start=0)

    def air_heat(self, theta: Mapping[str, float]) -> FloatArray:
        """Return A under these shares, of shape (n, 3)."""
        return self.air + sum((theta[j] * a for j, a in self.air_theta.items() if theta.get(j)), start=0.0)


class Assembly:
    """Parts that stand side by side in one vector of temperatures, to be joined.

    Raises
    ------
    InputError
        Two parts have one name.
    """

    def __init__(self, parts: Sequence[Part]) -> None:
        self.parts = {p.name: p for p in parts}
        if len(self.parts) != len(parts):
            raise InputError(f"two parts have the same name among {', '.join(p.name for p in parts)}")
        sizes = [p.capacity.shape[0] for p in parts]
        ends = np.cumsum(sizes)
        self.size = int(ends[-1])
        self._where = {p.name: slice(int(e) - n, int(e)) for p, n, e in zip(parts, sizes, ends, strict=True)}

    def place(self, name: str) -> FloatArray:
        """Return the weights of a place, ``part.patch`` or a lump's name, in the whole vector, of shape (n,)."""
        part, _, patch = name.partition(".")
        owner = self._part(part, name)
        if patch not in owner.patches:
            raise InputError(f"place {name!r}: part {part} has the patches {', '.join(owner.patches)}")
        return self.spread(part, owner.patches[patch])

    def observable(self, part: str, name: str) -> FloatArray:
        """Return a part's observable as a row over the whole vector, of shape (n,)."""
        owner = self._part(part, f"{part}.{name}")
        if name not in owner.observables:
            raise InputError(f"part {part} has no observable {name!r}; it has {', '.join(owner.observables)}")
        return self.spread(part, owner.observables[name])

    def spread(self, part: str, values: FloatArray) -> FloatArray:
        """Return a part's values in the whole vector, zero elsewhere."""
        whole = np.zeros(self.size)
        whole[self._where[part]] = values
        return whole

    def where(self, part: str) -> slice:
        """Return where a part's temperatures are in the whole vector."""
        return self._where[part]

    def join(
        self,
        films: Sequence[Film],
        links: Sequence[Link],
        inputs: Mapping[str, str],
        places: Mapping[str, str],
        observables: Mapping[str, FloatArray],
        thetas: Sequence[str],
    ) -> FullModel:
        """Join the parts.

        Parameters
        ----------
        observables : mapping of str to ndarray of shape (n,)
            Rows over the whole vector [um/K, urad/K].
        """
        conduction = {j: csr_matrix((self.size, self.size)) for j in (None, *thetas)}
        conduction[None] = sparse.block_diag([p.conduction for p in self.parts.values()], format="csr")
        air = {j: np.zeros((self.size, len(AIR))) for j in (None, *thetas)}
        for part in self.parts.values():
            for j, matrix in part.switched.items():
                if j not in conduction:
                    raise InputError(f"part {part.name}: switch {j!r} is not one of {', '.join(thetas) or 'none'}")
                conduction[j] = conduction[j] + self._block(part.name, matrix)
        values = [(f, f.coefficient) for f in films] + [(k, k.conductance) for k in links]
        for item, value in values:
            if item.theta not in conduction or not value >= 0:
                raise InputError(f"{item}: must not be negative, and its theta one of {', '.join(thetas) or 'none'}")
        for film in films:
            matrix, outside = self._film(film)
            conduction[film.theta] = conduction[film.theta] + matrix
            air[film.theta] += outside
        for link in links:
            difference = csr_matrix(self.place(link.a) - self.place(link.b))
            conduction[link.theta] = conduction[link.theta] + link.conductance * (difference.T @ difference)
        return FullModel(
            sparse.block_diag([p.capacity for p in self.parts.values()], format="csr"),
            conduction[None],
            {j: conduction[j] for j in thetas},
            np.array([self.place(p) for p in inputs.values()]).reshape(-1, self.size).T,
            air[None],
            {j: air[j] for j in thetas},
            tuple(inputs),
            {name: self.place(p) for name, p in places.items()},
            dict(observables),
        )

    def _film(self, film: Film) -> tuple[csr_matrix, FloatArray]:
        """Return what a film adds to K, and what the air puts in."""
        name, _, surface_name = film.surface.partition(".")
        owner = self._part(name, film.surface)
        if surface_name not in owner.surfaces:
            raise InputError(f"film {film.surface!r}: part {name} has the surfaces {', '.join(owner.surfaces)}")
        surface = owner.surfaces[surface_name]
        matrix = self._block(name, surface.mass)
        load = self.spread(name, surface.load)
        if film.to is None:
            outside = np.column_stack([load, self.spread(name, surface.height), self.spread(name, surface.side)])
            return film.coefficient * matrix, film.coefficient * outside
        # int (T - T_other)^2 dA: the other side is one temperature all along the surface.
        row, other = csr_matrix(load), csr_matrix(self.place(film.to))
        cross = row.T @ other
        return film.coefficient * (matrix - cross - cross.T + surface.load.sum() * (other.T @ other)), np.zeros(
            (self.size, len(AIR))
        )

    def _block(self, part: str, matrix: csr_matrix) -> csr_matrix:
        """Return a part's matrix in the whole one."""
        block, offset = matrix.tocoo(), self._where[part].start
        return csr_matrix((block.data, (block.row + offset, block.col + offset)), shape=(self.size, self.size))

    def _part(self, part: str, name: str) -> Part:
        if part not in self.parts:
            raise InputError(f"{name!r}: there is no part {part!r}; there are {', '.join(self.parts)}")
        return self.parts[part]
