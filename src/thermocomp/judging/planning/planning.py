"""Next test: expected reduction of the error on unseen data for each of a grid of tests."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.exceptions import InputError
from thermocomp.core.messages import Message, join
from thermocomp.judging.planning.trial import Kind, Trial
from thermocomp.models.doubt import Doubt, find_doubt
from thermocomp.recordings.recording import AMBIENT
from thermocomp.recordings.samples import Samples

#: fractions of the top speed in the grid
SPEEDS = (0.2, 0.4, 0.6, 0.8, 1.0)
#: kinds of test at each speed
KINDS: tuple[Kind, ...] = ("repeated", "stop", "run")
#: initial stop for averaging the zero, and runs and stops of a repeated test [s]
REST, SHORT = 900.0, 1800.0
#: time constant of the room's effect on a machine part [s]
LAG = 7200.0
#: interval of the rows of a predicted test [s]
_STEP = 60.0
#: only every fifth row is used
_EVERY = 5
#: speeds that differ by less than this fraction of the top speed are merged
SAME = 0.1
#: range of the actual gain relative to the expected one: as that of the errors in the validation of the planner
ACCURACY = (0.5, 1.7)


@dataclass(frozen=True)
class Candidate:
    """A test and its expected benefit.

    Parameters
    ----------
    doubt : float
        Expected error in the test itself, mean over the targets [um].
    gain : float
        Expected reduction of the error over all tests of the grid, mean over the targets [um].
    news : str
        New conditions in the test; empty if there are none.
    """

    trial: Trial
    doubt: float
    gain: float
    news: str

    @property
    def gain_range(self) -> tuple[float, float]:
        """Range in which the actual gain is to be expected [um]."""
        return ACCURACY[0] * self.gain, ACCURACY[1] * self.gain


@dataclass(frozen=True)
class Covered:
    """Conditions recorded so far.

    Parameters
    ----------
    runs : tuple of (float, float, float)
        Mean speed [1/min] and duration [s] of each run, and duration of the following stop [s]; 0 without a stop.
    rooms : tuple of float
        Change of the ambient temperature within each test [degC]; empty if unknown.
    """

    runs: tuple[tuple[float, float, float], ...]
    rooms: tuple[float, ...]

    @classmethod
    def of(cls, samples: Samples, column: int) -> "Covered":
        """Return the conditions covered by samples; `column` is the index of the spindle speed."""
        runs: list[tuple[float, float, float]] = []
        ranges = []
        air = [j for j, c in enumerate(samples.inputs) if AMBIENT.search(c.name) and c.quantity == "temperature"]
        for test in range(len(samples.test_names)):
            mine = np.flatnonzero((samples.test == test) & samples.valid)
            speed, dt = np.abs(samples.values[mine, column]), samples.take(mine).dt()
            dt[~np.isfinite(dt)] = 0.0
            level = np.round(speed / max(float(speed.max(initial=0.0)), 1.0) / 0.05)
            edges = [0, *(np.flatnonzero(np.diff(level)) + 1).tolist(), len(mine)]
            parts = [(float(speed[a:b].mean()), float(dt[a:b].sum())) for a, b in pairwise(edges)]
            for (v, length), after in zip(parts, [*parts[1:], (np.inf, 0.0)], strict=True):
                if v > 0 and length > 0:
                    runs.append((v, length, after[1] if after[0] == 0 else 0.0))
            ranges += [float(np.ptp(samples.values[mine][:, j])) for j in air[:1] if mine.size]
        return cls(tuple(runs), tuple(ranges))

    def news(self, trial: Trial, top_speed: float, swing: float) -> str:
        """Return the new conditions in a test, as text: speed, duration or stop."""
        if trial.kind == "room" and not self.rooms:
            return Message("no room temperature was recorded")
        if trial.kind == "room":
            most = max(self.rooms)
            told = Message("the room temperature changed by at most {most:.1f} degC", most=most)
            return told if most < 0.5 * swing else ""
        if trial.kind == "random":
            runs, same = [v for v, _, _ in self.runs], SAME * top_speed
            new = [v for v in sorted(set(trial.speeds)) if not any(abs(v - own) <= same for own in runs)]
            speeds = join([Message("{speed:,.0f}", speed=v) for v in new] or [""], ", ")
            return Message("no run at about {speeds} 1/min", speeds=speeds) if new else ""
        fastest = max((v for v, _, _ in self.runs), default=0.0)
        near = [run for run in self.runs if abs(run[0] - trial.speed) <= SAME * top_speed]
        if not near:
            about = Message("no run at about this speed")
            return Message("no run faster than {speed:,.0f} 1/min", speed=fastest) if trial.speed > fastest else about
        _, (_, length), *_ = trial.steps
        longest, stop = max(own for _, own, _ in near), max(after for _, _, after in near)
        if longest < 0.5 * length:
            return Message("no run at about this speed longer than {hours:.1f} h", hours=longest / 3600)
        found = Message("no stop longer than {hours:.1f} h after such a run", hours=stop / 3600)
        found = found if stop else Message("no stop after such a run")
        return found if trial.kind == "stop" and stop < 0.5 * length else ""


@dataclass(frozen=True)
class Plan:
    """Tests that could be run next, in descending order of their benefit.

    Parameters
    ----------
    expected : float
        Expected error over all tests of the grid at present, mean over the targets [um]. From the same calculation as
        the gains; an order of magnitude, not a judged error.
    top_speed, hours, swing : float
        Settings of the grid [1/min], [h], [degC].
    covered : Covered
        Conditions recorded so far.
    proof : bool
        The next test is that with speeds in a random order.
    """

    candidates: tuple[Candidate, ...]
    expected: float
    top_speed: float
    hours: float
    swing: float
    covered: Covered
    proof: bool = False

    @property
    def next(self) -> Candidate:
        """Test with the largest expected benefit, or with `proof` that with speeds in a random order."""
        return next(c for c in self.candidates if not self.proof or c.trial.kind == "random")


def make_grid(top_speed: float, hours: float, seed: int = 0) -> tuple[Trial, ...]:
    """Return the tests to be compared, all of the same duration.

    In the random order every speed occurs once before one occurs again: the order is then independent of trends.

    Parameters
    ----------
    top_speed : float
        Maximum spindle speed of the machine [1/min].
    hours : float
        Duration of each test, after a stop of 15 min [h].
    seed : int
        Seed of the random order of speeds.
    """
    if not 0 < top_speed < np.inf:
        raise InputError(f"top speed {top_speed:g} 1/min: expected the maximum speed of the machine, above 0")
    if not 2 <= hours <= 72:
        raise InputError(f"a test of {hours:g} h: expected 2 to 72 h")
    length = hours * 3600.0
    times = round(length / (2 * SHORT))
    found = []
    for speed in [float(round(share * top_speed)) for share in SPEEDS]:
        steps: dict[Kind, tuple[tuple[float, float], ...]] = {
            "repeated": ((speed, SHORT), (0.0, SHORT)) * times,
            "stop": ((speed, length / 2), (0.0, length / 2)),
            "run": ((speed, length),),
        }
        found += [Trial(kind, speed, ((0.0, REST), *steps[kind])) for kind in KINDS]
    rng = np.random.default_rng(seed)
    orders = [rng.permutation(SPEEDS) for _ in range(-(-times // len(SPEEDS)))]
    drawn = [float(round(share * top_speed)) for share in np.concatenate(orders)[:times]]
    varied = tuple(step for speed in drawn for step in ((speed, SHORT), (0.0, SHORT)))
    found.append(Trial("random", max(drawn), ((0.0, REST), *varied), seed))
    return (*found, Trial("room", 0.0, ((0.0, REST), (0.0, length))))


def plan(
    samples: Samples,
    top_speed: float | None = None,
    *,
    hours: float = 12.0,
    swing: float = 5.0,
    proof: bool = False,
    seed: int = 0,
) -> Plan:
    """Rank possible next tests by their expected benefit.

    The expected error follows from the covariance of the weights of `averaged` (`thermocomp.models.doubt`), over all
    tests of the grid with a changing room temperature. A test reduces the covariance like a regression on its rows: its
    spindle speed is known exactly, its temperatures are predicted from the speed, and the room temperature reaches the
    machine with a lag of 2 h.

    Parameters
    ----------
    top_speed : float, optional
        Maximum spindle speed of the machine [1/min]. Default: the highest recorded speed.
    hours : float
        Duration of a test [h].
    swing : float
        Change of the room temperature within this duration [degC]; 0: the room temperature is constant, and no test of
        its effect is proposed.
    proof : bool
        The next test is that with speeds in a random order.
    seed : int
        Seed of the random order of speeds.
    """
    if seed < 0:
        raise InputError(f"seed {seed}: expected 0 or a positive whole number")
    if not 0 <= swing <= 50:
        raise InputError(f"change of the room temperature {swing:g} degC: expected 0 to 50 degC")
    doubt = find_doubt(samples)
    recorded = float(np.nanmax(np.abs(samples.values[:, doubt.speed])))
    if not recorded:
        raise InputError("the spindle never turned in these recordings: record a run and a stop first, at any speed")
    top_speed = recorded if top_speed is None else top_speed
    grid = [t for t in make_grid(top_speed, hours, seed) if swing or t.kind != "room"]
    ambient = [AMBIENT.search(samples.inputs[j].name) is not None for j in doubt.features.temperatures]
    tables = [_foretell(t, doubt, swing, np.array(ambient)) for t in grid]
    use = _all_that_is_done(grid, tables)
    before = doubt.spread(use)
    gains = [float((before - doubt.after(f, t.duration).spread(use)).mean()) for t, f in zip(grid, tables, strict=True)]
    covered = Covered.of(samples, doubt.speed)
    found = [
        Candidate(t, float(doubt.spread(f).mean()), gain, covered.news(t, top_speed, swing))
        for t, f, gain in zip(grid, tables, gains, strict=True)
    ]
    best = sorted(found, key=lambda c: -c.gain)
    return Plan(
        candidates=tuple(best),
        expected=float(before.mean()),
        top_speed=top_speed,
        hours=hours,
        swing=swing,
        covered=covered,
        proof=proof,
    )


def _all_that_is_done(grid: Sequence[Trial], tables: Sequence[FloatArray]) -> FloatArray:
    """Return rows with the mean square of all spindle tests of the grid with a changing room temperature.

    The room temperature rises as often as it falls, so that the squares of both contributions are added.
    """
    spindle = [f for t, f in zip(grid, tables, strict=True) if t.kind not in ("room", "random")]
    room = [f for t, f in zip(grid, tables, strict=True) if t.kind == "room"]
    rows = sum(map(len, spindle))
    weighed = [f * np.sqrt(rows / len(f)) for f in room]
    both = np.vstack([*spindle, *weighed])
    return np.asarray(both * np.sqrt(len(both) / rows))


def _foretell(trial: Trial, doubt: Doubt, swing: float, ambient: BoolArray) -> FloatArray:
    """Return the predicted features of a planned test, (n_rows, n_features)."""
    speed = np.concatenate([np.full(round(d / _STEP), v) for v, d in trial.steps])
    if trial.kind != "room":
        return doubt.table(speed, _STEP)[::_EVERY]
    time = np.maximum(_STEP * np.arange(len(speed)) - REST, 0.0)
    rate = swing / float(time[-1])
    air, parts = rate * time, rate * (time - LAG * -np.expm1(-time / LAG))
    return doubt.table(speed, _STEP, np.where(ambient, air[:, None], parts[:, None]))[::_EVERY]
