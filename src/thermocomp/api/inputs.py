"""Input data: recordings, files and tables, and their preparation."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from thermocomp.api.keywords import SILENT, Listener
from thermocomp.core.exceptions import InputError
from thermocomp.core.messages import Message
from thermocomp.core.zero import Zeroing
from thermocomp.judging import splits
from thermocomp.judging.splits import Judging
from thermocomp.recordings.checks.offsets import compare_starts
from thermocomp.recordings.checks.quality import check
from thermocomp.recordings.checks.sound import drop_unsound
from thermocomp.recordings.joining import suggest_join
from thermocomp.recordings.readers import mapping as mappings
from thermocomp.recordings.readers.mending import read_or_offer
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.recordings.starts import Start
from thermocomp.recordings.tilts import with_tilts

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

#: one or several tests
Given = Recording | str | Path | pd.DataFrame | Sequence["Recording | str | Path | pd.DataFrame"]
LeaveOne = Literal["cycle", "day", "file"]
#: initial thermal state of all recordings or of each one; None: determined from the recordings
Starts = Start | Sequence[Start] | None


def read(path: str | Path, mapping: str | Path | mappings.Mapping | None = None) -> Recording:
    r"""Read one test from a file.

    Parameters
    ----------
    path : str or Path
        A file of a logger or program, such as .csv, .xlsx, .ods, .parquet, .tdms, .h5 or .mat.
    mapping : str, Path or Mapping, optional
        TOML mapping file, or the mapping read from one: role and unit of columns whose headings do not give them.

    Returns
    -------
    Recording

    Raises
    ------
    RecordingError, UnitError
        See `thermocomp.recordings.readers.recordings.read`; a note of the error suggests a mapping if one would help.

    Examples
    --------
    >>> from pathlib import Path
    >>> import thermocomp as tc
    >>> lines = ["time [min];Lager [degC];Z [um]", "0;20,0;0,0", "1;20,6;2,1", "2;21,1;3,8"]
    >>> _ = Path("monday.csv").write_text("\n".join(lines))
    >>> tc.read("monday.csv").to_frame()
       time_s  Lager_C  Z_um
    0     0.0     20.0   0.0
    1    60.0     20.6   2.1
    2   120.0     21.1   3.8
    """
    return read_or_offer(path, mappings.read_mapping(mapping) if isinstance(mapping, str | Path) else mapping)


def recordings_of(given: Given, mapping: str | Path | mappings.Mapping | None = None) -> list[Recording]:
    """Return a list of recordings from recordings, files or tables.

    Parameters
    ----------
    given : Recording, str, Path, DataFrame, or sequence of them
        A table is converted by `Recording.from_dataframe`.
    mapping : str, Path or Mapping, optional
        TOML mapping file for files: role and unit of each column.

    Returns
    -------
    list of Recording

    Raises
    ------
    InputError
        An item has another type, or the sequence is empty.
    """
    several = [given] if isinstance(given, Recording | str | Path | pd.DataFrame) else list(given)
    if not several:
        raise InputError("no recording given: give a Recording, a path or a DataFrame")
    found = []
    for k, one in enumerate(several, start=1):
        if isinstance(one, Recording):
            found.append(one)
        elif isinstance(one, str | Path):
            found.append(read(one, mapping))
        elif isinstance(one, pd.DataFrame):
            found.append(Recording.from_dataframe(one, name=f"table {k}" if len(several) > 1 else "table"))
        else:
            raise InputError(f"{type(one).__name__} is not a recording: give a Recording, a path or a DataFrame")
    return found


def starts_of(starts: Starts, recordings: Sequence[Recording]) -> tuple[Start, ...] | None:
    """Return the initial thermal state of each recording; None: determined from the recordings.

    Parameters
    ----------
    starts : Start or sequence of Start, optional
        One start for all recordings, or one each.
    recordings : sequence of Recording

    Returns
    -------
    tuple of Start or None

    Raises
    ------
    InputError
        The number of starts differs from the number of recordings, a recording continues from itself, or a single
        ``continued`` start is given for several recordings.
    """
    if starts is None:
        return None
    each = (starts,) * len(recordings) if isinstance(starts, Start) else tuple(starts)
    if len(each) != len(recordings):
        raise InputError(
            f"starts: {len(each)} given for {len(recordings)} recording(s): give one for each, or one for all"
        )
    if isinstance(starts, Start) and starts.earlier and len(recordings) > 1:
        raise InputError(
            f"starts: {len(recordings)} recordings cannot all continue from the same files: give one start for each"
        )
    for start, r in zip(each, recordings, strict=True):
        if r.fingerprint in (e.fingerprint for e in start.earlier):
            raise InputError(f"starts: {r.name} cannot continue from itself: name the previous file in earlier=")
    return each


@dataclass(frozen=True, eq=False)
class Prepared:
    """Prepared data for judging.

    Parameters
    ----------
    tests : tuple of Recording
    samples : Samples
        Rows of the tests, without rows in which a channel is in trouble.
    judging : Judging
        Training and validation rows.
    trouble : list of str
        Data-quality problems of the recordings.
    """

    tests: tuple[Recording, ...]
    samples: Samples
    judging: Judging
    trouble: list[str]


def prepare(
    tests: Sequence[Recording],
    targets: str | Sequence[str] | None,
    inputs: str | Sequence[str] | None = None,
    *,
    absolute: bool = False,
    starts: Starts = None,
    zero_over: float = Zeroing.at_rest,
    tilt: Sequence[str] | None = None,
    split: str | None = None,
    leave_one: LeaveOne | None = None,
    jobs: int = -1,
    judged: bool = True,
    listener: Listener = SILENT,
) -> Prepared:
    """Prepare recordings for judging.

    Parameters
    ----------
    tests : sequence of Recording
    targets : str or sequence of str, optional
        Displacement channels to predict. Default: all of the first recording.
    inputs : str or sequence of str, optional
    absolute : bool
    starts : Start or sequence of Start, optional
        Initial thermal state of the recordings; see `starts_of`.
    zero_over : float
        Duration at the start of each test, with the spindle stopped, over which the zero is averaged [s].
    tilt : sequence of str, optional
        Tilts to predict as well; see `thermocomp.recordings.tilts.with_tilts`.
    split, leave_one : str, optional
        Data that is judged; see `judging_of`.
    jobs : int
        Number of parallel processes.
    judged : bool
        False: nothing is judged unless `split` or `leave_one` is given; a single thermal cycle is then enough.
    listener : Listener
        Receives the data-quality problems of the recordings before the work.

    Returns
    -------
    Prepared
    """
    if jobs == 0:
        raise InputError("jobs 0: give a number of processes, or -1 for all cores")
    if command := suggest_join(tests):
        raise InputError(command)
    named = [targets] if isinstance(targets, str) else targets
    if named is None:
        named = [c.name for c in tests[0].displacements]
    if tilt:
        tests, names = with_tilts(tests, tilt)
        named = [*named, *names]
    chosen = [inputs] if isinstance(inputs, str) else inputs
    speed = tests[0].speed
    zeroing = Zeroing(zero_over, min(zero_over, Zeroing.otherwise), speed.name if speed is not None else "")
    begun = starts_of(starts, tests)
    samples = drop_unsound(stack(tests, named, chosen, rezero=not absolute, starts=begun, zeroing=zeroing), tests)
    wanted = judged or split is not None or leave_one is not None
    judging = judging_of(samples, split=split, leave_one=leave_one) if wanted else Judging("", ())
    trouble = trouble_of(tests)
    if chosen is None and (others := tests[0].of_quantity("spindle_speed")[1:]):
        left, taken = ", ".join(c.name for c in others), tests[0].of_quantity("spindle_speed")[0].name
        trouble.append(
            f"{tests[0].name}: {left} left out: of several spindle speeds only the first, {taken}, is an input; "
            "name the inputs to use others"
        )
    listener.warn(trouble)
    return Prepared(tuple(tests), samples, judging, trouble)


def judging_of(samples: Samples, *, split: str | None = None, leave_one: LeaveOne | None = None) -> Judging:
    """Return the training and the validation rows.

    Parameters
    ----------
    samples : Samples
    split : str, optional
        Chronological train/test split: fractions of the rows such as ``0.75/0.25``, or durations such as ``20h/8h``.
    leave_one : {'cycle', 'day', 'file'}, optional
        Unit left out of fitting and judged in turn: each thermal cycle (default), each day, or each recording.

    Returns
    -------
    Judging

    Raises
    ------
    InputError
        Both are given, or there are too few cycles, days or files.
    """
    if split is not None and leave_one is not None:
        raise InputError("split and leave_one exclude each other: choose one")
    if split is not None:
        return splits.parse(split, samples)
    ways = {
        "cycle": splits.leave_one_cycle_out,
        "day": splits.leave_one_day_out,
        "file": splits.leave_one_file_out,
    }
    if leave_one is not None and leave_one not in ways:
        raise InputError(f"leave_one {leave_one!r}: expected 'cycle', 'day' or 'file'")
    return ways[leave_one or "cycle"](samples)


def trouble_of(recordings: Sequence[Recording]) -> list[str]:
    """Return the data-quality problems of recordings, one line per problem and per excluded column."""
    left = Message(". These rows are left out")
    return [
        Message(
            "{name}: {channel}{text}{left}",
            name=r.name,
            channel=f.channel and f"{f.channel} ",
            text=f.text,
            left="" if f.severity != "trouble" or f.rows is None else left,
        )
        for r, off in zip(recordings, compare_starts(recordings), strict=True)
        for f in (*check(r), *off)
        if f.severity == "trouble" or f.kind in ("left out", "offset")
    ]


@dataclass(frozen=True, eq=False)
class TrainingTable:
    """Complete rows of recordings in the form scikit-learn expects.

    Parameters
    ----------
    X : DataFrame of shape (n_rows, n_features)
        Inputs minus their reference; if requested, the first column is the time since the start of the test [s].
    y : ndarray of shape (n_rows,)
        Deviation [um].
    test, cycle : ndarray of int of shape (n_rows,)
        Index of the recording and of the thermal cycle of each row: the ``groups`` of scikit-learn.
    dt : Series of shape (n_rows,)
        Time since the previous row [s]; inf where a test starts.
    """

    X: pd.DataFrame
    y: FloatArray
    test: IntArray
    cycle: IntArray
    dt: "pd.Series[float]"

    def __repr__(self) -> str:
        tests, cycles = len(np.unique(self.test)), len(np.unique(self.cycle))
        return f"<TrainingTable: {len(self.y)} rows, {self.X.shape[1]} columns, {tests} test(s), {cycles} cycle(s)>"


def training_table(
    recordings: Given,
    target: str,
    *,
    inputs: str | Sequence[str] | None = None,
    time: bool = False,
    absolute: bool = False,
    mapping: str | Path | mappings.Mapping | None = None,
) -> TrainingTable:
    """Return recordings in the form scikit-learn expects, for `cross_val_score`, Pipelines and custom estimators.

    Parameters
    ----------
    recordings : Recording, path, DataFrame, or sequence of them
    target : str
        Displacement channel to predict.
    inputs : str or sequence of str, optional
        Channels used as model inputs. Default: all temperatures and the first spindle speed.
    time : bool
        Add ``time_s`` as the first column, for an estimator with ``time="column"``.
    absolute : bool
        Use absolute temperatures. Default: temperatures relative to the start of each test.
    mapping : str, Path or Mapping, optional
        TOML mapping file for files: role and unit of each column.

    Returns
    -------
    TrainingTable

    Raises
    ------
    InputError
        A channel is missing.

    Examples
    --------
    >>> import thermocomp as tc
    >>> from sklearn.model_selection import LeaveOneGroupOut, cross_val_score
    >>> table = tc.training_table(tc.simulate("wessel-milling"), "s1_um")
    >>> table
    <TrainingTable: 405 rows, 4 columns, 5 test(s), 31 cycle(s)>
    >>> scores = cross_val_score(
    ...     tc.LeastSquares(),
    ...     table.X,
    ...     table.y,
    ...     groups=table.test,
    ...     cv=LeaveOneGroupOut(),
    ...     scoring="neg_mean_absolute_error",
    ... )
    >>> [f"{-score:.1f} um" for score in scores]  # each day left out
    ['3.9 um', '9.6 um', '9.1 um', '6.5 um', '6.8 um']
    """
    tests = recordings_of(recordings, mapping)
    samples = prepare(tests, target, inputs, absolute=absolute, judged=False).samples
    rows = samples.take(samples.valid & np.isfinite(samples.deviations[:, 0]))
    X = samples.frame()[samples.valid & np.isfinite(samples.deviations[:, 0])].reset_index(drop=True)
    if time:
        X.insert(0, "time_s", rows.time)
    return TrainingTable(X=X, y=rows.deviations[:, 0], test=rows.test, cycle=rows.cycle, dt=pd.Series(rows.dt()))
