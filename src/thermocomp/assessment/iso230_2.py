"""Positioning of a linear axis after ISO 230-2: accuracy A, repeatability R, systematic E, M, reversal B.

The text of ISO 230-2:2014 was not at hand; quantities, symbols and formulas are the standard's as textbooks and control
makers quote them. With x[i, j] the deviation at target i in run j of one direction (up or down), n runs:

- mean unidirectional deviation ``x_up[i]``, and ``s_up[i]``, its estimator of the standard deviation (n - 1);
- mean bidirectional deviation ``x[i] = (x_up[i] + x_down[i]) / 2``;
- reversal ``B[i] = x_up[i] - x_down[i]``, ``B = max |B[i]|``, and its mean;
- repeatability ``R_up[i] = 4 s_up[i]``, ``R[i] = max(2 s_up[i] + 2 s_down[i] + |B[i]|, R_up[i], R_down[i])``, ``R``
  their largest;
- systematic deviation ``E_up = max x_up - min x_up``; ``E`` the same over both directions; ``M = max x - min x``;
- accuracy ``A_up = max(x_up + 2 s_up) - min(x_up - 2 s_up)``; ``A`` the same over both directions.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermocomp.recording.positioning import Positioning

FloatArray = NDArray[np.float64]

#: what ISO 230-2 wants of an axis up to 2 m: targets per axis, targets per metre, runs in each direction
TARGETS, TARGETS_PER_METRE, RUNS = 5, 5.0, 5


@dataclass(frozen=True, eq=False)
class Direction:
    """One direction of approach.

    Parameters
    ----------
    mean, s : ndarray of shape (n_targets,)
        Mean deviation and estimator of the standard deviation at each target [unit].
    """

    mean: FloatArray
    s: FloatArray

    @property
    def repeatability(self) -> FloatArray:
        """R of each target: 4 s, (n_targets,)."""
        return 4.0 * self.s

    @property
    def R(self) -> float:  # noqa: N802 - the standard's symbol
        """Unidirectional repeatability: the largest."""
        return float(self.repeatability.max())

    @property
    def E(self) -> float:  # noqa: N802 - the standard's symbol
        """Unidirectional systematic positioning error."""
        return float(np.ptp(self.mean))

    @property
    def A(self) -> float:  # noqa: N802 - the standard's symbol
        """Unidirectional accuracy."""
        return float((self.mean + 2.0 * self.s).max() - (self.mean - 2.0 * self.s).min())


@dataclass(frozen=True, eq=False)
class PositioningResult:
    """A positioning test, evaluated. All in the unit of its deviations; nan or None where it takes both directions.

    Parameters
    ----------
    test : Positioning
    up, down : Direction or None
    mean : ndarray of shape (n_targets,) or None
        Mean bidirectional deviation.
    reversal : ndarray of shape (n_targets,) or None
        B of each target.
    repeatability : ndarray of shape (n_targets,) or None
        Bidirectional R of each target.
    A, E, M, R, B, B_mean : float
        Of the axis.
    notes : tuple of str
        Where the test falls short of what the standard wants.
    """

    test: Positioning
    up: Direction | None
    down: Direction | None
    mean: FloatArray | None
    reversal: FloatArray | None
    repeatability: FloatArray | None
    A: float
    E: float
    M: float
    R: float
    B: float
    B_mean: float
    notes: tuple[str, ...]

    @property
    def directions(self) -> dict[str, Direction]:
        """Directions that were measured, by ``+`` and ``-``."""
        return {name: d for name, d in (("+", self.up), ("-", self.down)) if d is not None}

    @property
    def axis_values(self) -> dict[str, float]:
        """Values of the axis by symbol; an arrow tells the direction. Without those that were not measured."""
        values: dict[str, float] = {}
        for name, arrow in (("+", "↑"), ("-", "↓")):
            if name in self.directions:
                d = self.directions[name]
                values |= {f"A{arrow}": d.A, f"E{arrow}": d.E, f"R{arrow}": d.R}
        if self.mean is not None:
            values |= {"A": self.A, "E": self.E, "M": self.M, "R": self.R, "B": self.B, "mean B": self.B_mean}
        return values


def assess(test: Positioning) -> PositioningResult:
    """Evaluate a positioning test in one thermal state.

    Parameters
    ----------
    test : Positioning

    Returns
    -------
    PositioningResult
    """
    up, down = (None if d is None else Direction(d.mean(axis=0), d.std(axis=0, ddof=1)) for d in (test.up, test.down))
    nan = float("nan")
    if up is None or down is None:
        return PositioningResult(test, up, down, None, None, None, nan, nan, nan, nan, nan, nan, _shortfalls(test))
    mean, reversal = (up.mean + down.mean) / 2.0, up.mean - down.mean
    both = 2.0 * up.s + 2.0 * down.s + np.abs(reversal)
    repeatability = np.maximum.reduce([both, up.repeatability, down.repeatability])
    means = np.concatenate([up.mean, down.mean])
    twice = 2.0 * np.concatenate([up.s, down.s])
    return PositioningResult(
        test=test,
        up=up,
        down=down,
        mean=mean,
        reversal=reversal,
        repeatability=repeatability,
        A=float((means + twice).max() - (means - twice).min()),
        E=float(np.ptp(means)),
        M=float(np.ptp(mean)),
        R=float(repeatability.max()),
        B=float(np.abs(reversal).max()),
        B_mean=float(reversal.mean()),
        notes=_shortfalls(test),
    )


def _shortfalls(test: Positioning) -> tuple[str, ...]:
    notes = []
    n, length = len(test.positions), float(np.ptp(test.positions)) / 1e3
    # the travel is not known: what lies between the first and the last target is
    wanted = max(TARGETS, int(np.ceil(TARGETS_PER_METRE * length)))
    if n < wanted:
        notes.append(f"{n} targets over {length:g} m; ISO 230-2 wants at least {wanted}")
    for name, deviations in test.directions.items():
        if len(deviations) < RUNS:
            notes.append(f"{len(deviations)} runs in direction {name}; ISO 230-2 wants {RUNS}")
    if len(test.directions) == 1:
        notes.append("approached from one direction only: reversal and bidirectional values are unknown")
    return tuple(notes)
