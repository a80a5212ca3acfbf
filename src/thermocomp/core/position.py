"""`PositionModel`: an error that varies along an axis and with the thermal state (Chen 1996, Eq. 2 and 3)."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.bounds import DEGREE, POSITION, check_count, check_finite, check_name
from thermocomp.core.exceptions import SettingError
from thermocomp.core.model import ErrorModel
from thermocomp.core.profile import Coordinates, Numbers, Profile, clamp, coordinates
from thermocomp.core.provenance import Provenance

FloatArray = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class PositionModel:
    """Frozen model of a position-dependent component: profile + offset + slopes (C-04, C-05).

    ``d(x, y, z, t) = f_g(x, y, z) + k_0(t) + k_1(t) q + k_2(t) q^2 + ...`` with q = (p - reference position) in metres,
    p being the position of this axis: k_i in um/m^i or urad/m^i (E-C6). Chen has no k_0 and measures p from the zero of
    the axis.

    Parameters
    ----------
    target : str
        Component that is modelled, such as ``EYY``.
    axis : {'X', 'Y', 'Z'}
        Axis of the position p.
    travel : tuple of float
        Range in which the slopes were measured [mm]; outside, the value at the nearer end applies.
    reference_position : float
        Position at which q is zero [mm].
    profile : Profile or None
        f_g, in the reference state; None: zero.
    offset : ErrorModel or None
        k_0 [unit]; None: zero.
    slopes : tuple of ErrorModel
        k_1, k_2 ... [unit/m, unit/m^2 ...].
    """

    target: str
    unit: Literal["um", "urad"]
    axis: str
    travel: tuple[float, float]
    reference_position: float = 0.0
    profile: Profile | None = None
    offset: ErrorModel | None = None
    slopes: tuple[ErrorModel, ...] = ()
    provenance: Provenance | None = None

    def __post_init__(self) -> None:
        check_name("target", self.target)
        owner = f"model of {self.target}"
        if self.unit not in ("um", "urad"):
            raise SettingError(f"{owner}: unit {self.unit!r}: expected um or urad")
        if self.axis not in ("X", "Y", "Z"):
            raise SettingError(f"{owner}: axis {self.axis!r}: expected X, Y or Z")
        check_finite(owner, POSITION, travel=self.travel, reference_position=self.reference_position)
        if not self.travel[0] < self.travel[1]:
            raise SettingError(f"{owner}: travel {self.travel} mm must increase")
        check_count(owner, DEGREE, slopes=self.slopes)
        for power, model in self._by_power:
            wanted = slope_unit(self.unit, power)
            if model.unit != wanted:
                raise SettingError(f"{owner}: k_{power} is in {model.unit}, must be in {wanted}")

    @cached_property
    def _by_power(self) -> tuple[tuple[int, ErrorModel], ...]:
        offset = ((0, self.offset),) if self.offset is not None else ()
        return (*offset, *enumerate(self.slopes, start=1))

    @property
    def models(self) -> tuple[ErrorModel, ...]:
        """Models that depend on time only: the offset, if any, then the slopes."""
        return tuple(m for _, m in self._by_power)

    def taken(self, by: str | None) -> "PositionModel":
        """Return this model with the approval of a person if it is unproven; see `ErrorModel.taken`."""
        offset = None if self.offset is None else self.offset.taken(by)
        return replace(self, offset=offset, slopes=tuple(m.taken(by) for m in self.slopes))

    @property
    def powers(self) -> tuple[int, ...]:
        """Power of q by which the output of each of `models` is multiplied."""
        return tuple(k for k, _ in self._by_power)

    def ranges(self) -> tuple[tuple[str, str, tuple[float, float]], ...]:
        """Return the valid ranges: profile or slope, axis, start and end [mm]."""
        profile = self.profile.ranges() if self.profile is not None else {}
        slopes = (("slope", self.axis, self.travel),) if self.slopes else ()
        return (*(("profile", name, known) for name, known in profile.items()), *slopes)

    def at(self, points: FloatArray, factors: FloatArray) -> FloatArray:
        """Return the error at points, in one thermal state.

        Parameters
        ----------
        points : ndarray of shape (..., 3)
            x, y, z [mm].
        factors : ndarray of shape (n_models,)
            Outputs of `models`, in their order.

        Returns
        -------
        ndarray of shape (...,)
            [unit]
        """
        values = self.value(coordinates(points), factors.tolist())
        return np.asarray(values) if points.ndim == 1 else np.broadcast_to(values, points.shape[:-1]).copy()

    def value(self, xyz: Coordinates, factors: Sequence[float]) -> Numbers:
        """Return the error at points prepared by `coordinates`; a float if it is the same everywhere."""
        k_0, *others = factors if self.offset is not None else (0.0, *factors)
        value = k_0 if self.profile is None else self.profile.value(xyz) + k_0
        if not self.slopes:
            return value
        q = 1e-3 * (clamp(xyz["XYZ".index(self.axis)], *self.travel) - self.reference_position)
        thermal: Numbers = 0.0
        for _, k in zip(reversed(self.slopes), reversed(others), strict=True):
            thermal = (thermal + k) * q
        return value + thermal


def slope_unit(unit: str, power: int) -> str:
    """Return the unit of k_i: um, um/m, um/m^2 ..."""
    return unit + ("", "/m")[power] if power < 2 else f"{unit}/m^{power}"
