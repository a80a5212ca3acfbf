"""Positioning of a linear axis according to ISO 230-2: accuracy A, repeatability R, systematic E, M, reversal B.

The text of ISO 230-2:2014 was not available; quantities, symbols and formulas are those of the standard as quoted by
textbooks and control makers. With x[i, j] the deviation at target i in run j of one direction (up or down), n runs:

- mean unidirectional deviation ``x_up[i]``, and ``s_up[i]``, its estimator of the standard deviation (n - 1);
- mean bidirectional deviation ``x[i] = (x_up[i] + x_down[i]) / 2``;
- reversal ``B[i] = x_up[i] - x_down[i]``, ``B = max |B[i]|``, and its mean;
- repeatability ``R_up[i] = 4 s_up[i]``, ``R[i] = max(2 s_up[i] + 2 s_down[i] + |B[i]|, R_up[i], R_down[i])``, ``R``
  the largest of them;
- systematic deviation ``E_up = max x_up - min x_up``; ``E`` the same over both directions; ``M = max x - min x``;
- accuracy ``A_up = max(x_up + 2 s_up) - min(x_up - 2 s_up)``; ``A`` the same over both directions.

An axis over 2 m is approached once in each direction, every 250 mm on average: this gives E, M and B; s, R and A need
at least two runs and are omitted. The measurement uncertainty, which the 2014 edition requires to be stated with the
results, cannot be determined from the deviations and is not reported here.
"""

from dataclasses import dataclass

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.volumetric.positioning import Positioning

#: ISO 230-2 requirements for an axis up to 2 m: targets per axis, targets per metre, runs in each direction
TARGETS, TARGETS_PER_METRE, RUNS = 5, 5.0, 5
#: travel above which an axis is long: one run in each direction; mean interval of its targets [mm]
LONG, LONG_INTERVAL = 2000.0, 250.0
#: note required in every report of these values
UNCERTAINTY = "The measurement uncertainty is not given: ISO 230-2:2014 requires it to be stated with these values."


@dataclass(frozen=True, eq=False)
class Direction:
    """Results for one direction of approach.

    Parameters
    ----------
    mean, s : ndarray of shape (n_targets,)
        Mean deviation and estimator of the standard deviation at each target [unit]; s, and with it R and A, is nan for
        a single run.
    """

    mean: FloatArray
    s: FloatArray

    @property
    def repeatability(self) -> FloatArray:
        """Unidirectional repeatability R at each target: 4 s, (n_targets,)."""
        return 4.0 * self.s

    @property
    def R(self) -> float:  # noqa: N802 - symbol of the standard
        """Unidirectional repeatability: the largest R of the targets."""
        return float(self.repeatability.max())

    @property
    def E(self) -> float:  # noqa: N802 - symbol of the standard
        """Unidirectional systematic positioning error."""
        return float(np.ptp(self.mean))

    @property
    def A(self) -> float:  # noqa: N802 - symbol of the standard
        """Unidirectional accuracy."""
        return float((self.mean + 2.0 * self.s).max() - (self.mean - 2.0 * self.s).min())


@dataclass(frozen=True, eq=False)
class PositioningResult:
    """An evaluated positioning test, in the unit of its deviations.

    Values that need both directions, or several runs in each, are nan or None if these are missing.

    Parameters
    ----------
    mean : ndarray of shape (n_targets,) or None
        Mean bidirectional deviation at each target.
    reversal : ndarray of shape (n_targets,) or None
        B of each target.
    repeatability : ndarray of shape (n_targets,) or None
        Bidirectional R of each target.
    A, E, M, R, B, B_mean : float
        Characteristic values of the axis.
    notes : tuple of str
        Deviations of the test from the requirements of the standard.
    """

    test: Positioning
    up: Direction | None
    down: Direction | None
    mean: FloatArray | None = None
    reversal: FloatArray | None = None
    repeatability: FloatArray | None = None
    A: float = float("nan")
    E: float = float("nan")
    M: float = float("nan")
    R: float = float("nan")
    B: float = float("nan")
    B_mean: float = float("nan")
    notes: tuple[str, ...] = ()

    @property
    def directions(self) -> dict[str, Direction]:
        """Measured directions of approach, denoted ``+`` and ``-``."""
        return {name: d for name, d in (("+", self.up), ("-", self.down)) if d is not None}

    @property
    def axis_values(self) -> dict[str, float]:
        """Measured values of the axis by symbol; an arrow shows the direction."""
        values: dict[str, float] = {}
        for name, arrow in (("+", "↑"), ("-", "↓")):
            if name in self.directions:
                d = self.directions[name]
                values |= {f"A{arrow}": d.A, f"E{arrow}": d.E, f"R{arrow}": d.R}
        if self.mean is not None:
            values |= {"A": self.A, "E": self.E, "M": self.M, "R": self.R, "B": self.B, "mean B": self.B_mean}
        return {symbol: v for symbol, v in values.items() if np.isfinite(v)}


def assess(test: Positioning) -> PositioningResult:
    """Evaluate a positioning test in one thermal state."""
    up, down = (None if d is None else _direction(d) for d in (test.up, test.down))
    if up is None or down is None:
        return PositioningResult(test=test, up=up, down=down, notes=_shortfalls(test))
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
        repeatability=repeatability if np.isfinite(repeatability).all() else None,
        A=float((means + twice).max() - (means - twice).min()),
        E=float(np.ptp(means)),
        M=float(np.ptp(mean)),
        R=float(repeatability.max()),
        B=float(np.abs(reversal).max()),
        B_mean=float(reversal.mean()),
        notes=_shortfalls(test),
    )


def _direction(deviations: FloatArray) -> Direction:
    mean = deviations.mean(axis=0)
    return Direction(mean, deviations.std(axis=0, ddof=1) if len(deviations) > 1 else np.full(len(mean), np.nan))


def _shortfalls(test: Positioning) -> tuple[str, ...]:
    notes = []
    # the travel is unknown: the distance between the first and the last target is used
    n, travel = len(test.positions), float(np.ptp(test.positions))
    long = travel > LONG
    if long:
        wanted = int(np.ceil(travel / LONG_INTERVAL - 1e-9)) + 1
    else:
        wanted = max(TARGETS, int(np.ceil(TARGETS_PER_METRE * travel / 1e3)))
    if n < wanted:
        notes.append(f"{n} targets over {travel / 1e3:g} m; ISO 230-2 requires at least {wanted}")
    for name, deviations in test.directions.items():
        runs = len(deviations)
        if runs == 1:
            notes.append(
                f"a single run in direction {name}: s, R and A need at least two"
                + ("; ISO 230-2 requires no more over 2 m" if long else f", ISO 230-2 requires {RUNS}")
            )
        elif runs < RUNS and not long:
            notes.append(f"{runs} runs in direction {name}; ISO 230-2 requires {RUNS}")
    if len(test.directions) == 1:
        notes.append("approached from one direction only: reversal and bidirectional values are unknown")
    return tuple(notes)
