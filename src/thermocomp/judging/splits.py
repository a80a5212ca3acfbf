"""Training and validation data: split by rows, time, thermal cycles, days or files, never at random."""

from dataclasses import dataclass

import numpy as np

from thermocomp.core.arrays import BoolArray, IntArray
from thermocomp.core.exceptions import InputError
from thermocomp.core.messages import Message
from thermocomp.recordings.samples import Samples

#: length of a day [s]
DAY = 86400.0
#: minimum number of rows of an informative cycle
MIN_ROWS = 20


@dataclass(frozen=True, eq=False)
class Split:
    """A training part and the unseen block judged with it.

    Parameters
    ----------
    block : str
        Name of the unseen block.
    learn, judge : ndarray of bool of shape (n_rows,)
    whole : bool
        The do-no-harm gate judges the block as a whole; otherwise each thermal cycle in it.
    stretch : bool
        The block continues the training data: its cycles are not independent of them.
    """

    block: str
    learn: BoolArray
    judge: BoolArray
    whole: bool = False
    stretch: bool = False

    @property
    def name(self) -> str:
        """Name of the left-out cycle, day or file, without its kind."""
        return self.block.partition(" ")[2]


@dataclass(frozen=True)
class Judging:
    """Scheme of one or more splits by which models are judged.

    Parameters
    ----------
    name : str
        Description for tables and reports.
    """

    name: str
    splits: tuple[Split, ...]


def by_rows(samples: Samples, train: float, test: float) -> Judging:
    """Train on the first fraction of the rows, judge on the next."""
    if not (0 < train < 1 and 0 < test < 1 and train + test <= 1 + 1e-9):
        raise InputError(f"split {train:g}/{test:g}: expected two shares between 0 and 1 whose sum is at most 1")
    own = np.flatnonzero(samples.cycle >= 0)  # without rows of earlier files that tests continue from
    n = len(own)
    ends = [*own.tolist(), len(samples)]
    first, stop = ends[round(n * train)], ends[min(n, round(n * (train + test)))]
    name = Message("first {train:.0%} of the rows for training, next {test:.0%} unseen", train=train, test=test)
    return _consecutive(name, len(samples), first, stop)


def by_time(samples: Samples, train_s: float, test_s: float) -> Judging:
    """Train on the first seconds of the recordings, judge on the next.

    Time is counted through consecutive tests, without the breaks between them.

    Parameters
    ----------
    train_s, test_s : float
        [s]
    """
    steps = samples.dt()
    earlier = samples.cycle < 0  # a file that the test continues from, and the break after it
    steps[np.isinf(steps) | earlier | np.roll(earlier, 1)] = 0.0
    elapsed = np.cumsum(steps)
    first, stop = (int(np.searchsorted(elapsed, t)) for t in (train_s, train_s + test_s))
    if not 0 < first < stop:
        raise InputError(
            f"split {train_s / 3600:g} h/{test_s / 3600:g} h: the recordings last only {elapsed[-1] / 3600:.2f} h in "
            "all"
        )
    name = Message("first {train:g} h for training, next {test:g} h unseen", train=train_s / 3600, test=test_s / 3600)
    return _consecutive(name, len(samples), first, stop)


def join_short_cycles(cycle: IntArray, test: IntArray, least: int = MIN_ROWS) -> list[IntArray]:
    """Return the thermal cycles for judging: cycles that are too short are joined to the previous cycle.

    Parameters
    ----------
    cycle, test : ndarray of int of shape (n_rows,)
        Cycle and test of each row, in chronological order.
    """
    found: list[IntArray] = []
    for k in np.unique(test):
        mine: list[list[int]] = []
        short = True  # True if the previous block is too short
        for c in np.unique(cycle[(test == k) & (cycle >= 0)]).tolist():
            n = int((cycle == c).sum())
            if mine and (short or n < least):
                mine[-1].append(c)
            else:
                mine.append([c])
            short = int(np.isin(cycle, mine[-1]).sum()) < least
        found += [np.array(m) for m in mine]
    return found


def name_cycles(samples: Samples, block: IntArray) -> str:
    """Return the name of a cycle, or of several consecutive cycles."""
    first, last = (samples.cycle_names[c] for c in (block[0], block[-1]))
    return first if len(block) == 1 else Message("{first} to {last}", first=first, last=last)


def leave_one_cycle_out(samples: Samples) -> Judging:
    """Judge on each thermal cycle in turn, train on all others; see `join_short_cycles`."""
    n = len(samples.cycle_names)
    if n < 2:
        raise InputError(
            "only one thermal cycle was found: leaving one out needs at least two. Give a spindle speed, a 'cycle' "
            "column or several files; or judge by time with --split 0.75/0.25"
        )
    blocks = join_short_cycles(samples.cycle, samples.test)
    joined = n - len(blocks) if 1 < len(blocks) < n else 0
    if len(blocks) == 1:  # all cycles joined: no training data would be left
        blocks = [np.array([k]) for k in range(n)]
    splits = []
    for block in blocks:
        mine = np.isin(samples.cycle, block)
        splits.append(Split(Message("cycle {name}", name=name_cycles(samples, block)), ~mine, mine))
    if joined:
        name = Message(
            "leave one thermal cycle out ({n} cycles, {joined} of them too short: left out with the previous one)",
            n=n,
            joined=joined,
        )
    else:
        name = Message("leave one thermal cycle out ({n} cycles)", n=n)
    return Judging(name, tuple(splits))


def leave_one_file_out(samples: Samples) -> Judging:
    """Judge on each file in turn, train on all others; each file is judged as a whole."""
    n = len(samples.test_names)
    if n < 2:
        raise InputError("leaving one file out needs at least two recordings, found one")
    splits = [
        Split(Message("file {name}", name=name), samples.test != k, samples.test == k, whole=True)
        for k, name in enumerate(samples.test_names)
    ]
    return Judging(Message("leave one file out ({n} files)", n=n), tuple(splits))


def leave_one_day_out(samples: Samples) -> Judging:
    """Judge on each day in turn, train on all others; a day with too few rows is joined to the previous day.

    A thermal cycle belongs to the day on which it begins, unless it is longer than a day: then it is split at midnight.
    """
    days = samples.days()
    unknown = np.isnat(days)
    if unknown.any():
        name = samples.test_names[samples.test[int(np.argmax(unknown))]]
        raise InputError(
            f"leaving one day out: {name} has no time stamps, so its days are unknown; write date and time into its "
            "time column, or leave out cycles or files"
        )
    own = samples.cycle >= 0  # without rows of earlier files that tests continue from
    for k in np.unique(samples.cycle[own]):
        rows = np.flatnonzero(samples.cycle == k)
        if samples.time[rows[-1]] - samples.time[rows[0]] <= DAY:
            days[rows] = days[rows[0]]
    names, day = np.unique(days, return_inverse=True)
    blocks = join_short_cycles(np.where(own, day, -1), np.zeros(len(samples), dtype=np.intp))
    if len(blocks) < 2:
        few = f"found {len(names)}" + f", of which one has at least {MIN_ROWS} rows" * (len(names) > 1)
        raise InputError(f"leaving one day out needs at least two days with {MIN_ROWS} rows each, {few}")
    splits = []
    for block in blocks:
        mine = np.isin(day, block) & own
        more = Message(" and {n} more", n=len(block) - 1) if len(block) > 1 else ""
        splits.append(Split(Message("day {day}{more}", day=str(names[block[0]]), more=more), ~mine, mine, whole=True))
    return Judging(Message("leave one day out ({n} days)", n=len(blocks)), tuple(splits))


def parse(text: str, samples: Samples) -> Judging:
    """Parse a split as written on the command line."""
    parts = text.split("/")
    try:
        if len(parts) == 2 and all(p.strip().endswith("h") for p in parts):
            hours = [float(p.strip().removesuffix("h")) for p in parts]
            return by_time(samples, hours[0] * 3600, hours[1] * 3600)
        if len(parts) == 2:
            return by_rows(samples, float(parts[0]), float(parts[1]))
    except ValueError:
        pass
    raise InputError(f"split {text!r}: write two shares of the rows such as 0.75/0.25, or hours such as 20h/8h")


def _consecutive(name: str, n: int, first: int, stop: int) -> Judging:
    rows = np.arange(n)
    if first < 1 or stop <= first:
        raise InputError(f"{name}: no row is left for training, or none for validation ({n} rows in all)")
    return Judging(
        name,
        (
            Split(
                Message("rows {first}-{last}", first=first, last=stop - 1),
                rows < first,
                (rows >= first) & (rows < stop),
                stretch=True,
            ),
        ),
    )
