"""Cutting tests with NC programs on the virtual machine: milled surfaces by thermal state of machine and room."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from thermocomp.core.model import ErrorModel
from thermocomp.models.methods import find_method
from thermocomp.papers.common import fit_and_freeze
from thermocomp.papers.precompensation import program
from thermocomp.papers.precompensation.setup import CUTS, LEAST, MILLING, NET, NONE, POSITIONS, SPEED
from thermocomp.papers.study import FloatArray, Progress
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.samples import Samples
from thermocomp.virtual.climate import Climate
from thermocomp.virtual.datasets import find_experiment, record
from thermocomp.virtual.protocol import Experiment
from thermocomp.virtual.segments import Feed, Stretch

HOUR = 3600.0
#: wrong initial state: preceding run of the spindle [s] at the speed of milling [1/min]
BEFORE, BEFORE_SPEED = 0.5 * HOUR, 2000.0
#: change of the room temperature in the hour between the surfaces [K]
ROOM = 2.0
#: interval of the rows of the drift: the longest step of the machine [s]
OFTEN = 20.0
#: true states of machine and room
COLD, WARM, WARMER, COLDER = "cold", "warm", "warmer", "colder"
#: cases: true state, and state assumed by the revision; warm: after a run of `BEFORE`
RIGHT = "cold"
UNKNOWN = "warm, assumed to be cold"
CARRIED = "warm, state carried over"
FALSE = "cold, assumed to be warm"
WARMS, COOLS = f"the room warms by {ROOM:g} degC", f"the room cools by {ROOM:g} degC"
#: true state of each case, and whether the revision assumes a warm start
CASES: Mapping[str, tuple[str, bool]] = {
    RIGHT: (COLD, False),
    UNKNOWN: (WARM, False),
    CARRIED: (WARM, True),
    FALSE: (COLD, True),
    WARMS: (WARMER, False),
    COOLS: (COLDER, False),
}
#: models tested in all cases, as the revision in the paper
TRIED = (NET, LEAST)
#: methods of thermocomp that can use the speed alone
HOUSE = ("arx-free-run", "dynamic", "averaged")


@dataclass(frozen=True)
class Changing(Climate):
    """A room that becomes warmer or colder during the test, in addition to the usual changes of its air.

    Parameters
    ----------
    change : float
        Change of the temperature [K].
    since : float
        Start of the change, since the start of the test [s].
    takes : float
        Duration of the change, which is linear in time [s].
    """

    change: float = 0.0
    since: float = MILLING * 60.0
    takes: float = HOUR

    def air(
        self, state: FloatArray, start: float, step: float, n_steps: int, rng: np.random.Generator
    ) -> tuple[FloatArray, FloatArray]:
        """Return the state of the air at the end of each of several equal steps, see `Climate.air`.

        Parameters
        ----------
        state : ndarray of shape (2, 3)
        start : float
            Start of the first step, since the start of the test [s].
        step : float
            [s]

        Returns
        -------
        state : ndarray of shape (2, 3)
        air : ndarray of shape (n_steps, 3)
        """
        state, air = super().air(state, start, step, n_steps, rng)
        time = start + step * np.arange(1, n_steps + 1)
        air[:, 0] += self.change * np.clip((time - self.since) / self.takes, 0.0, 1.0)
        return state, air


@dataclass(frozen=True, eq=False)
class Surfaces:
    """Surfaces of all tests, milled with programs revised by one method.

    Parameters
    ----------
    depth : ndarray of shape (n_tests, n_positions)
        Height of the mean of the second surface above that of the first [um].
    unevenness : ndarray of shape (n_tests, 2, n_positions)
        Largest minus smallest height within a surface [um].
    """

    depth: FloatArray
    unevenness: FloatArray

    @property
    def mean(self) -> float:
        """Mean magnitude of the depth difference over tests and positions [um]."""
        return float(np.abs(self.depth).mean())

    @property
    def most(self) -> float:
        """Largest magnitude of the depth difference [um]."""
        return float(np.abs(self.depth).max())

    @property
    def by_test(self) -> FloatArray:
        """Mean magnitude of the depth difference over the positions, (n_tests,) [um]."""
        return np.asarray(np.abs(self.depth).mean(axis=1))

    @property
    def signed(self) -> FloatArray:
        """Mean depth difference over the positions, (n_tests,) [um]."""
        return np.asarray(self.depth.mean(axis=1))


@dataclass(frozen=True, eq=False)
class Milled:
    """All milled surfaces.

    Parameters
    ----------
    surfaces : dict of (str, str, str) to Surfaces
        Surfaces by case, model and revision method; of unrevised programs: `NONE` and an empty method.
    turning : float
        Share of the time during which the spindle speed of the programs equals that of the recorded tests.
    lines : int
        Number of lines of the first program.
    first : dict of str to list of (Face, ndarray)
        Faces of the first test, cold, with their surface positions [um]; by revision method, with the neural net as the
        model.
    """

    surfaces: dict[tuple[str, str, str], Surfaces] = field(default_factory=dict)
    turning: float = 0.0
    lines: int = 0
    first: dict[str, list[tuple[program.FacedSurface, FloatArray]]] = field(default_factory=dict)

    def without(self, case: str) -> Surfaces:
        """Return the surfaces milled with the original programs, without correction."""
        return self.surfaces[case, NONE, ""]

    def paper(self, case: str, model: str = NET) -> Surfaces:
        """Return the surfaces milled with programs revised by the paper's method."""
        return self.surfaces[case, model, program.EVERY]


def house_models(learn: Samples) -> dict[str, list[ErrorModel]]:
    """Fit the default methods of thermocomp for machines without sensors to the identification data."""
    timed: dict[str, Any] = {"dt": learn.dt(), "cycle": learn.cycle}
    targets = [c.name for c in learn.targets]
    return {
        name: [fit_and_freeze(find_method(name).build([SPEED]), learn, [t], **timed)[t] for t in targets]
        for name in HOUSE
    }


def compute(models: Mapping[str, Sequence[ErrorModel]], seed: int, progress: Progress) -> Milled:
    """Write, revise and mill the programs of all cutting tests."""
    drifts: dict[str, list[Recording]] = {}
    for what in (COLD, WARM, WARMER, COLDER):
        progress(0.2 * len(drifts) / 4, f"cutting tests, {what}")
        drifts[what] = [record(make_true_test(what), seed=seed + n)[0] for n in range(CUTS)]
    programs = [program.write_program(test) for test in drifts[COLD]]
    turns = [_turns(lines, test) for lines, test in zip(programs, drifts[COLD], strict=True)]
    milled = Milled(turning=float(np.mean(turns)), lines=len(programs[0]))
    _mill(milled, programs, drifts, NONE, "", list(CASES))
    for number, (name, its) in enumerate(models.items()):
        progress(0.2 + 0.8 * number / len(models), f"programs revised with: {name}")
        for way in program.WAYS if name == NET else program.WAYS[:-1]:
            revised = [program.revise_program(lines, its, way) for lines in programs]
            cases = [c for c, (_, warm) in CASES.items() if not warm]
            _mill(milled, revised, drifts, name, way, cases if way == program.EVERY and name in TRIED else [RIGHT])
        if name in TRIED:
            start = program.warmed(its, BEFORE, BEFORE_SPEED)
            revised = [program.revise_program(lines, its, program.EVERY, start) for lines in programs]
            _mill(milled, revised, drifts, name, program.EVERY, [c for c, (_, warm) in CASES.items() if warm])
    return milled


def make_true_test(what: str) -> Experiment:
    """Return the cutting test without noise, with machine and room in one of four states."""
    experiment = find_experiment("precompensation-cut")
    (plan,) = experiment.tests
    plan = replace(plan, sampling=OFTEN, perfect=True, places=())
    if what == WARM:
        rest = Stretch(duration=plan.soak.longest - BEFORE)
        ran = Stretch(duration=BEFORE, speed=BEFORE_SPEED, feed=Feed(600.0, 1000.0, 600.0))
        plan = replace(plan, soak=Stretch(segments=(rest, ran)))
    elif what in (WARMER, COLDER):
        change = ROOM if what == WARMER else -ROOM
        plan = replace(plan, climate=Changing(**asdict(plan.climate), change=change))
    return replace(experiment, tests=(plan,))


def _turns(lines: Sequence[str], test: Recording) -> float:
    """Return the share of the intervals in which a program has the spindle speed of a test."""
    speed = test.table[SPEED].to_numpy(dtype=np.float64)[1:]
    middle = (test.time[1:] + test.time[:-1]) / 2
    return float(np.mean(program.turning(lines, middle) == speed))


def _mill(
    milled: Milled,
    programs: Sequence[Sequence[str]],
    drifts: Mapping[str, Sequence[Recording]],
    model: str,
    way: str,
    cases: Sequence[str],
) -> None:
    """Mill all tests with programs revised by one method, for some of the cases."""
    cut = [program.faces(lines) for lines in programs]
    for case in cases:
        there = drifts[CASES[case][0]]
        lies = [[face.surface(drift) for face in faces] for faces, drift in zip(cut, there, strict=True)]
        milled.surfaces[case, model, way] = Surfaces(
            np.array([_second_minus_first(f, s) for f, s in zip(cut, lies, strict=True)]),
            np.array([np.reshape([np.ptp(v) for v in s], (2, len(POSITIONS))) for s in lies]),
        )
        if case == RIGHT and model in (NONE, NET):
            milled.first[way] = list(zip(cut[0], lies[0], strict=True))


def _second_minus_first(faces: Sequence[program.FacedSurface], lies: Sequence[FloatArray]) -> list[float]:
    mean = {(f.number, f.position): float(v.mean()) for f, v in zip(faces, lies, strict=True)}
    return [mean[2, float(p)] - mean[1, float(p)] for p in POSITIONS]
