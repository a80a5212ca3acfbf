"""Planning of thermal tests in Python: sufficient test length, next test, and end of a running test."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from thermocomp.api import testprogram
from thermocomp.api.base import Result, told_trouble
from thermocomp.api.inputs import Given, LeaveOne, Prepared, Starts, judging_of, prepare, recordings_of, trouble_of
from thermocomp.api.keywords import Listener, silent
from thermocomp.api.testprogram import Dialect
from thermocomp.core.exceptions import InputError
from thermocomp.core.machine import Channel
from thermocomp.core.messages import Message, join
from thermocomp.core.zero import Zeroing
from thermocomp.judging.planning import learningcurve, planning
from thermocomp.judging.planning.learningcurve import LearningCurve
from thermocomp.judging.planning.planning import Candidate, Plan
from thermocomp.judging.settling.stopping import Running, judge_running
from thermocomp.judging.splits import Judging
from thermocomp.recordings.readers.mapping import Mapping

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: result of `may_stop`
RunningTest = Running
#: time between two measurements with a touch probe [min]
EVERY = 30.0


@dataclass(frozen=True, eq=False, repr=False)
class Planned(Result):
    """Plan of the next test, and learning curve.

    Parameters
    ----------
    plan : Plan
    curve : LearningCurve or None
        None: there are fewer than three thermal cycles, or it was not requested.
    channels : tuple of Channel
        Channels to be recorded in a test.
    trouble : tuple of str
        Data-quality problems of the recordings.
    """

    plan: Plan
    curve: LearningCurve | None
    channels: tuple[Channel, ...]
    trouble: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Return all results as a dict, as printed by ``--json``."""
        curve = self.curve
        return {
            "trouble": list(self.trouble),
            "expected_um": self.plan.expected,
            "candidates": [_candidate(c) for c in self.plan.candidates],
            "curve": curve
            and {
                "model": curve.model,
                "none_rms_um": curve.none,
                "last_gain_um": curve.last_gain,
                "worth_um": curve.worth,
                "enough": curve.enough,
                "cycles": [x._asdict() for x in curve.by_cycles()],
                "speeds": [x._asdict() for x in curve.by_speeds()],
            },
        }

    @property
    def next(self) -> Candidate:
        """Test with the largest expected benefit, or with ``proof`` that with speeds in a random order."""
        return self.plan.next

    def to_frame(self) -> pd.DataFrame:
        """Return the candidate tests, a row each, ranked by expected benefit."""
        return pd.DataFrame(
            {
                "test": [c.trial.words for c in self.plan.candidates],
                "kind": [c.trial.kind for c in self.plan.candidates],
                "speed": [c.trial.speed for c in self.plan.candidates],
                "hours": [c.trial.duration / 3600 for c in self.plan.candidates],
                "gain": [c.gain for c in self.plan.candidates],
                "least_gain": [c.gain_range[0] for c in self.plan.candidates],
                "most_gain": [c.gain_range[1] for c in self.plan.candidates],
                "expected": [c.doubt for c in self.plan.candidates],
                "news": [c.news for c in self.plan.candidates],
            }
        )

    def plot(self) -> "Figure":
        """Return a figure of the gap that the next test fills, of all tests, and of the learning curve."""
        from thermocomp.report import plans

        return plans.draw(self.plan, self.curve).figure

    def write(
        self, path: str | Path, *, dialect: Dialect = "linuxcnc", every: float = EVERY, overwrite: bool = False
    ) -> Path:
        """Write the next test as an NC program, with a measurement sheet (.csv) and the figure (.png) next to it.

        Parameters
        ----------
        path : str or Path
            Path of the program.
        dialect : {'linuxcnc', 'fanuc'}
        every : float
            Time between two measurements with a touch probe [min]; 0: a logger measures continuously.
        overwrite : bool

        Returns
        -------
        Path
            Path of the sheet.

        Raises
        ------
        InputError
            A file exists already, or cannot be written.
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

    @property
    def so_far(self) -> str:
        """Return the learning curve as a sentence; empty without it."""
        return "" if self.curve is None else Message("Unseen cycles so far: {what}.", what=self.curve.words)

    def __str__(self) -> str:
        best = self.next
        low, high = best.gain_range
        found = Message(
            "Record next: {test}; expected gain {gain:.2f} um ({low:.2f} to {high:.2f}) of {expected:.2f} um, "
            "calculated over all tests of the grid{why}.",
            test=best.trial.words,
            gain=best.gain,
            low=low,
            high=high,
            expected=self.plan.expected,
            why=Message(" ({news})", news=best.news) if best.news else "",
        )
        return join([found, *filter(None, [self.so_far]), *told_trouble(self.trouble)], " ")


def _candidate(c: Candidate) -> dict[str, Any]:
    return {
        "kind": c.trial.kind,
        "words": c.trial.words,
        "speed_1_min": c.trial.speed,
        "steps": [{"speed_1_min": speed, "duration_s": duration} for speed, duration in c.trial.steps],
        "gain_um": c.gain,
        "gain_range_um": c.gain_range,
        "expected_um": c.doubt,
        "news": c.news,
    }


def plan(
    recordings: Given,
    targets: str | Sequence[str] | None = None,
    *,
    top_speed: float | None = None,
    hours: float = 12.0,
    swing: float = 5.0,
    proof: bool = False,
    seed: int = 0,
    inputs: str | Sequence[str] | None = None,
    split: str | None = None,
    leave_one: LeaveOne | None = None,
    absolute: bool = False,
    starts: Starts = None,
    zero_over: float = Zeroing.at_rest,
    mapping: str | Path | Mapping | None = None,
    curve: bool = True,
    jobs: int = -1,
    progress: Callable[..., Any] = silent,
) -> Planned:
    """Determine whether more tests are needed, and write the most informative next test as an NC program.

    Parameters
    ----------
    recordings, targets
        As for `compare`.
    top_speed : float, optional
        Maximum spindle speed of the machine [1/min]. Default: the highest recorded speed.
    hours : float
        Duration of the next test [h].
    swing : float
        Largest change of the ambient temperature at the machine during the test [degC]; 0: none.
    proof : bool
        Propose the test with speeds in a random order, whatever its benefit: its cycles, all in one recording, can
        prove a model, because no trend or daily rhythm follows such an order.
    seed : int
        Seed of the random order of speeds.
    inputs, split, leave_one, absolute, starts, zero_over, mapping
        As for `compare`.
    curve : bool
        Also compute the learning curve: error on unseen cycles against the number of training cycles. This takes most
        of the computing time.
    jobs, progress
        As for `compare`.

    Returns
    -------
    Planned

    Raises
    ------
    InputError
        A recording, channel or setting is invalid.

    Examples
    --------
    >>> import thermocomp as tc
    >>> planned = tc.plan(tc.simulate("demo"), "z_um", top_speed=6000, curve=False)
    >>> planned.next.trial.words, planned.next.news
    ('6,000 1/min for 6 h, then a stop of equal length', 'no run faster than 3,200 1/min')
    >>> planned.write("next.ngc").name
    'next.csv'
    """
    listener = Listener(progress)
    ready = prepare(
        recordings_of(recordings, mapping),
        targets,
        inputs,
        absolute=absolute,
        starts=starts,
        zero_over=zero_over,
        split=split,
        leave_one=leave_one,
        jobs=jobs,
        judged=False,
        listener=listener,
    )
    judging = _units(ready) if curve else Judging("", ())
    worth_it = len(judging.splits) > 2
    listener.begin(lambda: 1 + (learningcurve.n_pieces(judging) if worth_it else 0))
    found = planning.plan(ready.samples, top_speed, hours=hours, swing=swing, proof=proof, seed=seed)
    progress("test errors predicted")
    learned = None
    if worth_it:
        learned = learningcurve.learning_curve(ready.samples, judging, jobs=jobs, progress=progress)
    channels = (*ready.samples.inputs, *ready.samples.targets)
    return Planned(found, learned, channels, tuple(ready.trouble))


def _units(ready: Prepared) -> Judging:
    """Return the blocks of a learning curve: as requested, or the thermal cycles; none if there is only one."""
    if ready.judging.splits:
        return ready.judging
    return judging_of(ready.samples) if len(ready.samples.cycle_names) > 1 else Judging("", ())


def may_stop(
    recordings: Given,
    targets: str | Sequence[str] | None = None,
    *,
    mapping: str | Path | Mapping | None = None,
    progress: Callable[..., Any] = silent,
) -> Running:
    """Check whether the spindle-running phase of a test can be stopped because its steady state can be predicted.

    Parameters
    ----------
    recordings : Recording, path or DataFrame
        Recording of the test up to now.
    targets : str or sequence of str, optional
        Displacement channels to check. Default: all of them.
    mapping : str, Path or Mapping, optional
        TOML mapping file for a file: role and unit of each column.
    progress : callable
        As for `plan`.

    Returns
    -------
    Running

    Raises
    ------
    InputError
        There is more than one recording, a channel does not exist, or the spindle has not started.

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
    tests = recordings_of(recordings, mapping)
    if len(tests) != 1:
        raise InputError(f"{len(tests)} recordings given: expected one, that of the running test")
    Listener(progress).warn(trouble_of(tests))
    named = [targets] if isinstance(targets, str) else targets
    return judge_running(tests[0], named or [c.name for c in tests[0].displacements])
