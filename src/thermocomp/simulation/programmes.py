"""What is done in each experiment, as data."""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from thermocomp.simulation.climate import STABLE, STILL, Climate
from thermocomp.simulation.instruments import HWANG_PLACES, NEST, PLACES, USUAL_PLACES, Y_POSITIONS, Z_POSITIONS

HOUR = 3600.0
MINUTE = 60.0


@dataclass(frozen=True)
class Segment:
    """A stretch of a test with one speed.

    Parameters
    ----------
    duration : float
        [s]
    speed : float
        [1/min]
    feed : tuple of float
        Mean feed rates of X, Y, Z [mm/min].
    """

    duration: float
    speed: float = 0.0
    feed: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Programme:
    """One test: what is done, and what is recorded.

    Parameters
    ----------
    name : str
    sampling : float
        Time between two rows [s].
    segments : tuple of Segment
        Each lasts a whole number of samplings.
    climate : Climate
    places : tuple of str
        Of the temperature sensors, keys of `PLACES`.
    probes : tuple of str
        Keys of `PROBES`.
    cooled : bool
        The coolant loop runs.
    perfect : bool
        Sensors without lag, bias, noise and steps: a calculation, not a measurement.
    soak : float
        Time at rest before the test [s].
    """

    name: str
    sampling: float
    segments: tuple[Segment, ...]
    climate: Climate = field(default_factory=Climate)
    places: tuple[str, ...] = tuple(PLACES)
    probes: tuple[str, ...] = NEST
    cooled: bool = True
    perfect: bool = False
    soak: float = 12 * HOUR


@dataclass(frozen=True)
class Experiment:
    """A named experiment.

    Parameters
    ----------
    description : str
        One line.
    programmes : callable
        From a random generator (orders and speeds drawn by lot) to the tests.
    """

    description: str
    programmes: Callable[[np.random.Generator], list[Programme]]


#: mean feed rates of X, Y, Z while the axes of Chen's machine move with the running spindle [mm/min]
_MOVING = (600.0, 1000.0, 600.0)


def _chen(name: str, speed: float, run: float, stop: float, sampling: float = 6 * MINUTE) -> Programme:
    # One row before the start: 162 rows a test, five tests make Chen's 810 (C-14).
    segments = (Segment(sampling), Segment(run, speed, _MOVING), Segment(stop))
    return Programme(name, sampling, segments)


def _chen_fit(_: np.random.Generator) -> list[Programme]:
    return [_chen(f"chen1996-{n}", n, 6 * HOUR, 10 * HOUR) for n in (600, 1000, 1500, 2100, 2600)]


def _random_cycles(n: int, rng: np.random.Generator) -> tuple[Segment, ...]:
    """Return 30 min of a random speed and 15 min of stop, again and again (C-32)."""
    speeds = 50.0 * rng.integers(12, 53, size=n)  # 600 ... 2600 1/min
    return tuple(s for n in speeds for s in (Segment(30 * MINUTE, float(n), _MOVING), Segment(15 * MINUTE)))


def _chen_new(rng: np.random.Generator) -> list[Programme]:
    constant = _chen("chen1996-1250", 1250.0, 6.5 * HOUR, 5.5 * HOUR)
    cycles = _random_cycles(12, rng)
    return [constant, Programme("chen1996-random", 3 * MINUTE, (Segment(3 * MINUTE), *cycles))]


def _chen_slope(_: np.random.Generator) -> list[Programme]:
    segments = (Segment(20 * MINUTE), Segment(6 * HOUR, 2100.0, _MOVING), Segment(10 * HOUR + 20 * MINUTE))
    probes = tuple(f"y_laser_{p}" for p in Y_POSITIONS)
    return [Programme("chen1996-slope", 20 * MINUTE, segments, probes=probes)]


def _wessel_fem(_: np.random.Generator) -> list[Programme]:
    # Two regimes of rotation, 199 rows each (W-06); the second stays within what the first one trains (W-07).
    regimes = {
        "reference": ((1500, 30), (0, 15), (2800, 33), (1200, 20), (0, 25), (3000, 30), (0, 45)),
        "test": ((2200, 35), (0, 20), (1000, 28), (2900, 25), (1800, 30), (0, 60)),
    }
    return [
        Programme(
            f"wessel-fem-{name}",
            100.0,
            tuple(Segment(100.0 * rows, float(speed)) for speed, rows in regime),
            climate=STILL,
            places=("front_seat", "housing", "headstock_front"),
            probes=("y1", "z"),
            cooled=False,
            perfect=True,
        )
        for name, regime in regimes.items()
    ]


def _hwang(rng: np.random.Generator) -> list[Programme]:
    conditions = [(0.0, 0.0), (600.0, 508.0), (3000.0, 2006.0)] * 4
    order = [conditions[k] for k in rng.permutation(len(conditions))]
    # Body-diagonal motion: the three axes share the feed.
    segments = tuple(Segment(30 * MINUTE, speed, (feed / 3**0.5,) * 3) for speed, feed in order)
    return [Programme("hwang", 10 * MINUTE, segments, places=HWANG_PLACES, probes=("z",))]


def _cycles(speeds: tuple[float, ...], run: float, stop: float) -> tuple[Segment, ...]:
    # The axes stand still, as in the spindle test of ISO 230-3.
    return tuple(s for n in speeds for s in (Segment(run, n), Segment(stop)))


def _stepwise(_: np.random.Generator) -> list[Programme]:
    cycles = _cycles((1500.0, 3000.0, 800.0, 2200.0), 3.5 * HOUR, 2.5 * HOUR)
    return [Programme("stepwise2017", 5 * MINUTE, (Segment(30 * MINUTE), *cycles), probes=("x1",))]


def _precompensation(rng: np.random.Generator) -> list[Programme]:
    # Speeds of milling jobs: none lasts long; the verification draws new ones (P-05).
    programmes = []
    for name, jobs in (("identification", 24), ("verification", 18)):
        speeds = 100.0 * rng.integers(5, 34, size=jobs)
        speeds[rng.random(jobs) < 0.2] = 0.0
        lengths = 5.0 * MINUTE * rng.integers(2, 7, size=jobs)
        segments = tuple(
            Segment(float(d), float(n), _MOVING if n else (0.0, 0.0, 0.0)) for d, n in zip(lengths, speeds, strict=True)
        )
        probes = tuple(f"z_at_{p}" for p in Z_POSITIONS)
        programmes.append(
            Programme(f"precompensation-{name}", 1 * MINUTE, segments, STABLE, places=USUAL_PLACES, probes=probes)
        )
    return programmes


def _etve(_: np.random.Generator) -> list[Programme]:
    return [Programme("etve", 1 * MINUTE, (Segment(24 * HOUR),))]


def _random(rng: np.random.Generator) -> list[Programme]:
    return [Programme("random", 1 * MINUTE, (Segment(15 * MINUTE), *_random_cycles(16, rng)))]


def _demo(_: np.random.Generator) -> list[Programme]:
    cycles = _cycles((1200.0, 2800.0, 800.0, 2000.0, 3200.0, 2400.0), 2.75 * HOUR, 2.25 * HOUR)
    return [Programme("demo", 20.0, (Segment(15 * MINUTE), *cycles), places=USUAL_PLACES)]


EXPERIMENTS: dict[str, Experiment] = {
    "chen1996": Experiment("five speeds, each 6 h warm-up and 10 h cool-down: 810 rows (C-14)", _chen_fit),
    "chen1996-new": Experiment("1250 1/min for 6.5 h, and random speeds for 9 h: unseen ones (C-32)", _chen_new),
    "chen1996-slope": Experiment("51 laser profiles of Y during a warm-up and cool-down (C-23)", _chen_slope),
    "wessel-fem": Experiment("spindle without sensor errors, two regimes of 199 rows (W-06)", _wessel_fem),
    "hwang": Experiment("stop, low and high speed in random order, 14 sensors, 37 rows (H-08, H-09)", _hwang),
    "stepwise2017": Experiment("24 temperatures and X over four cycles (T-01)", _stepwise),
    "precompensation": Experiment(
        "varying speeds, Z at four positions, identification and verification", _precompensation
    ),
    "etve": Experiment("spindle at rest for 24 h: environmental temperature variation error (ISO 230-3)", _etve),
    "random": Experiment("30 min of a random speed, 15 min of stop, for 12 h", _random),
    "demo": Experiment("six thermal cycles of different speeds in a changing environment", _demo),
}
