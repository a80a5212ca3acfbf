"""What is handed in: recordings, files, tables; and what is made of them before any work."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from thermocomp.api.keywords import SILENT, Listener
from thermocomp.core.exceptions import InputError
from thermocomp.core.zero import Zeroing
from thermocomp.judging import splits
from thermocomp.judging.splits import Judging
from thermocomp.recordings.checks.quality import check
from thermocomp.recordings.checks.sound import drop_unsound
from thermocomp.recordings.readers import mapping as mappings
from thermocomp.recordings.readers.mending import read_or_offer
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.recordings.starts import Start
from thermocomp.recordings.tilts import with_tilts

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.intp]

#: one test, or several
Given = Recording | str | Path | pd.DataFrame | Sequence["Recording | str | Path | pd.DataFrame"]
LeaveOne = Literal["cycle", "day", "file"]
#: how recordings begin: all of them, each of them, or to be found out
Starts = Start | Sequence[Start] | None


def read(path: str | Path, mapping: str | Path | mappings.Mapping | None = None) -> Recording:
    r"""Read one test from a file.

    Parameters
    ----------
    path : str or Path
        A file ending in .csv, .tsv, .txt, .xlsx, .ods or .parquet.
    mapping : str, Path or Mapping, optional
        What the columns are, where their headings do not say: a TOML file, or what was read of one.

    Returns
    -------
    Recording

    Raises
    ------
    RecordingError, UnitError
        See `thermocomp.recordings.readers.recordings.read`; a note of the error offers a mapping, where one would help.

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
    """Return recordings, whatever they were given as.

    Parameters
    ----------
    given : Recording, str, Path, DataFrame, or sequence of them
        A table is taken by `Recording.from_dataframe` as it is.
    mapping : str, Path or Mapping, optional
        For files.

    Returns
    -------
    list of Recording

    Raises
    ------
    InputError
        It is none of these, or there is none.
    """
    several = [given] if isinstance(given, Recording | str | Path | pd.DataFrame) else list(given)
    if not several:
        raise InputError("no recording given")
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
    """Return how each recording begins; None: to be found out.

    Parameters
    ----------
    starts : Start or sequence of Start, optional
        One for all recordings, or one each.
    recordings : sequence of Recording

    Returns
    -------
    tuple of Start or None

    Raises
    ------
    InputError
        They are not as many as the recordings, or one continues from itself or is given to several.
    """
    if starts is None:
        return None
    each = (starts,) * len(recordings) if isinstance(starts, Start) else tuple(starts)
    if len(each) != len(recordings):
        raise InputError(f"starts: {len(each)} for {len(recordings)} recording(s): give one each, or one for all")
    if isinstance(starts, Start) and starts.earlier and len(recordings) > 1:
        raise InputError(
            f"starts: {len(recordings)} recordings cannot all continue from the same files: give one start each"
        )
    for start, r in zip(each, recordings, strict=True):
        if r.fingerprint in (e.fingerprint for e in start.earlier):
            raise InputError(f"starts: {r.name} cannot continue from itself: name the file before it in earlier=")
    return each


@dataclass(frozen=True, eq=False)
class Prepared:
    """All that judging begins with.

    Parameters
    ----------
    tests : tuple of Recording
    samples : Samples
        Their rows, without those in which a channel is in trouble.
    judging : Judging
        What is learned from and what is judged.
    trouble : list of str
        What is wrong with the recordings.
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
    """Make of recordings what judging begins with.

    Parameters
    ----------
    tests : sequence of Recording
    targets : str or sequence of str, optional
        Displacement channels to predict; all of the first recording without it.
    inputs : str or sequence of str, optional
    absolute : bool
    starts : Start or sequence of Start, optional
        How the recordings begin, see `starts_of`.
    zero_over : float
        Average the start over this time, while the spindle is stopped [s].
    tilt : sequence of str, optional
        Tilts to predict too, see `thermocomp.recordings.tilts.with_tilts`.
    split, leave_one : str, optional
        What is judged, see `judging_of`.
    jobs : int
        Processes to share the work among.
    judged : bool
        False: nothing is judged unless one of these says so; a single thermal cycle is enough then.
    listener : Listener
        Gets what is wrong with the recordings, before the work.

    Returns
    -------
    Prepared
    """
    if jobs == 0:
        raise InputError("jobs 0: name a number of processes, or -1 for all cores")
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
            f"{tests[0].name}: {left} left out: of several spindle speeds the first, {taken}, is an input; name the "
            "inputs to take others"
        )
    listener.warn(trouble)
    return Prepared(tuple(tests), samples, judging, trouble)


def judging_of(samples: Samples, *, split: str | None = None, leave_one: LeaveOne | None = None) -> Judging:
    """Return what is learned from and what is judged.

    Parameters
    ----------
    samples : Samples
    split : str, optional
        Judge by time: shares of the rows such as ``0.75/0.25``, or hours such as ``20h/8h``.
    leave_one : {'cycle', 'day', 'file'}, optional
        Judge on each thermal cycle in turn, which is done if nothing is said, on each day, or on each recording.

    Returns
    -------
    Judging

    Raises
    ------
    InputError
        Both were given, or there are too few cycles, days or files.
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
    """Return what is wrong with recordings, one line per trouble and per column that was left out."""
    return [
        f"{r.name}: {f.channel + ' ' if f.channel else ''}{f.text}"
        f"{'' if f.severity != 'trouble' or f.rows is None else '. These rows are left out'}"
        for r in recordings
        for f in check(r)
        if f.severity == "trouble" or f.kind == "left out"
    ]


@dataclass(frozen=True, eq=False)
class TrainingTable:
    """Complete rows of recordings as scikit-learn takes them.

    Parameters
    ----------
    X : DataFrame of shape (n_rows, n_features)
        Inputs minus their reference; in front of them the time since the start of the test [s], if asked for.
    y : ndarray of shape (n_rows,)
        Deviation [um].
    test, cycle : ndarray of int of shape (n_rows,)
        Which recording and which thermal cycle a row belongs to: the ``groups`` of scikit-learn.
    dt : Series of shape (n_rows,)
        Time since the row before [s]; inf where a test starts.
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
    """Return recordings as scikit-learn takes them, for `cross_val_score`, Pipelines and estimators of one's own.

    Parameters
    ----------
    recordings : Recording, path, DataFrame, or sequence of them
    target : str
        Displacement channel to predict.
    inputs : str or sequence of str, optional
        Channels to predict from; all temperatures and the first spindle speed without it.
    time : bool
        The first column is ``time_s``, for an estimator with ``time="column"``.
    absolute : bool
        Take temperatures as they are; without it they are counted from the start of each test.
    mapping : str, Path or Mapping, optional
        For files.

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
