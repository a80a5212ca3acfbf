"""Readings of a drawn machine: warm-ups with every fault of sensors, clocks and sources mixed in."""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from drawnfamilies import TOP
from drawnmodels import OTHERS, SPEED, TACHOMETER, Drawn, Plant
from numpy.typing import NDArray

from thermocomp.core.bounds import GAP
from thermocomp.core.correction import Limits
from thermocomp.core.inputs import Input
from thermocomp.runtime.program.tables import gather

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
Rng = np.random.Generator

DAY = 86400.0
#: a multiple of this is exact at every time of a run, and on a clock that shows a date: equal times are equal
GRID = 1.0 / 64.0
#: a clock is set by so much [s]: far more than any source is silent
SET = 2.0**25
MANY = 615
#: what no sensor of a sound machine reads, and limits at which a decision turns
WILD = (np.nan, np.inf, -np.inf, 1e30, -1e30, 1.1e30, 1e31, -1e308, -0.0, 85.0, -127.0, 150.0, -40.0, 65535.0)
SPEEDS = (np.nan, 65535.0, 6e5, -6e5, 5e5, 1.03 * TOP, -0.5 * TOP, 10.0, -10.0, 10.5, 2.6 * TOP, np.inf)


class Stream(NamedTuple):
    """What a compensator gets, call by call."""

    values: FloatArray  #: (n_calls, n_channels)
    age: FloatArray  #: (n_calls,) [s]
    dt: FloatArray  #: (n_calls,), since the call before [s]
    counter: FloatArray  #: (n_calls,), number of the reading; 0: not numbered
    clock: FloatArray  #: (n_calls,), what the clock of the readings is ahead of the time since the start [s]
    restarts: BoolArray  #: (n_calls,), before it everything but the corrections is forgotten
    stored: BoolArray  #: (n_calls,), before it the state goes through its file
    resumed: BoolArray  #: (n_calls,), before it the program was started again, and goes on from its file

    def part(self, rows: slice | NDArray[np.intp]) -> "Stream":
        """Return some of the calls."""
        return self._replace(**{name: a[rows] for name, a in self._asdict().items()})


def draw_stream(drawn: Drawn, seed: int, count: int) -> Stream:
    """Return calls of a compensator."""
    rng, limits = np.random.default_rng((2, seed)), drawn.compensator.limits
    channels = gather(drawn.compensator).channels
    steady = seed % 3 == 0  # readings of one age: only then a clock that is set is as one that is not
    dt = draw_steps(rng, count, limits, exact=steady or rng.random() < 0.6)
    rest = MANY if seed % 10 == 5 and count > MANY else 0  # more readings at rest than a zero is averaged of
    dt[:rest] = 0.125
    time = np.cumsum(np.where((dt >= 0.0) & (dt <= GAP), dt, 0.0))
    restarts = rng.random(count) < rng.choice([0.0, 0.5 / count, 3.0 / count])
    if seed % 10 != 5:  # early ones, which the slower ways of taking readings see too
        restarts[rng.integers(30, 190, int(rng.integers(0, 3)))] = True
    values = draw_values(rng, drawn.plant, channels, time, rest)
    first = FIRST[seed % len(FIRST)]  # among many others a swap is not found
    more = rng.choice(np.array(DAMAGES, dtype=object), int(rng.integers(0, 2 if first is _swap else 6)))
    for damage in (first, *[_no_start] * (seed % 5 == 3 or seed % 4 == 0), *more):
        with np.errstate(invalid="ignore"):  # infinity less infinity
            damage(rng, values[rest:], channels)
    if seed % 3 == 1:
        _wrong_speed(rng.spawn(1)[0], values[rest:], channels)
    age = draw_ages(rng, dt, limits, steady=steady)
    age[:rest] = 0.0
    clock, resumed = np.zeros(count), np.zeros(count, dtype=np.bool_)
    if steady:
        sets = rng.choice([0.0, 1.0, -1.0], count, p=[0.99, 0.005, 0.005])
        clock = SET * np.cumsum(sets) + rng.choice([0.0, 2.0**31])
        resumed = (rng.random(count) < 3.0 / count) & (dt > 0.0) & (dt <= GAP)
    return Stream(
        values=values,
        age=age,
        dt=dt,
        counter=draw_counter(rng, count) if seed % 2 else np.zeros(count),
        clock=clock,
        restarts=restarts,
        stored=rng.random(count) < 4.0 / count,
        resumed=resumed & ~restarts,
    )


def draw_steps(rng: Rng, count: int, limits: Limits, *, exact: bool) -> FloatArray:
    """Return times between calls: a usual one, with spells of others [s]."""
    usual = float(rng.choice([5.0, 10.0, 20.0, 30.0, 60.0]))
    dt = np.full(count, usual) if rng.random() < 0.5 else usual * rng.uniform(0.2, 2.0, count)
    for _ in range(int(rng.integers(0, 5))):
        span = _spell(rng, count, 0.1)
        dt[span] = float(rng.choice([0.001, GRID, 1.0, 9.984375, 10.0, 300.0, 3600.0])) * rng.choice([1.0, 0.5, 2.0])
    odd = rng.random(count) < rng.choice([0.0, 0.02, 0.1])
    dt[odd] = rng.choice([0.0, 0.0, 600.0, limits.reading_age, 1800.0, 7200.0, limits.hold], int(odd.sum()))
    rare = rng.random(count) < 3.0 / count
    dt[rare] = rng.choice([DAY, 3 * DAY, 30 * DAY, GAP, 0.0, np.nan, -1.0, np.inf, 2 * GAP, -np.inf], int(rare.sum()))
    return np.round(dt / GRID) * GRID if exact else dt


def draw_ages(rng: Rng, dt: FloatArray, limits: Limits, *, steady: bool) -> FloatArray:
    """Return ages of readings: most of them fresh, some late, from the future, or not later than the one before [s]."""
    count, most = len(dt), limits.reading_age
    usual = 0.0 if rng.random() < 0.5 else 0.25
    age = np.full(count, usual)
    if not steady and rng.random() < 0.5:
        age = np.round(rng.uniform(0.0, 1.0, count) / GRID) * GRID
    odd = rng.random(count) < rng.choice([0.0, 0.02, 0.1])
    never = [most + GRID, 2.0 * most, -1.0 - GRID, -30.0, np.nan, np.inf, -np.inf, 1e12]
    late = [0.0, -0.5, -1.0, most, 0.5 * most, most - 1.0, float(rng.uniform(0.0, most)), 1.0 + np.nan_to_num(dt[-1])]
    age[odd] = rng.choice(never if steady else [*never, *late, *late], int(odd.sum()))
    if not steady:  # from as late as may be to as early as may be: as if a clock had been set
        last = rng.integers(0, count - 1, 3)
        age[last], age[last + 1] = most, -1.0
    if not steady and rng.random() < 0.3:  # a source that stops: the same reading, older and older
        span = _spell(rng, count, 0.2)
        age[span] = usual + np.cumsum(np.nan_to_num(dt[span], posinf=0.0, neginf=0.0))
    return age


def draw_counter(rng: Rng, count: int) -> FloatArray:
    """Return numbers of readings: some of several calls, some that stop, some that are not numbered or start again."""
    counter = 1.0 + np.cumsum(rng.random(count) < rng.choice([0.3, 0.95, 1.0]))
    for _ in range(int(rng.integers(0, 4))):
        span = _spell(rng, count, 0.1)
        counter[span] = counter[span.start]
    span = _spell(rng, count, 0.1)
    counter[span] = rng.choice([0.0, -1.0, 2e12])
    return counter


def draw_values(rng: Rng, plant: Plant, channels: Sequence[Input], time: FloatArray, rest: int = 0) -> FloatArray:
    """Return the readings of a machine without faults, of which at least `rest` are at rest."""
    count = len(time)
    speed = _levels(rng, count, [0.0, 0.0, 0.3 * TOP, 0.6 * TOP, TOP], quiet=rng.random() < 0.6)
    speed[:rest], heat = 0.0, np.zeros(count)
    for k in range(1, count):
        share = abs(speed[k]) / TOP
        pace = 1.0 / plant.slow + share * (1.0 / plant.fast - 1.0 / plant.slow)
        heat[k] = heat[k - 1] - np.expm1(-pace * (time[k] - time[k - 1])) * (share**plant.power - heat[k - 1])
    room = 3.0 * (np.sin(time / DAY * 2 * np.pi + rng.uniform(0.0, 6.0)) - np.sin(rng.uniform(0.0, 6.0)))
    room -= room[0]
    step = float(rng.choice([0.0, 0.01, 0.1, 0.0625]))  # of the display
    table = np.zeros((count, len(channels)))
    for c, channel in enumerate(channels):
        if channel.quantity == "temperature":
            k = int(channel.name[1:-2])
            warm = plant.zero[k] + plant.heat[k] * heat + plant.room[k] * room + rng.normal(0.0, 0.02, count)
            table[:, c] = np.round(warm / step) * step if step else warm
        elif channel.name in (SPEED, TACHOMETER):
            table[:, c] = speed
        else:
            low, high = OTHERS[channel.name][2:]
            ends = [low, high, 0.5 * (low + high), low + 1.3 * (high - low)]
            table[:, c] = _levels(rng, count, ends, quiet=False) + rng.choice([0.0, 0.01 * (high - low)]) * rng.normal(
                0.0, 1.0, count
            )
    return table


def _levels(rng: Rng, count: int, levels: Sequence[float], *, quiet: bool) -> FloatArray:
    """Return values that stay for a while; `quiet`: the first one stays for some time."""
    found, k = np.empty(count), 0
    while k < count:
        end = k + int(rng.integers(1, max(count // 6, 2)))
        found[k:end] = levels[0] if quiet and k == 0 else rng.choice(levels)
        k = end
    return found


def _spell(rng: Rng, count: int, most: float) -> slice:
    begin = 0 if rng.random() < 0.1 else int(rng.integers(0, count))
    return slice(begin, begin + 1 + int(rng.integers(0, max(int(most * count), 1))))


# -- what goes wrong with sensors --------------------------------------------------------------------------------------

Damage = Callable[[Rng, FloatArray, Sequence[Input]], None]


def _heat(channels: Sequence[Input]) -> list[int]:
    return [k for k, c in enumerate(channels) if c.quantity == "temperature"]


def _wild(rng: Rng, values: FloatArray, channels: Sequence[Input]) -> None:
    hit = rng.random(values.shape) < rng.choice([0.002, 0.02])
    values[hit] = rng.choice(WILD, int(hit.sum()))


def _missing(rng: Rng, values: FloatArray, channels: Sequence[Input]) -> None:
    values[_spell(rng, len(values), 0.3), rng.choice(_heat(channels))] = np.nan


def _one_missing_value(rng: Rng, values: FloatArray, channels: Sequence[Input]) -> None:
    values[_spell(rng, len(values), 0.05), rng.integers(len(channels))] = np.nan


def _all_fail(rng: Rng, values: FloatArray, channels: Sequence[Input]) -> None:
    some = _heat(channels) if rng.random() < 0.5 else list(range(len(channels)))
    values[_spell(rng, len(values), 0.1), some] = rng.choice([np.nan, 0.0, 1e30])


def _stuck(rng: Rng, values: FloatArray, channels: Sequence[Input]) -> None:
    span, k = _spell(rng, len(values), 0.6), rng.choice(_heat(channels))
    values[span, k] = values[span.start, k]


def _all_stuck(rng: Rng, values: FloatArray, channels: Sequence[Input]) -> None:
    span = _spell(rng, len(values), 0.2)
    values[span] = values[span.start]


def _jump(rng: Rng, values: FloatArray, channels: Sequence[Input]) -> None:
    span, k = _spell(rng, len(values), float(rng.choice([0.01, 0.7]))), rng.choice(_heat(channels))
    values[span, k] += rng.normal(0.0, 6.0)


def _spikes(rng: Rng, values: FloatArray, channels: Sequence[Input]) -> None:
    hit = np.flatnonzero(rng.random(len(values)) < 0.03)
    values[hit, rng.choice(_heat(channels), len(hit))] += rng.uniform(-8.0, 8.0, len(hit))


def _drift(rng: Rng, values: FloatArray, channels: Sequence[Input]) -> None:
    span, k = _spell(rng, len(values), 0.8), rng.choice(_heat(channels))
    values[span, k] += np.linspace(0.0, rng.normal(0.0, 8.0), len(values[span]))


def _swap(rng: Rng, values: FloatArray, channels: Sequence[Input]) -> None:
    heat = _heat(channels)
    if len(heat) > 1:  # each zero was read at its own terminal
        a, b = rng.choice(heat, 2, replace=False).tolist()
        later = slice(0 if rng.random() < 0.7 else int(rng.integers(len(values))), None)
        values[later, [a, b]] = values[0, [a, b]] + (values[later] - values[0])[:, [b, a]]


def _strange_speeds(rng: Rng, values: FloatArray, channels: Sequence[Input]) -> None:
    for k, c in enumerate(channels):
        if c.quantity == "spindle_speed":
            for _ in range(3):
                values[_spell(rng, len(values), 0.03), k] = rng.choice(SPEEDS)


def _wrong_speed(rng: Rng, values: FloatArray, channels: Sequence[Input]) -> None:
    """Let the speed that heats the machine read 0, half, in 1/s, or always the same; now and then it is missing."""
    for k, c in enumerate(channels):
        if c.name == SPEED:
            later, short = slice(int(rng.integers(0, len(values) // 2)), None), _spell(rng, len(values), 0.1)
            right = values[later, k].copy()
            same = np.ones_like(right)
            wrong = [0.0 * same, right / 2, right / 60, right[0] * same, 2.5 * TOP * same]
            values[later, k] = wrong[int(rng.integers(len(wrong)))]
            values[short, k] = np.nan


def _no_start(rng: Rng, values: FloatArray, channels: Sequence[Input]) -> None:
    """Read at the start what a machine rarely has: all far from the training, or half of them or one off the others."""
    heat, rows = _heat(channels), slice(0, int(rng.integers(1, 30)))
    one = int(rng.choice(heat))
    span, share = max(channels[one].high - channels[one].low, 42.0), rng.random()
    some = heat if share < 0.4 else heat[: len(heat) // 2] if share < 0.5 else [one]
    values[rows, some] += rng.choice([-25.0, 16.0, 40.0, 200.0, -1.5 * span])


def _outlier_at_the_start(rng: Rng, values: FloatArray, channels: Sequence[Input]) -> None:
    values[rng.integers(0, min(4, len(values))), rng.choice(_heat(channels))] += rng.choice([-4.0, 0.5, 3.0])


def _hot_or_cold(rng: Rng, values: FloatArray, channels: Sequence[Input]) -> None:
    span, some = _spell(rng, len(values), 0.2), _heat(channels)
    values[span, some if rng.random() < 0.5 else some[:1]] += rng.choice([-30.0, -8.0, 8.0, 15.0, 60.0])


DAMAGES: tuple[Damage, ...] = (
    _wild,
    _missing,
    _missing,
    _one_missing_value,
    _all_fail,
    _stuck,
    _stuck,
    _all_stuck,
    _jump,
    _jump,
    _spikes,
    _spikes,
    _drift,
    _drift,
    _swap,
    _strange_speeds,
    _no_start,
    _outlier_at_the_start,
    _outlier_at_the_start,
    _hot_or_cold,
)
#: one of them is part of every stream
FIRST: tuple[Damage, ...] = (_wild, _jump, _stuck, _swap)
