"""Learning curve: error on unseen thermal cycles as a function of the number of training cycles and speeds."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import numpy as np

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.exceptions import FitError
from thermocomp.core.messages import Message, join
from thermocomp.judging.budget import SHARE, WORTH, unseen_rms
from thermocomp.judging.choice import Progress
from thermocomp.judging.pieces import work_through
from thermocomp.judging.splits import Judging
from thermocomp.recordings.samples import Samples

#: random draws of training cycles, for each number and each unseen cycle
DRAWS = 2
#: maximum number of training set sizes
MOST_SIZES = 6
#: speeds that differ by less than this fraction of the highest are merged
_SAME_SPEED = 0.05


class Point(NamedTuple):
    """One model, trained on some cycles and judged on an unseen one."""

    learned: int  #: number of training cycles
    speeds: int  #: number of different speeds in the training cycles, 0 if none was recorded
    unseen: int  #: index of the judged block
    rms: tuple[float, ...]  #: of each target [um]; empty: the model could not be fitted


class Level(NamedTuple):
    """All models trained on the same number of cycles or speeds."""

    learned: int  #: number of training cycles, or speeds
    rms: float  #: over all unseen rows, as in `compare`, mean over the targets [um]
    error: float  #: standard error of it, from leaving out each block in turn [um]; nan with a single block


@dataclass(frozen=True, eq=False)
class LearningCurve:
    """Error on unseen thermal cycles as a function of the amount of training data.

    Parameters
    ----------
    none : float
        RMS without compensation over all unseen rows, mean over the targets [um].
    rows : ndarray of shape (n_blocks, n_targets)
        Number of judged rows of each block.
    """

    model: str
    points: tuple[Point, ...]
    none: float
    rows: FloatArray

    def by_cycles(self) -> tuple[Level, ...]:
        """Return the error for each number of training cycles."""
        return self._levels([p.learned for p in self.points])

    def by_speeds(self) -> tuple[Level, ...]:
        """Return the error for each number of training speeds, which varies at random between the draws."""
        return self._levels([p.speeds for p in self.points])

    def _levels(self, of: Sequence[int]) -> tuple[Level, ...]:
        found = []
        for number in sorted(set(of)):
            mine = [p for p, n in zip(self.points, of, strict=True) if n == number and p.rms]
            blocks = sorted({p.unseen for p in mine})
            if blocks:
                squares = [np.mean([np.square(p.rms) for p in mine if p.unseen == b], axis=0) for b in blocks]
                found.append(Level(number, *_pool(np.array(squares), self.rows[blocks])))
        return tuple(found)

    @property
    def last_gain(self) -> float:
        """Reduction of the error per cycle between the two largest numbers of training cycles [um]."""
        levels = self.by_cycles()[-2:]
        return (levels[0].rms - levels[1].rms) / (levels[1].learned - levels[0].learned) if len(levels) > 1 else 0.0

    @property
    def worth(self) -> float:
        """Reduction that makes a further cycle worthwhile [um]: as for a sensor, see `thermocomp.judging.budget`."""
        return min(WORTH, SHARE * self.none)

    @property
    def enough(self) -> bool:
        """True if a further cycle of the same kind is not worthwhile."""
        return self.last_gain <= self.worth

    @property
    def words(self) -> str:
        """Return the interpretation of the learning curve as text."""
        levels = self.by_cycles()
        first, last = levels[0], levels[-1]
        of = Message(
            "{first:.2f} um after {n} of the cycles, {last:.2f} after {of}",
            first=first.rms,
            n=first.learned,
            last=last.rms,
            of=last.learned,
        )
        n = last.learned - levels[-2].learned if len(levels) > 1 else 1
        less = self.last_gain >= 0
        slope = Message(
            "{which} reduced the error by {by:.2f} um" if less else "{which} increased the error by {by:.2f} um",
            which=Message("the last cycle") if n == 1 else Message("each of the last {n} cycles", n=n),
            by=abs(self.last_gain),
        )
        if last.rms >= self.none:
            none = ", {none:.2f} without compensation: the model does not help on unseen cycles"
            return join([of, Message(none, none=self.none)])
        more = Message(": the error is still decreasing, so more cycles of the same kind help")
        if self.enough:
            more = Message(
                ": more cycles of the same kind are not worth the time (a gain below {worth:.2f} um each)",
                worth=self.worth,
            )
        return join([of, "; ", slope, more])


def learning_curve(
    samples: Samples,
    judging: Judging,
    model: str = "averaged",
    *,
    jobs: int = 1,
    progress: Progress = lambda _, steps=1: None,  # noqa: ARG005
) -> LearningCurve:
    """Train on some cycles and judge on others: for each unseen cycle, train on 1, 2, ... of the remaining ones."""
    blocks = [split.judge for split in judging.splits]
    if len(blocks) < 3:
        raise FitError(f"a learning curve needs at least three thermal cycles or files; there are {len(blocks)}")
    rng = np.random.default_rng(0)
    pieces: list[tuple[int, list[int]]] = []
    for unseen in range(len(blocks)):
        others = np.delete(np.arange(len(blocks)), unseen)
        for size in _sizes(len(blocks)):
            drawn = [sorted(rng.choice(others, size, replace=False).tolist()) for _ in range(DRAWS)]
            pieces += [(unseen, own) for k, own in enumerate(drawn) if own not in drawn[:k]]
    points = []
    work = partial(_judged, samples, blocks, model)
    errors: list[str] = []
    for (unseen, own), found in zip(pieces, work_through(work, pieces, jobs=jobs), strict=True):
        progress(f"{model} from {len(own)} cycle(s)")
        errors += [found] if isinstance(found, str) else []
        speeds = _n_speeds(samples, np.any([blocks[k] for k in own], axis=0))
        points.append(Point(len(own), speeds, unseen, () if isinstance(found, str) else found))
    if len(errors) == len(points):
        raise FitError(f"no learning curve of {model}: {errors[0]}")
    rows = np.array([np.isfinite(samples.deviations[b]).sum(axis=0) for b in blocks], dtype=np.float64)
    none = np.array([np.nansum(np.square(samples.deviations[b]), axis=0) for b in blocks]) / np.maximum(rows, 1)
    return LearningCurve(model, tuple(points), _pool(none, rows)[0], rows)


def _pool(squares: FloatArray, rows: FloatArray) -> tuple[float, float]:
    """Return the RMS over all rows, mean over the targets, and its standard error from leaving out each block.

    Parameters
    ----------
    squares, rows : ndarray of shape (n_blocks, n_targets)
        Mean square of each block [um^2], and its number of rows.
    """
    total = np.where(rows > 0, rows * squares, 0.0)

    def pooled(own: BoolArray) -> float:
        return float(np.sqrt(total[own].sum(axis=0) / np.maximum(rows[own].sum(axis=0), 1)).mean())

    n = len(rows)
    parts = [pooled(np.arange(n) != k) for k in range(n)] if n > 1 else [np.nan]
    return pooled(np.ones(n, np.bool_)), float(np.std(parts) * np.sqrt(n - 1)) if n > 1 else float("nan")


def n_pieces(judging: Judging) -> int:
    """Return the maximum number of tasks of `learning_curve`."""
    n = len(judging.splits)
    return n * len(_sizes(n)) * DRAWS


def _sizes(blocks: int) -> list[int]:
    """Return the numbers of training blocks: from one to all but one."""
    return sorted({round(x) for x in np.linspace(1, blocks - 1, min(MOST_SIZES, blocks - 1))})


def _judged(
    samples: Samples, blocks: Sequence[BoolArray], model: str, piece: tuple[int, list[int]]
) -> tuple[float, ...] | str:
    unseen, own = piece
    learn = np.any([blocks[k] for k in own], axis=0)
    return tuple(unseen_rms(samples, model, learn, blocks[unseen]).tolist())


def _n_speeds(samples: Samples, rows: BoolArray) -> int:
    columns = [j for j, c in enumerate(samples.inputs) if c.quantity == "spindle_speed"]
    values = np.abs(samples.values[rows][:, columns])
    values = np.unique(values[np.isfinite(values) & (values > 0)])
    return int(np.count_nonzero(np.diff(values) > _SAME_SPEED * values[-1]) + 1) if values.size else 0
