"""`Positioning`: deviations of an axis at its targets, repeatedly approached from one or both directions."""

from dataclasses import dataclass

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.exceptions import InputError


@dataclass(frozen=True, eq=False)
class Positioning:
    """A positioning test of one axis in one thermal state.

    Parameters
    ----------
    axis : str
        Axis, such as ``Y``; empty if unknown.
    state : str
        Thermal state, such as ``cold`` or ``after 4 h``; empty if there is only one.
    unit : {'um', 'urad'}
        Unit of the deviations.
    positions : ndarray of shape (n_targets,)
        Target positions, increasing [mm].
    up : ndarray of shape (n_runs, n_targets)
        Deviations, actual minus target, for approaches in the positive direction [unit]; one run gives no
        repeatability.
    down : ndarray of shape (n_runs, n_targets) or None
        The same in the negative direction; None for a unidirectional test. A unidirectional test in the negative
        direction has `up` = None.
    source : str
        File from which it was read.

    Raises
    ------
    InputError
        Fewer than two targets, no run, targets that do not increase, arrays of different shapes, or a number that is
        not finite.
    """

    axis: str
    state: str
    unit: str
    positions: FloatArray
    up: FloatArray | None
    down: FloatArray | None = None
    source: str = ""

    def __post_init__(self) -> None:
        where = ": ".join(part for part in (self.source, self.axis, self.state) if part) or "positioning"
        if len(self.positions) < 2:
            raise InputError(
                f"{where}: {len(self.positions)} target; positioning needs at least 2, ISO 230-2 requires 5"
            )
        if not (np.diff(self.positions) > 0).all():
            raise InputError(f"{where}: target positions must increase and differ, found {self.positions.tolist()} mm")
        if not self.directions:
            raise InputError(f"{where}: expected deviations of at least one direction")
        for name, deviations in self.directions.items():
            if deviations.ndim != 2 or deviations.shape[1] != len(self.positions):
                raise InputError(
                    f"{where}: deviations in direction {name} have the shape {deviations.shape}; expected (runs, "
                    f"{len(self.positions)} targets)"
                )
            if len(deviations) < 1:
                raise InputError(
                    f"{where}: no run in direction {name}; ISO 230-2 requires 5 runs, or one over more than 2 m"
                )
            if not np.isfinite(deviations).all():
                raise InputError(f"{where}: a deviation in direction {name} must be finite; remove NaN and infinity")

    @property
    def directions(self) -> dict[str, FloatArray]:
        """Deviations of the measured directions of approach, denoted ``+`` and ``-``."""
        return {name: d for name, d in (("+", self.up), ("-", self.down)) if d is not None}
