"""`Prints`: fingerprints of the training rows in a model file, used to recognise these rows in another file."""

import base64
import binascii
import zlib
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.arrays import FloatArray
from thermocomp.core.exceptions import SettingError

Marks = NDArray[np.uint32]

#: largest size of an unpacked excerpt [byte]
MOST_BYTES = 100_000


def pack_marks(marks: Marks) -> str:
    """Return 32-bit numbers as base64 text, lowest byte first."""
    return base64.b64encode(marks.astype("<u4").tobytes()).decode("ascii")


def unpack_marks(text: str) -> Marks:
    """Return the numbers in a text written by `pack_marks`."""
    try:
        content = base64.b64decode(text.encode("ascii"), validate=True)
    except (binascii.Error, UnicodeEncodeError) as e:
        raise SettingError(f"fingerprints {text[:12]!r}...: not base64 text: {e}") from e
    if len(content) % 4:
        raise SettingError(
            f"fingerprints {text[:12]!r}...: {len(content)} bytes are not a whole number of 32-bit numbers"
        )
    return np.frombuffer(content, dtype="<u4").astype(np.uint32)


def pack_values(values: FloatArray, step: float) -> str:
    """Return values, rounded to a step, as text: the step, a space, and their compressed differences."""
    differences = np.diff(np.rint(values / step), prepend=0.0)
    if np.abs(differences).max(initial=0.0) > np.iinfo(np.int16).max:
        return pack_values(values, 2.0 * step)
    packed = zlib.compress(differences.astype("<i2").tobytes(), 9)
    return f"{step:.9g} {base64.b64encode(packed).decode('ascii')}"


def unpack_values(text: str) -> FloatArray:
    """Return the values in a text written by `pack_values`."""
    step, _, packed = text.partition(" ")
    try:
        content = zlib.decompressobj().decompress(base64.b64decode(packed.encode("ascii"), validate=True), MOST_BYTES)
        if not 0.0 < (size := float(step)) < np.inf:
            raise SettingError(f"excerpt {text[:12]!r}...: step {step[:12]}: must be positive and finite")
        return np.cumsum(np.frombuffer(content, dtype="<i2"), dtype=np.float64) * size
    except (ValueError, zlib.error) as e:
        raise SettingError(f"excerpt {text[:12]!r}...: not a step and compressed values: {e}") from e


@dataclass(frozen=True)
class Excerpt:
    """Rows of training data at equal intervals, with the noise of the sensors.

    Parameters
    ----------
    row : int
        First row, counted through all tests.
    interval : float
        Time between two rows [s].
    values : dict of str to str
        Values per channel relative to the first row, the target first, as text of `pack_values`.
    """

    row: int
    interval: float
    values: dict[str, str]

    def __post_init__(self) -> None:
        if self.row < 0 or not 0 < self.interval < np.inf:
            raise SettingError(f"excerpt: row {self.row} and interval {self.interval} s must not be negative or zero")
        if not self.values:
            raise SettingError("excerpt: there are no values; expected those of at least one target")
        if len({len(unpack_values(text)) for text in self.values.values()}) > 1:
            raise SettingError(f"excerpt: {', '.join(self.values)} have different numbers of values")


@dataclass(frozen=True)
class Runs:
    """Fingerprints of runs of rows that are `stride` rows apart.

    Parameters
    ----------
    rows : str
        First row of each run, in ascending order, as text of `pack_marks`; counted through all tests.
    moving : str
        1 where target and an input change by more than their noise around the run, otherwise 0.
    marks : dict of str to str
        Hash of each run per channel, the target first; 0 where the channel has no information.
    """

    stride: int
    rows: str
    moving: str
    marks: dict[str, str]

    def __post_init__(self) -> None:
        if self.stride < 1:
            raise SettingError(f"fingerprints: stride of {self.stride} rows: must be 1 or more")
        if not self.marks:
            raise SettingError("fingerprints: there are none; expected those of at least one target")
        rows = unpack_marks(self.rows)
        if not (np.diff(rows.astype(np.int64)) > 0).all():
            raise SettingError(f"fingerprints: their row numbers must increase, found {rows.tolist()[:10]} ...")
        for name, text in (("moving", self.moving), *self.marks.items()):
            if (n := len(unpack_marks(text))) != len(rows):
                raise SettingError(
                    f"fingerprints: {n} values of {name} for {len(rows)} rows; expected one value per row"
                )


@dataclass(frozen=True)
class Prints:
    """Fingerprints of the training rows of a model; made by `thermocomp.recordings.fingerprints`.

    Parameters
    ----------
    interval : float
        Median time between two rows [s].
    learned : tuple of (int, int)
        First row, and the row after the last, of each training section; counted through all tests.
    steps : dict of str to float
        Rounding step of differences per channel, the target first [its unit].
    runs : tuple of Runs
        One per stride.
    excerpts : tuple of Excerpt
        Rows in which copies are recognised that were resampled, shifted in time, rounded or made noisy.
    curves : tuple of Excerpt
        Block means of training sections, whose interval is the width of a block [s] and whose step is the noise of a
        mean: for copies that were smoothed, thinned or made very noisy.
    """

    interval: float
    learned: tuple[tuple[int, int], ...]
    steps: dict[str, float]
    runs: tuple[Runs, ...]
    excerpts: tuple[Excerpt, ...] = ()
    curves: tuple[Excerpt, ...] = ()

    def __post_init__(self) -> None:
        if not 0 < self.interval < np.inf:
            raise SettingError(f"fingerprints: interval of {self.interval} s between rows: must be positive and finite")
        ends = [row for stretch in self.learned for row in stretch]
        if not ends or ends != sorted(ends) or ends[0] < 0 or any(a == b for a, b in self.learned):
            raise SettingError(
                f"fingerprints: training rows {self.learned}: expected sections (first, end) in increasing order"
            )
        for name, step in self.steps.items():
            if not 0 < step < np.inf:
                raise SettingError(f"fingerprints of {name}: resolution {step}: must be positive and finite")
        for run in self.runs:
            if list(run.marks) != list(self.steps):
                raise SettingError(
                    f"fingerprints: a run has those of {', '.join(run.marks)}; expected those of "
                    f"{', '.join(self.steps)}"
                )
            if (rows := unpack_marks(run.rows)).size and rows[-1] >= ends[-1]:
                raise SettingError(
                    f"fingerprints: a run begins at row {rows[-1]}, but the training rows end at row {ends[-1]}"
                )
