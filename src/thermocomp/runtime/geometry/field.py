"""`ErrorField`: error of a machine anywhere in its work volume, in one thermal state."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from thermocomp.core.exceptions import InputError
from thermocomp.core.position import PositionModel
from thermocomp.core.profile import coordinates
from thermocomp.runtime.geometry import exact as transforms
from thermocomp.runtime.geometry.kinematics import Kinematics

FloatArray = NDArray[np.float64]

#: maximum number of iterations of a correction: each step leaves about 1e-4 of the previous change
_STEPS = 10


@dataclass(frozen=True, eq=False)
class ErrorField:
    """Error components of a machine in one thermal state, and their effect at the tool point (C-08).

    Parameters
    ----------
    kinematics : Kinematics
        Machine with its levers.
    uniform : ndarray of shape (32,)
        Components that are constant over the volume [um, urad], in the order of
        `thermocomp.core.components.COMPONENTS`; zero for those in `varying`.
    varying : tuple of (int, PositionModel, sequence of float)
        Index of each other component, its model, and the outputs of that model's models of time.
    """

    kinematics: Kinematics
    uniform: FloatArray
    varying: tuple[tuple[int, PositionModel, Sequence[float]], ...] = ()

    def components(self, points: ArrayLike) -> FloatArray:
        """Return the components at the given positions.

        Parameters
        ----------
        points : array-like of shape (..., 3)
            Positions of the axes [mm].

        Returns
        -------
        ndarray of shape (..., 32)
            In the order of `thermocomp.core.components.COMPONENTS` [um, urad].
        """
        places = check_finite("positions", points)
        xyz = coordinates(places)
        # component-major memory order: each component is computed at all points at once
        values = np.empty((len(self.uniform), *places.shape[:-1]))
        values[...] = self.uniform.reshape(-1, *(1,) * (places.ndim - 1))
        for k, model, factors in self.varying:
            values[k] = model.value(xyz, factors)
        return np.moveaxis(values, 0, -1)

    def error(self, points: ArrayLike, tool: ArrayLike | None = None, *, exact: bool = False) -> FloatArray:
        """Return the error of the tool tip.

        Parameters
        ----------
        points : array-like of shape (..., 3)
            Positions of the axes [mm].
        tool : array-like of shape (3,), optional
            Vector from the gauge point to the tip [mm]; default: that of the machine.

        Returns
        -------
        ndarray of shape (..., 3)
            Actual minus commanded, along X, Y, Z [um].
        """
        places = np.asarray(points, dtype=np.float64)
        values = self.components(places)
        if tool is not None:
            check_finite("tool", tool)
        if exact:
            return transforms.error(self.kinematics.machine, values, places, tool)
        return self.kinematics.synthesize(values, places, tool)[0]

    def tilt(self, points: ArrayLike) -> FloatArray:
        """Return the tilt of the tool relative to the workpiece, to first order.

        Parameters
        ----------
        points : array-like of shape (..., 3)
            Positions of the axes [mm].

        Returns
        -------
        ndarray of shape (..., 3)
            About X, Y, Z [urad].
        """
        places = np.asarray(points, dtype=np.float64)
        return self.kinematics.synthesize(self.components(places), places)[1]

    def correction(self, points: ArrayLike, tool: ArrayLike | None = None, *, tolerance: float = 0.01) -> FloatArray:
        """Return the value to add to the commanded position so that the tip is at its intended position.

        Only existing axes are corrected.

        Parameters
        ----------
        points : array-like of shape (..., 3)
            Commanded positions of the axes [mm].
        tool : array-like of shape (3,), optional
            Vector from the gauge point to the tip [mm]; default: that of the machine.
        tolerance : float
            Largest change in the last step of the iteration [um].

        Returns
        -------
        ndarray of shape (..., 3)
            Along X, Y, Z; zero along a non-existent axis [um].

        Notes
        -----
        At the position moved by c, the error is e(P + c), not e(P): c = -e(P + c) with exact transforms, solved by
        iteration. Along a non-existent axis c is zero in each step, and e(P + c) remains. Outside the travel the
        correction at its end is held: nothing was measured there, and levers and slopes must not be extrapolated.
        """
        machine = self.kinematics.machine
        places = np.clip(check_finite("positions", points), *self.kinematics.travel)
        there = np.array([float(a in machine.structure.axes) for a in "XYZ"])
        found = 0.0 - there * self.error(places, tool)
        for _ in range(_STEPS):
            before, found = found, 0.0 - there * self.error(places + 1e-3 * found, tool, exact=True)
            change = float(np.abs(found - before).max(initial=0.0))
            if change <= tolerance:
                return found
        raise InputError(
            f"machine {machine.name}: the correction still changes by {change:.3g} um after {_STEPS} "
            "steps: check the units of the components"
        )

    def sensitivity(self, point: ArrayLike, tool: ArrayLike | None = None) -> FloatArray:
        """Return the effect of one um or one urad of each component at the tool tip.

        Parameters
        ----------
        point : array-like of shape (3,)
            Positions of the axes [mm].
        tool : array-like of shape (3,), optional
            Vector from the gauge point to the tip [mm]; default: that of the machine.

        Returns
        -------
        ndarray of shape (32, 3)
            [um per um, um per urad]
        """
        return self.kinematics.sensitivity(
            check_finite("position", point), None if tool is None else check_finite("tool", tool)
        )


def check_finite(what: str, numbers: ArrayLike) -> FloatArray:
    """Return an array of positions or a tool [mm]; raise `InputError` if a number is not finite."""
    found = np.asarray(numbers, dtype=np.float64)
    if not np.isfinite(found).all():
        raise InputError(f"{what}: must be finite numbers, found {found[~np.isfinite(found)][0]}")
    return found
