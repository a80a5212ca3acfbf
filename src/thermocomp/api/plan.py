"""How much test is enough, which test next, and whether a running one may stop, in Python."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from thermocomp.api import testprogram
from thermocomp.api.inputs import Given, Prepared, Starts, judging_of, prepare, recordings_of
from thermocomp.api.results import Result
from thermocomp.api.testprogram import Dialect
from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Channel
from thermocomp.judging.planning import learningcurve, planning
from thermocomp.judging.planning.learningcurve import LearningCurve
from thermocomp.judging.planning.planning import Candidate, Plan
from thermocomp.judging.settling.stopping import Running, judge_running
from thermocomp.judging.splits import Judging
from thermocomp.recordings.readers.mapping import Mapping

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: time between two measurements with a touch probe [min]
EVERY = 30.0


def _silent(_: str, steps: int = 1) -> None:
    """Say nothing."""


@dataclass(frozen=True, eq=False, repr=False)
class Planned(Result):
    """Which test next, and how much is enough.

    Parameters
    ----------
    plan : Plan
    curve : LearningCurve or None
        None: there are fewer than three thermal cycles, or it was not asked for.
    channels : tuple of Channel
        What has to be written down in a test.
    trouble : tuple of str
        What is wrong with the recordings.
    """

    plan: Plan
    curve: LearningCurve | None
    channels: tuple[Channel, ...]
    trouble: tuple[str, ...] = ()

    @property
    def next(self) -> Candidate:
        """The test that would bring most."""
        return self.plan.candidates[0]

    def to_frame(self) -> pd.DataFrame:
        """Return the tests that could be run next, a row each, the one that would bring most first."""
        return pd.DataFrame(
            {
                "test": [c.trial.words for c in self.plan.candidates],
                "kind": [c.trial.kind for c in self.plan.candidates],
                "speed": [c.trial.speed for c in self.plan.candidates],
                "hours": [c.trial.duration / 3600 for c in self.plan.candidates],
                "gain": [c.gain for c in self.plan.candidates],
                "expected": [c.doubt for c in self.plan.candidates],
                "news": [c.news for c in self.plan.candidates],
            }
        )

    def plot(self) -> "Figure":
        """Return the figure of the gap that the next test fills, of all tests, and of the learning curve."""
        from thermocomp.report import plans

        return plans.draw(self.plan, self.curve).figure

    def write(
        self, path: str | Path, *, dialect: Dialect = "linuxcnc", every: float = EVERY, overwrite: bool = False
    ) -> Path:
        """Write the next test as an NC program, and beside it the sheet for what is measured, and the figure (.png).

        Parameters
        ----------
        path : str or Path
            Of the program.
        dialect : {'linuxcnc', 'fanuc'}
        every : float
            Time between two measurements with a touch probe [min]; 0: a logger measures all the time.
        overwrite : bool

        Returns
        -------
        Path
            Of the sheet.

        Raises
        ------
        InputError
            A file is there already, or cannot be there.
        """
        from thermocomp.report.drawing import png

        return testprogram.write_test(
            self.next.trial,
            Path(path),
            self.channels,
            dialect=dialect,
            every=60.0 * every,
            picture=png(self.plot()),
            overwrite=overwrite,
        )

    def __str__(self) -> str:
        best = self.next
        why = f" ({best.news})" if best.news else ""
        found = [f"Next: {best.trial.words}, {best.gain:.2f} um of {self.plan.expected:.2f} um expected{why}."]
        if self.curve is not None:
            found.append(f"So far: {self.curve.words}.")
        return " ".join([*found, *([f"Trouble: {'; '.join(self.trouble)}."] if self.trouble else [])])


def plan(
    recordings: Given,
    targets: str | Sequence[str] | None = None,
    *,
    top_speed: float | None = None,
    hours: float = 12.0,
    swing: float = 5.0,
    inputs: str | Sequence[str] | None = None,
    absolute: bool = False,
    starts: Starts = None,
    mapping: str | Path | Mapping | None = None,
    curve: bool = True,
    jobs: int = 1,
    progress: Callable[..., Any] = _silent,
) -> Planned:
    """Say which test would teach most next, and whether more of the same would.

    Parameters
    ----------
    recordings, targets
        As for `compare`.
    top_speed : float, optional
        Of the machine [1/min]; the highest recorded one without it.
    hours : float
        Length of the next test [h].
    swing : float
        How far the room's temperature may change within so long where the machine stands [degC]; 0: never.
    inputs, absolute, starts, mapping
        As for `compare`.
    curve : bool
        Also find out how the error on unseen cycles falls with the number of cycles learned from, which takes long.
    jobs, progress
        As for `compare`.

    Returns
    -------
    Planned

    Raises
    ------
    InputError
        A recording, channel or setting cannot be used.

    Examples
    --------
    >>> import thermocomp as tc
    >>> planned = tc.plan(tc.simulate("demo"), "z_um", top_speed=6000, curve=False)
    >>> planned.next.trial.words, planned.next.news
    ('6,000 1/min for 6 h, then a stop as long', 'no run faster than 3,200 1/min')
    >>> planned.write("next.ngc").name
    'next.csv'
    """
    tests = recordings_of(recordings, mapping)
    ready = prepare(tests, targets, inputs, absolute=absolute, starts=starts, judged=False)
    return plan_from(ready, top_speed=top_speed, hours=hours, swing=swing, curve=curve, jobs=jobs, progress=progress)


def plan_from(
    ready: Prepared,
    *,
    top_speed: float | None,
    hours: float,
    swing: float,
    curve: bool,
    jobs: int,
    progress: Callable[..., Any] = _silent,
) -> Planned:
    """Do the work of `plan` with what it begins with.

    Parameters
    ----------
    ready : Prepared
    top_speed, hours, swing, curve, jobs, progress
        Of `plan`.

    Returns
    -------
    Planned
    """
    found = planning.plan(ready.samples, top_speed, hours=hours, swing=swing)
    progress("test errors predicted")
    judging = units_of(ready) if curve else Judging("", ())
    learned = None
    if len(judging.splits) > 2:
        learned = learningcurve.learning_curve(ready.samples, judging, jobs=jobs, progress=progress)
    channels = (*ready.samples.inputs, *ready.samples.targets)
    return Planned(found, learned, channels, tuple(ready.trouble))


def units_of(ready: Prepared) -> Judging:
    """Return the blocks of a learning curve: what was asked for, or the thermal cycles; none if there is only one.

    Parameters
    ----------
    ready : Prepared

    Returns
    -------
    Judging
    """
    if ready.judging.splits:
        return ready.judging
    return judging_of(ready.samples) if len(ready.samples.cycle_names) > 1 else Judging("", ())


def may_stop(
    recording: Given, targets: str | Sequence[str] | None = None, *, mapping: str | Path | Mapping | None = None
) -> Running:
    """Judge whether the running part of a test may end: its steady state is known.

    Parameters
    ----------
    recording : Recording, path or DataFrame
        The test up to now.
    targets : str or sequence of str, optional
        Displacement channels; all of them without it.
    mapping : str, Path or Mapping, optional
        For a file.

    Returns
    -------
    Running

    Raises
    ------
    InputError
        There is more than one recording, no such channel, or the spindle has not started.

    Examples
    --------
    >>> import numpy as np
    >>> import pandas as pd
    >>> import thermocomp as tc
    >>> time = np.arange(0, 9000, 60.0)  # 2.5 h of a run, a time constant of 40 min
    >>> table = pd.DataFrame({"time_s": time, "spindle_rpm": 3000.0, "z_um": 40 * -np.expm1(-time / 2400)})
    >>> running = tc.may_stop(table)
    >>> running.may_stop, round(running.states[0][1].final)
    (True, 40)
    """
    tests = recordings_of(recording, mapping)
    if len(tests) != 1:
        raise InputError(f"{len(tests)} recordings: give the one of the running test")
    named = [targets] if isinstance(targets, str) else targets
    return judge_running(tests[0], named or [c.name for c in tests[0].displacements])
