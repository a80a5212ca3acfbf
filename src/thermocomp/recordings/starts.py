"""Initial thermal state of a test: cold, continued from an earlier file, re-zeroed on a warm machine, or known zero."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import datetime
from itertools import pairwise
from typing import Literal

import numpy as np

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Channel
from thermocomp.core.messages import Message, join
from thermocomp.core.zero import Zeroing, first_rows, mean_over_time
from thermocomp.recordings.recording import Recording

Word = Literal["cold", "continued", "rezeroed", "known"]
#: description of each initial state, for tables and errors
WORDS: dict[Word, str] = {
    "cold": Message("zeroed at its start, at rest"),
    "continued": Message("continues from an earlier file, and uses the zero of that file"),
    "rezeroed": Message("displacements and temperatures are relative to its start, on a machine that may be warm"),
    "known": Message("uses a known zero"),
}
#: a displacement whose initial value is smaller than this was zeroed there [um or urad]
NEAR = 3.0
#: or smaller than this fraction of its range
SHARE = 0.1
#: or smaller than this multiple of its noise
LOUD = 6.0
#: a file follows another if it starts at most this long after its end [s], or ten of its intervals
SOON = 600.0


@dataclass(frozen=True, eq=False)
class Start:
    """Initial thermal state of a test.

    Parameters
    ----------
    word : {'cold', 'continued', 'rezeroed', 'known'}
        See `WORDS`.
    why : str
        Origin of the state: specified, or determined from the recording.
    earlier : tuple of Recording
        Earlier recordings of the machine, in chronological order.
    gap : float or None
        Time from the last row of each earlier recording to the first row of the next one [s]; None: from their time
        stamps, or else one sampling interval.
    zero : mapping of str to float
        Temperatures that count as zero, by channel [degC]; for ``known``; empty if the temperatures are absolute.

    Raises
    ------
    InputError
        The word is inconsistent with the other parameters.

    Examples
    --------
    >>> from thermocomp import Start, simulate
    >>> (monday,) = simulate("hwang")
    >>> print(Start("continued", earlier=(monday,), gap=600.0).told("tuesday"))  # starts=... of compare, fit, assess
    tuesday: continued from hwang (continues from an earlier file, and uses the zero of that file); stated
    >>> Start("known", zero={"t_bed_front_C": 20.0}).content("tuesday")["zero_degC"]
    {'t_bed_front_C': 20.0}
    """

    word: Word = "cold"
    why: str = Message("stated")
    earlier: tuple[Recording, ...] = ()
    gap: float | None = None
    zero: Mapping[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if self.word not in WORDS:
            raise InputError(f"start {self.word!r}: must be one of {', '.join(WORDS)}")
        if self.word == "continued" and not self.earlier:
            raise InputError(
                "start 'continued' needs the earlier file: name it with --continues, or earlier= in Python"
            )
        if self.earlier and self.word not in ("continued", "rezeroed"):
            raise InputError(
                f"an earlier file was given, but the start is {self.word!r}: expected 'continued' or 'rezeroed'"
            )
        if self.zero and self.word != "known":
            raise InputError(f"temperatures of the zero were given, but the start is {self.word!r}: expected 'known'")
        if self.gap is not None and not 0 < self.gap < np.inf:
            raise InputError(f"a gap of {self.gap:g} s between two files: must be more than 0 s")

    def content(self, name: str) -> dict[str, object]:
        """Return the initial thermal state as a dict of plain values, for JSON."""
        return {
            "recording": name,
            "start": self.word,
            "how_known": self.why,
            "earlier": [r.source or r.name for r in self.earlier],
            "zero_degC": dict(self.zero),
        }

    def told(self, name: str) -> str:
        """Return the state as text, such as ``b: continued from a (continues from an earlier file ...); stated``."""
        names = ", ".join(r.name for r in self.earlier)
        before = Message(" from {names}", names=names) if self.word == "continued" else ""
        after = Message("; what went before: {names}", names=names) if self.earlier and not before else ""
        return Message(
            "{name}: {word}{before} ({what}{after}); {why}",
            name=name,
            word=Message(self.word),
            before=before,
            what=WORDS[self.word],
            after=after,
            why=self.why,
        )


#: zeroed at rest at its start, whatever the initial displacement
COLD = Start()


def bridge_files(start: Start, recording: Recording) -> tuple[Start, FloatArray]:
    """Determine the time between the files of a test.

    Returns
    -------
    begins : ndarray of shape (n_earlier + 1,)
        Start time of each earlier file and of the recording itself, relative to the first file [s].
    """
    begins, words, every = [0.0], [], (*start.earlier, recording)
    for before, after in pairwise(every):
        stamped = _between(before, after)
        if start.gap is not None:
            gap, how = start.gap, Message("stated")
        elif stamped is not None:
            gap, how = stamped, Message("by their time stamps")
        else:
            gap = before.sampling_interval
            how = Message("assumed to be one sampling interval: no time stamps, no stated gap")
        if not gap > 0:
            raise InputError(
                f"{after.name} cannot continue {before.name}: by their time stamps it begins {-gap:g} s before the end "
                f"of {before.name}"
            )
        begins.append(begins[-1] + float(before.time[-1]) + gap)
        words.append(
            Message(
                "{after} begins {gap:g} s after the end of {before} ({how})",
                after=after.name,
                gap=gap,
                before=before.name,
                how=how,
            )
        )
    why = join([start.why, *words], "; ")
    return replace(start, why=why), np.array(begins)


def find_starts(
    recordings: Sequence[Recording],
    targets: Sequence[Channel],
    *,
    zeroing: Zeroing = Zeroing(),
    absolute: bool = False,
) -> tuple[Start, ...]:
    """Determine the initial states of tests.

    A displacement that starts near zero was zeroed there. If it does not, and continues from the end of the previous
    file (by time stamps), the test continues that file. Other cases are undetermined.
    """
    if absolute:
        return tuple(Start("known", Message("temperatures are absolute")) for _ in recordings)
    found = {id(r): _found(r, [o for o in recordings if o is not r], targets, zeroing) for r in recordings}

    def whole(start: Start) -> Start:
        """Return a start with the complete history: the recording it continues may itself be a continuation."""
        before = found[id(start.earlier[0])] if start.earlier else start
        return replace(start, earlier=(*whole(before).earlier, *start.earlier)) if before.earlier else start

    return tuple(whole(found[id(r)]) for r in recordings)


def find_resting_rows(recording: Recording, zeroing: Zeroing) -> BoolArray:
    """Return the rows in which the spindle is known to be stopped.

    Returns
    -------
    ndarray of bool of shape (n_rows,)
    """
    speed = next((c for c in recording.channels if c.name == recording.aliases.get(zeroing.speed, zeroing.speed)), None)
    if speed is None:
        return np.zeros(len(recording), dtype=np.bool_)
    return np.array([zeroing.stands(v) for v in recording.table[speed.name].tolist()], dtype=np.bool_)


def find_zeroing(recording: Recording) -> Zeroing:
    """Return the usual averaging times of the zero, with the spindle speed of a recording if a model can name it."""
    with suppress(InputError):
        return Zeroing(speed=recording.speed.name if recording.speed is not None else "")
    return Zeroing()


def turns(recording: Recording, zeroing: Zeroing) -> bool:
    """Return whether the spindle is known to turn in the first row."""
    name = recording.aliases.get(zeroing.speed, zeroing.speed)
    known = name in recording.table.columns and bool(np.isfinite(recording.table[name].iloc[0]))
    return known and not find_resting_rows(recording, zeroing)[0]


def is_far(recording: Recording, name: str, zeroing: Zeroing) -> bool:
    """Return whether a displacement does not start near zero: see `NEAR`, `SHARE` and `LOUD`."""
    return abs(level(recording, name, zeroing)) > _tolerance(recording, name)


def level(recording: Recording, name: str, zeroing: Zeroing, *, end: bool = False) -> float:
    """Return the value of a channel at its start (mean over its first rows) or at its end (last row)."""
    values = recording.table[recording.channel(name).name].to_numpy(dtype=np.float64)
    there = np.flatnonzero(np.isfinite(values))
    if not there.size:
        return float("nan")
    if end:
        return float(values[there[-1]])
    window = there[: first_rows(zeroing, recording.time[there], find_resting_rows(recording, zeroing)[there])[0]]
    return float(mean_over_time(recording.time[window], values[window]))


def _found(recording: Recording, others: Sequence[Recording], targets: Sequence[Channel], zeroing: Zeroing) -> Start:
    levels = {c.name: level(recording, c.name, zeroing) for c in targets}
    far = {c.name: c for c in targets if is_far(recording, c.name, zeroing)}
    before = next((o for o in others if 0 < (_between(o, recording) or 0.0) <= _soon(o)), None)
    if not far:
        if before is not None and any(
            abs(level(before, c.name, zeroing, end=True)) > _tolerance(before, c.name) for c in targets
        ):
            again = Message("it follows {before} by its time stamps, and begins near zero again", before=before.name)
            return Start("rezeroed", again)
        turning = [Message(", although the spindle turns in the first row")] * turns(recording, zeroing)
        return Start("cold", join([Message("assumed, since the displacements begin near zero"), *turning]))
    if before is not None and all(
        abs(level(before, n, zeroing, end=True) - levels[n]) <= max(_tolerance(recording, n), _tolerance(before, n))
        for n in far
    ):
        return Start("continued", Message("by time stamps and displacements"), (before,))
    name = max(far, key=lambda n: abs(levels[n]))
    raise InputError(
        f"{recording.source or recording.name}: {name} begins at {levels[name]:.1f} {far[name].unit}, so it was not "
        "zeroed at the start of this file. Specify its start: --continues EARLIER (the file before it), --start "
        "rezeroed (relative to its start), --start known --zero FILE or t1_C=20.1,t2_C=20.4 (the temperatures of its "
        "zero), or --start cold if it was nevertheless zeroed at rest. In Python: starts=Start(...)"
    )


def _tolerance(recording: Recording, name: str) -> float:
    values = recording.table[recording.channel(name).name].to_numpy(dtype=np.float64)
    values = values[np.isfinite(values)]
    if len(values) < 2:
        return NEAR
    # for normal noise: the standard deviation of a difference is sqrt(2) times that of the noise
    noise = float(np.median(np.abs(np.diff(values)))) / 0.954
    return max(NEAR, SHARE * float(np.ptp(values)), LOUD * noise)


def _between(before: Recording, after: Recording) -> float | None:
    """Return the time from the end of one recording to the start of another [s]; None without time stamps."""
    if not (before.start and after.start):
        return None
    stamps = [datetime.fromisoformat(r.start) for r in (before, after)]
    if (stamps[0].tzinfo is None) != (stamps[1].tzinfo is None):
        return None
    return (stamps[1] - stamps[0]).total_seconds() - float(before.time[-1])


def _soon(recording: Recording) -> float:
    return max(SOON, 10 * recording.sampling_interval)
