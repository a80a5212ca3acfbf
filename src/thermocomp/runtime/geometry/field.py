"""`ErrorField`: a machine's error anywhere in its work volume, in one thermal state."""

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

#: a correction that has not settled by then never will: a step leaves some 1e-4 of the one before
_STEPS = 10


@dataclass(frozen=True, eq=False)
class ErrorField:
    """Error components of a machine in one thermal state, and their effect at its tool point (C-08).

    Parameters
    ----------
    kinematics : Kinematics
        The machine and its levers.
    uniform : ndarray of shape (32,)
        Components that are the same in the whole volume, in the order of `thermocomp.core.components.COMPONENTS`
        [um, urad]; zero where one is in `varying`.
    varying : tuple of (int, PositionModel, sequence of float)
        Index of each other component, its model, and the outputs of that model's models of time.
    """

    kinematics: Kinematics
    uniform: FloatArray
    varying: tuple[tuple[int, PositionModel, Sequence[float]], ...] = ()

    def components(self, points: ArrayLike) -> FloatArray:
        """Return the components.

        Parameters
        ----------
        points : array-like of shape (..., 3)
            Positions of the axes [mm].

        Returns
        -------
        ndarray of shape (..., 32)
            In the order of `thermocomp.core.components.COMPONENTS` [um, urad].

        Raises
        ------
        InputError
            A position is not finite.
        """
        places = check_finite("positions", points)
        xyz = coordinates(places)
        # component by component in memory: each is computed at all points in one go
        values = np.empty((len(self.uniform), *places.shape[:-1]))
        values[...] = self.uniform.reshape(-1, *(1,) * (places.ndim - 1))
        for k, model, factors in self.varying:
            values[k] = model.value(xyz, factors)
        return np.moveaxis(values, 0, -1)

    def error(self, points: ArrayLike, tool: ArrayLike | None = None, *, exact: bool = False) -> FloatArray:
        """Return the error of the tool's tip.

        Parameters
        ----------
        points : array-like of shape (..., 3)
            Positions of the axes [mm].
        tool : array-like of shape (3,), optional
            From the gauge point to the tip [mm]; the machine's own if not given.
        exact : bool
            By homogeneous transforms instead of to first order in the angles.

        Returns
        -------
        ndarray of shape (..., 3)
            Actual minus commanded, along X, Y, Z [um].

        Raises
        ------
        InputError
            A position or the tool is not finite.
        """
        places = np.asarray(points, dtype=np.float64)
        values = self.components(places)
        if tool is not None:
            check_finite("tool", tool)
        if exact:
            return transforms.error(self.kinematics.machine, values, places, tool)
        return self.kinematics.synthesize(values, places, tool)[0]

    def tilt(self, points: ArrayLike) -> FloatArray:
        """Return the tilt of the tool against the workpiece, to first order.

        Parameters
        ----------
        points : array-like of shape (..., 3)
            Positions of the axes [mm].

        Returns
        -------
        ndarray of shape (..., 3)
            About X, Y, Z [urad].

        Raises
        ------
        InputError
            A position is not finite.
        """
        places = np.asarray(points, dtype=np.float64)
        return self.kinematics.synthesize(self.components(places), places)[1]

    def correction(self, points: ArrayLike, tool: ArrayLike | None = None, *, tolerance: float = 0.01) -> FloatArray:
        """Return the value to add to the commanded position so that the tip is at its intended position.

        Only axes that the machine has are corrected.

        Parameters
        ----------
        points : array-like of shape (..., 3)
            Commanded positions of the axes [mm].
        tool : array-like of shape (3,), optional
            From the gauge point to the tip [mm]; the machine's own if not given.
        tolerance : float
            Largest change in the last step of the iteration [um].

        Returns
        -------
        ndarray of shape (..., 3)
            Along X, Y, Z; zero along an axis that is not there [um].

        Raises
        ------
        InputError
            It does not settle within ten steps: the errors are no small ones. Or a position or the tool is not finite.

        Notes
        -----
        Moved by c the machine errs by e(P + c), not by e(P): c = -e(P + c), by exact transforms, solved by inserting.
        Along an axis that is not there nothing moves: c is zero in each step, and what is left is e(P + c). Beyond the
        travel the correction at its end is held: nothing was measured there, and levers and slopes must not continue.
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
            From the gauge point to the tip [mm]; the machine's own if not given.

        Returns
        -------
        ndarray of shape (32, 3)
            [um per um, um per urad]

        Raises
        ------
        InputError
            A position or the tool is not finite.
        """
        return self.kinematics.sensitivity(
            check_finite("position", point), None if tool is None else check_finite("tool", tool)
        )


def check_finite(what: str, numbers: ArrayLike) -> FloatArray:
    """Return an array of positions or a tool [mm]; raise `InputError` if a number in it is not finite."""
    found = np.asarray(numbers, dtype=np.float64)
    if not np.isfinite(found).all():
        raise InputError(f"{what}: must be finite numbers, found {found[~np.isfinite(found)][0]}")
    return found
