"""The do-no-harm gate: a model that is not surely better than no compensation is refused."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import stats

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]

#: a stretch shorter than this says nothing about a cycle
MIN_ROWS = 20
#: confidence of the bound
LEVEL = 0.95


@dataclass(frozen=True)
class CycleVerdict:
    """What the gate found in one thermal cycle, or in the part of it that was judged.

    Parameters
    ----------
    cycle : str
    rms, none_rms : float
        Of the residual, and without compensation [um].
    ratio : float
        RMS over RMS without compensation.
    ratio_bound : float
        Upper bound of the ratio by block bootstrap.
    """

    cycle: str
    rms: float
    none_rms: float
    ratio: float
    ratio_bound: float

    @property
    def passed(self) -> bool:
        """True if the model is better than none even at the bound."""
        return self.ratio_bound < 1.0


@dataclass(frozen=True)
class Verdict:
    """The gate's decision over several cycles.

    Parameters
    ----------
    cycles : tuple of CycleVerdict
    level : float
        Confidence of the bounds.
    unit : str
        Of the deviations.
    least : int
        Rows that a cycle must have.
    """

    cycles: tuple[CycleVerdict, ...]
    level: float
    unit: str = "um"
    least: int = MIN_ROWS

    @property
    def accepted(self) -> bool:
        """True if every cycle passed."""
        return bool(self.cycles) and all(c.passed for c in self.cycles)

    @property
    def word(self) -> str:
        """``accepted`` or ``refused``."""
        return "accepted" if self.accepted else "refused"

    @property
    def reason(self) -> str:
        """Why, in one sentence, by the worst cycle."""
        if not self.cycles:
            return "nothing was judged"
        worst = max(self.cycles, key=lambda c: c.ratio_bound)
        if not np.isfinite(worst.ratio_bound) and not np.isfinite(worst.rms):
            return f"fewer than {self.least} rows of {worst.cycle} to judge on"
        figures = f"RMS {worst.rms:.2f} {self.unit}, {worst.none_rms:.2f} {self.unit} without compensation"
        if self.accepted:
            return f"better than none wherever it was judged; least in {worst.cycle}: {figures}"
        if worst.ratio >= 1:
            return f"worse than none in {worst.cycle}: {figures}"
        return (
            f"not surely better than none in {worst.cycle}: {figures}, "
            f"ratio up to {worst.ratio_bound:.2f} at about {self.level:.0%}"
        )


def judge(
    measured: FloatArray,
    predicted: FloatArray,
    segments: Sequence[tuple[str, BoolArray]],
    *,
    level: float = LEVEL,
    draws: int = 1000,
    seed: int = 0,
    least: int = MIN_ROWS,
    unit: str = "um",
) -> Verdict:
    """Decide whether a model may be used.

    In every segment the ratio of the RMS with and without compensation is bounded from above by a circular block
    bootstrap (Politis, Romano 1992): rows of a thermal cycle depend on each other, so whole stretches are drawn. They
    are four times as long as the correlation time of the squared residual or drift, at most a quarter of the segment;
    few stretches widen the bound as few degrees of freedom do (Student's t).

    Parameters
    ----------
    measured, predicted : ndarray of shape (n_rows,)
        Deviations [um].
    segments : sequence of (name, ndarray of bool of shape (n_rows,))
        The unseen cycles.
    level : float
        Confidence of the bound.
    draws : int
        Number of bootstrap draws.
    seed : int
        Of the draws.
    least : int
        Fewer rows than this say nothing about a cycle.
    unit : str
        Of the deviations.

    Returns
    -------
    Verdict
    """
    found = []
    for name, rows in segments:
        if rows.sum() < least:
            # said, not skipped: so short a stretch proves nothing, and what is not proven is refused
            found.append(CycleVerdict(name, float("nan"), float("nan"), float("nan"), float("inf")))
            continue
        residual, none = (measured - predicted)[rows] ** 2, measured[rows] ** 2
        bound = _ratio_bound(residual, none, level, draws, np.random.default_rng(seed))
        rms, none_rms = float(np.sqrt(residual.mean())), float(np.sqrt(none.mean()))
        found.append(CycleVerdict(name, rms, none_rms, rms / none_rms if none_rms > 0 else np.inf, bound))
    return Verdict(tuple(found), level, unit, least)


def _ratio_bound(residual: FloatArray, none: FloatArray, level: float, draws: int, rng: np.random.Generator) -> float:
    n = len(residual)
    if not residual.any():
        return 0.0 if none.any() else np.inf
    if not none.any():
        return np.inf
    length = max(_block_length(residual), _block_length(none))
    blocks = -(-n // length)
    starts = rng.integers(0, n, (draws, blocks))
    sums = []
    for squares in (residual, none):
        running = np.concatenate([[0.0], np.cumsum(np.concatenate([squares, squares[:length]]))])
        sums.append((running[starts + length] - running[starts]).sum(axis=1))
    with np.errstate(divide="ignore"):
        ratios = 0.5 * (np.log(sums[0]) - np.log(sums[1]))
    found = 0.5 * np.log(residual.sum() / none.sum())
    excess = float(np.quantile(ratios, level, method="higher")) - found
    freedom = n / length - 1
    few = stats.t.ppf(level, freedom) / stats.norm.ppf(level) * np.sqrt((freedom + 1) / freedom)
    return float(np.exp(found + few * max(excess, 0.0)))


def _block_length(squares: FloatArray) -> int:
    """Return four times the lag at which the autocorrelation falls below 1/e, at most a quarter of the rows."""
    n = len(squares)
    centred = squares - squares.mean()
    longest = max(1, n // 4)
    power = np.abs(np.fft.rfft(centred, 2 * n)) ** 2
    correlation = np.fft.irfft(power)[: longest + 1]
    if correlation[0] <= 0:
        return longest
    below = np.flatnonzero(correlation < correlation[0] / np.e)
    return min(longest, 4 * int(below[0])) if below.size else longest
