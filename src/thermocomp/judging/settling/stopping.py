"""Stopping of a running test: prediction of the steady state and its uncertainty.

The best exponentials through a curve that has not settled give a final value with a small standard error; others fit
nearly as well and end elsewhere. Therefore all pairs of time constants are tried and weighted by the quality of their
fit (likelihood, with the effective sample size of the residual): the mean and the spread of their final values are the
estimate of the steady state.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import combinations
from typing import Any

import numpy as np

from thermocomp.core.arrays import FloatArray
from thermocomp.core.exceptions import InputError
from thermocomp.judging.settling.settling import Phase, find_phases
from thermocomp.models.numerics.leastsquares import effective_sample_size
from thermocomp.recordings.cycles import SPLITS
from thermocomp.recordings.recording import Recording

#: expanded uncertainty of the steady state at which a phase may end: this fraction of the largest change ...
SHARE = 0.1
#: ... but at least this [um]
LEAST = 1.0
#: largest time constant of a machine heated by its spindle [s]; slower changes are due to the room
SLOWEST = 6 * 3600.0
#: minimum number of rows, and minimum duration, for an estimate [s]
ROWS, SHORTEST = 10, 1800.0
_TAUS = 18
K = 2.0


@dataclass(frozen=True)
class SteadyState:
    """Estimated steady state of a curve that has not settled yet.

    Parameters
    ----------
    final : float
        Value that it approaches, relative to the start of the phase [unit].
    uncertainty : float
        Expanded uncertainty of the final value (k = 2) [unit]; inf if too little was recorded.
    change : float
        Last value, relative to the start of the phase [unit].
    largest : float
        Largest change so far, in absolute value [unit].
    """

    final: float
    uncertainty: float
    change: float
    largest: float

    @property
    def limit(self) -> float:
        """Largest uncertainty of the steady state with which the phase may end [unit]."""
        return max(SHARE * max(self.largest, abs(self.final)), LEAST)

    @property
    def known(self) -> bool:
        """True if the steady state is known with sufficient accuracy."""
        return self.uncertainty <= self.limit


@dataclass(frozen=True)
class Running:
    """Decision whether the phase of a running test may end.

    Parameters
    ----------
    phase : Phase
        Last phase of the test: a warm-up or a cool-down.
    seconds : float
        Duration so far [s].
    states : tuple of (str, SteadyState)
        State of each target, by name.
    """

    phase: Phase
    seconds: float
    states: tuple[tuple[str, SteadyState], ...]

    @property
    def may_stop(self) -> bool:
        """True if the steady state of all targets is known."""
        return all(state.known for _, state in self.states)

    def to_dict(self) -> dict[str, Any]:
        """Return all results as a dict, as printed by ``--json``."""
        return {
            "phase": self.phase.kind,
            "hours": self.seconds / 3600,
            "may_stop": self.may_stop,
            "states": [{"target": n, **asdict(s), "limit": s.limit, "known": s.known} for n, s in self.states],
        }

    @property
    def words(self) -> str:
        """Return the recommended action as text: end the phase, or continue."""
        what = f"{self.phase.kind} {self.phase.number}, {self.seconds / 3600:.1f} h"
        if self.may_stop:
            then = (
                "stop the spindle"
                if self.phase.kind == "warm-up"
                else "the test may end, or continue to the next speed"
            )
            return f"{what}: the steady state is known accurately enough; {then}"
        open_ = ", ".join(f"{n} (+-{s.uncertainty:.1f}, required {s.limit:.1f})" for n, s in self.states if not s.known)
        return f"{what}: continue; the steady state is not known accurately enough of {open_}"


def foretell(time: FloatArray, values: FloatArray) -> SteadyState:
    """Predict the steady state of a curve.

    Parameters
    ----------
    time : ndarray of shape (n_rows,)
        Time since the start of the phase, in ascending order [s].
    values : ndarray of shape (n_rows,)
        nan where missing.
    """
    there = np.isfinite(values)
    t, y = time[there], values[there]
    if not len(y):
        return SteadyState(float("nan"), float("inf"), float("nan"), 0.0)
    y = y - y[0]
    change, largest = float(y[-1]), float(np.abs(y).max())
    if len(y) < ROWS or t[-1] - t[0] < SHORTEST:
        return SteadyState(float("nan"), float("inf"), change, largest)
    if len(t) > 400:  # neighbouring rows are almost equal: means of blocks are as good
        block = np.arange(len(t)) * 400 // len(t)
        count = np.bincount(block)
        t, y = np.bincount(block, t) / count, np.bincount(block, y) / count
    rising = -np.expm1(-t[:, None] / np.geomspace(max(float(np.diff(t).min()), 60.0), SLOWEST, _TAUS))
    squares, finals, errors, residuals = [], [], [], []
    for pair in combinations(range(_TAUS), 2):
        design = np.column_stack([np.ones(len(t)), rising[:, pair]])
        q, r = np.linalg.qr(design)
        weights = np.linalg.lstsq(r, q.T @ y, rcond=None)[0]
        residuals.append(y - design @ weights)
        squares.append(float(residuals[-1] @ residuals[-1]))
        finals.append(float(weights.sum()))
        errors.append(float(np.sum(np.linalg.lstsq(r.T, np.ones(3), rcond=None)[0] ** 2)))
    best = int(np.argmin(squares))
    n = effective_sample_size(residuals[best])
    floor = max(squares[best], 1e-18)
    likelihood = np.exp(-0.5 * n * np.log(np.maximum(squares, floor) / floor))
    likelihood /= likelihood.sum()
    final = float(likelihood @ finals)
    own = np.array(errors) * len(t) / n * floor / max(len(t) - 5.0, 1.0)  # correlated rows count less
    variance = float(likelihood @ ((np.array(finals) - final) ** 2 + own))
    return SteadyState(final, K * float(np.sqrt(variance)), change, largest)


def judge_running(recording: Recording, targets: Sequence[str]) -> Running:
    """Judge whether the last phase of a running test may end."""
    phases = find_phases(recording, SPLITS)
    if not phases:
        raise InputError(
            f"{recording.name}: the spindle has not run for {SPLITS / 60:g} min yet, or its speed was not recorded: "
            "there is no run or stop to judge"
        )
    last = phases[-1]
    rows = slice(last.start, last.end + 1)
    time = recording.time[rows] - recording.time[last.start]
    values = recording.values([recording.channel(name) for name in targets])[rows]
    states = tuple((name, foretell(time, v)) for name, v in zip(targets, values.T, strict=True))
    return Running(last, float(time[-1]), states)
