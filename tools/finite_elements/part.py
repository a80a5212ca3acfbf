"""What a part of the machine is once it is cut into finite elements: sparse matrices and named rows of numbers."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from thermocomp.core.exceptions import InputError

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Surface:
    """A surface that gives heat to the air round it.

    With a convection h [W/(m2 K)] it adds ``h mass`` to the conduction and ``h load`` times the air to the heat.

    Parameters
    ----------
    mass : csr_matrix of shape (n, n)
        Integral of phi_i phi_j over the surface [m2].
    load : ndarray of shape (n,)
        Integral of phi_i [m2].
    height, side : ndarray of shape (n,)
        Integral of phi_i times height above `Air.REFERENCE_HEIGHT`, and times distance to the right of the machine's
        middle [m3].
    """

    mass: csr_matrix
    load: FloatArray
    height: FloatArray
    side: FloatArray

    @property
    def area(self) -> float:
        """Of the surface [m2]."""
        return float(self.load.sum())


@dataclass(frozen=True, eq=False)
class Part:
    """A part: C dT/dt = -K T + heat, and what its temperatures displace.

    Parameters
    ----------
    capacity : csr_matrix of shape (n, n)
        Symmetric, positive definite [J/K].
    conduction : csr_matrix of shape (n, n)
        Symmetric, of an insulated part: its rows sum to zero [W/K].
    patches : mapping of str to ndarray of shape (n,)
        Weights w that sum to 1. The temperature there is ``w @ T``, heat put in there is spread as w, and a link of
        conductance g to another part carries g times the difference of the two temperatures.
    observables : mapping of str to ndarray of shape (n,)
        Displacement per temperature [um/K] or tilt [urad/K]: ``row @ (T - 20 degC)``.
    switched : mapping of str to csr_matrix of shape (n, n)
        Conduction that is in force by the share of the switch of that name, such as ``rotation`` [W/K].

    Raises
    ------
    InputError
        Shapes differ, a patch does not sum to 1, or conduction makes heat.
    """

    name: str
    capacity: csr_matrix
    conduction: csr_matrix
    surfaces: Mapping[str, Surface]
    patches: Mapping[str, FloatArray]
    observables: Mapping[str, FloatArray]
    switched: Mapping[str, csr_matrix] = field(default_factory=dict)

    def __post_init__(self) -> None:
        n = self.capacity.shape[0]
        for what, matrix in (
            ("capacity", self.capacity),
            ("conduction", self.conduction),
            *((f"surface {k}", s.mass) for k, s in self.surfaces.items()),
            *((f"switched {k}", m) for k, m in self.switched.items()),
        ):
            if matrix.shape != (n, n):
                raise InputError(f"part {self.name}: {what} is of shape {matrix.shape}, want {(n, n)}")
        for what, row in (
            *((f"patch {k}", w) for k, w in self.patches.items()),
            *((f"observable {k}", w) for k, w in self.observables.items()),
            *((f"load of surface {k}", s.load) for k, s in self.surfaces.items()),
            *((f"height of surface {k}", s.height) for k, s in self.surfaces.items()),
            *((f"side of surface {k}", s.side) for k, s in self.surfaces.items()),
        ):
            if row.shape != (n,) or not np.isfinite(row).all():
                raise InputError(f"part {self.name}: {what} is of shape {row.shape}, want {n} finite numbers")
        for what, row in self.patches.items():
            if abs(row.sum() - 1.0) > 1e-9:
                raise InputError(f"part {self.name}: patch {what} sums to {row.sum():.6g}, want 1")
        for what, matrix in (("conduction", self.conduction), *self.switched.items()):
            scale = abs(matrix).max() if matrix.nnz else 0.0
            if np.abs(matrix @ np.ones(n)).max(initial=0.0) > 1e-9 * scale:
                raise InputError(f"part {self.name}: {what} makes heat: its rows do not sum to zero")

    @property
    def n(self) -> int:
        """Number of temperatures."""
        return int(self.capacity.shape[0])
