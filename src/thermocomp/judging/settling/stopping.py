"""When a running test may stop: the steady state is predicted, with its uncertainty.

The best exponentials through a curve that has not settled say a final value, and by their standard errors seem sure of
it; others fit nearly as well and end elsewhere. So all pairs of time constants are tried, and each counts by how well
it fits (its likelihood, with as many independent rows as the residual leaves): mean and spread of their final values
are what is known of the steady state.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.exceptions import InputError
from thermocomp.judging.settling.settling import Phase, find_phases
from thermocomp.models.numerics.leastsquares import effective_sample_size
from thermocomp.recordings.cycles import SPLITS
from thermocomp.recordings.recording import Recording

FloatArray = NDArray[np.float64]

#: expanded uncertainty of the steady state with which a phase may end: this share of the largest change ...
SHARE = 0.1
#: ... but no less than this [um]
LEAST = 1.0
#: of a machine under its spindle's heat; slower is the room [s]
SLOWEST = 6 * 3600.0
#: fewer rows, or a shorter time, say nothing [s]
ROWS, SHORTEST = 10, 1800.0
_TAUS = 18
K = 2.0


@dataclass(frozen=True)
class SteadyState:
    """Estimated steady state of a curve that has not settled yet.

    Parameters
    ----------
    final : float
        Value it tends to, counted from the start of the phase [unit].
    uncertainty : float
        Expanded uncertainty of that (k = 2) [unit]; inf where too little was recorded.
    change : float
        Last value, counted from the start of the phase [unit].
    largest : float
        The largest change so far, in absolute value [unit].
    """

    final: float
    uncertainty: float
    change: float
    largest: float

    @property
    def limit(self) -> float:
        """Uncertainty that is enough [unit]."""
        return max(SHARE * max(self.largest, abs(self.final)), LEAST)

    @property
    def known(self) -> bool:
        """It is known well enough."""
        return self.uncertainty <= self.limit


@dataclass(frozen=True)
class Running:
    """Whether the phase of a running test may end.

    Parameters
    ----------
    phase : Phase
        The last one: a warm-up or a cool-down.
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
        """The steady state of all targets is known."""
        return all(state.known for _, state in self.states)

    def to_dict(self) -> dict[str, Any]:
        """Return it for a program: what ``--json`` prints."""
        return {
            "phase": self.phase.kind,
            "hours": self.seconds / 3600,
            "may_stop": self.may_stop,
            "states": [{"target": n, **asdict(s), "limit": s.limit, "known": s.known} for n, s in self.states],
        }

    @property
    def words(self) -> str:
        """Return the recommended action."""
        what = f"{self.phase.kind} {self.phase.number}, {self.seconds / 3600:.1f} h"
        if self.may_stop:
            then = (
                "stop the spindle"
                if self.phase.kind == "warm-up"
                else "the test may end, or continue to the next speed"
            )
            return f"{what}: the steady state is known; {then}"
        open_ = ", ".join(f"{n} (+-{s.uncertainty:.1f}, want {s.limit:.1f})" for n, s in self.states if not s.known)
        return f"{what}: continue; not known yet: {open_}"


def foretell(time: FloatArray, values: FloatArray) -> SteadyState:
    """Predict the steady state of a curve.

    Parameters
    ----------
    time : ndarray of shape (n_rows,)
        Since the start of the phase, rising [s].
    values : ndarray of shape (n_rows,)
        nan where missing.

    Returns
    -------
    SteadyState
    """
    there = np.isfinite(values)
    t, y = time[there], values[there]
    if not len(y):
        return SteadyState(float("nan"), float("inf"), float("nan"), 0.0)
    y = y - y[0]
    change, largest = float(y[-1]), float(np.abs(y).max())
    if len(y) < ROWS or t[-1] - t[0] < SHORTEST:
        return SteadyState(float("nan"), float("inf"), change, largest)
    if len(t) > 400:  # neighbouring rows say the same: means of blocks are as good
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
    own = np.array(errors) * len(t) / n * floor / max(len(t) - 5.0, 1.0)  # rows that depend on each other count less
    variance = float(likelihood @ ((np.array(finals) - final) ** 2 + own))
    return SteadyState(final, K * float(np.sqrt(variance)), change, largest)


def judge_running(recording: Recording, targets: Sequence[str]) -> Running:
    """Judge whether the last phase of a running test may end.

    Parameters
    ----------
    recording : Recording
        Recording of the test, up to now.
    targets : sequence of str
        Displacements.

    Returns
    -------
    Running

    Raises
    ------
    InputError
        The spindle has not started, nothing was recorded of it, or there is no such channel.
    """
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
