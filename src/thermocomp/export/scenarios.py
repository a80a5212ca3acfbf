"""Readings of the test vectors: a story with faults, whose parts were chosen by the branches and mutants they show."""

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np

from thermocomp.export.vectors import DAMAGED, NOTHING, RETAINED, REZERO, TOLD_COLD, FloatArray, Readings
from thermocomp.export.warming import Warming
from thermocomp.runtime.program.tables import Tables

Spoil = Callable[[int, FloatArray], object]


def make_readings(tables: Tables) -> Readings:
    """Return readings that exercise all functions of a compensator, at most 1,500.

    Starts at rest, warm, on an unknown day, and with values that are missing or impossible; warm-ups at changing
    speeds; each value missing, erratic or impossible for a while; clocks that stand, jump or are invalid; a source that
    stops until the corrections fade, repeats its values, or does not count on; sensors that are lost together, swapped,
    coarse, noisy, or stick, step and drift, alone and in pairs; speeds that are stuck, halved or 0; values beyond the
    trained range; power-ups with a retained state, without one, and with one that cannot be used.
    """
    story = _Story(tables)
    _warm_up(story)
    _disturb(story)
    for start in _STARTS:
        _start_strangely(story, start)
    if tables.sensors:
        _lose(story)
        _jump(story)
        _stick(story)
        _coarsen(story)
        for first, second in ((0, -1), (0, 1), (1, 2)):
            _swap(story, first, second)
        for share in (0.0, 0.5):
            _mislead(story, share)
        _drift(story)
    _repeat(story)
    _switch(story)
    return story.readings()


class _Story:
    """Readings so far, and the machine that shows them.

    Parameters
    ----------
    tables : Tables
        Tables of the compensator.
    """

    def __init__(self, tables: Tables) -> None:
        self.tables, self.rows = tables, list[tuple[FloatArray, float, float, float]]()
        self.events: dict[int, tuple[int, float]] = {}
        self.age, self.hold, self.fade = (float(tables.values[n]) for n in ("reading_age", "hold", "fade"))
        self.pace = min(60.0, max(self.age, 10.0))  # a block retains its state every ten seconds
        self._rng = np.random.default_rng(0)
        self.machine = Warming(tables)
        self.heat = np.flatnonzero(self.machine.heat)
        self.others = np.flatnonzero(~self.machine.heat)
        watched = np.array(tables.values["sensor_channel"] if tables.sensors else self.heat, dtype=int)
        moves = (self.machine.high - self.machine.low)[watched]
        #: channels of the temperatures, those that move most first
        self.sensors = watched[np.argsort(-moves, kind="stable")].tolist()

    def order(self, event: int, amount: float = 0.0) -> None:
        """Let something happen before the next call."""
        self.events[len(self.rows)] = event, amount

    def add(self, values: FloatArray, dt: float, old: float = 0.0, counter: float = 0.0) -> None:
        """Add a reading, with noise of the temperatures."""
        noise = np.where(self.machine.heat, 0.002 * self._rng.standard_normal(len(values)), 0.0)
        self.rows.append((np.round(values + noise, 4), old, dt, counter))

    def run(self, calls: int, share: float | Sequence[float], spoil: Spoil | None = None, dt: float = 0.0) -> None:
        """Run at fractions of the top speed, one after the other; values may be spoiled."""
        dt, shares = dt or self.pace, [share] if isinstance(share, (int, float)) else share
        for k in range(calls):
            values = self.machine.run(shares[k * len(shares) // calls], dt)
            if spoil:
                spoil(k, values)
            self.add(values, dt)

    def cold(self, calls: int = 6, spoil: Spoil | None = None) -> None:
        """Start on a cold machine."""
        self.machine = Warming(self.tables)
        self.order(TOLD_COLD)
        self.run(calls, 0.0, spoil)

    def readings(self) -> Readings:
        """Return all readings."""
        values, ages, steps, counters = (np.array([r[k] for r in self.rows], dtype=np.float64) for k in range(4))
        orders = np.array([self.events.get(k, (NOTHING, 0.0)) for k in range(len(self.rows))])
        return Readings(
            values=values, age=ages, dt=steps, counter=counters, event=orders[:, 0].astype(int), amount=orders[:, 1]
        )


def _share(k: int) -> float:
    """Return the fraction of top speed at a step of a test."""
    return (0.0, 1.0, 0.4, 0.8)[k // 10 % 4]


def _turn(story: _Story, minutes: int) -> None:
    for k in range(minutes):
        story.add(story.machine.run(_share(k), 60.0), 60.0)


def _warm_up(story: _Story) -> None:
    """Start at rest, with two impossible speeds; warm up; make each value wild for a while, until it is trusted."""
    machine, back = story.machine, story.tables.models[0].thresholds.return_time
    story.order(TOLD_COLD)
    for k in range(45):
        rest = machine.run(0.0, 10.0)
        story.add(np.where(machine.heat | (k not in (5, 6)), rest, 1e9), 10.0, 0.5)
    for k in range(120):
        dt = 60.0 if k % 3 else 12.0
        story.add(machine.run(_share(k), dt), dt, 0.25)
    story.order(RETAINED, 1800.0)
    for c in np.array_split(np.arange(len(machine.rest)), min(len(machine.rest), 30)):
        for wild in (math.nan, math.inf, -127.0, 85.0, 1e9):
            values = machine.run(0.8, 15.0)
            values[c] = wild
            story.add(values, 15.0)
        story.run(4, 0.8, dt=back / 3)


def _disturb(story: _Story) -> None:
    """Let the clock be wrong, the source stop and return, and values leave the trained range."""
    machine, age = story.machine, story.age
    _turn(story, 30)
    warm = machine.run(0.8, 10.0)
    edge = age if age == round(age) else 0.5 * age
    for old in (age + 1.0, edge, -2.0, 30.0, 5.0, math.nan):
        story.add(warm, 10.0, old)
    for dt in (math.nan, -1.0, 0.0, 2e10, 10.0):
        story.add(warm, dt)
    for old, dt in ((-1.0, 10.0), (edge, age + 40.0), (0.5, 10.0), (edge, 2.0), (0.0, 10.0)):
        story.add(machine.run(0.8, dt), dt, old)
    # no readings: until just before and just after the end of the hold time, then while corrections fade
    held = math.ceil(min(max(story.hold / age, 1.0), 100.0))
    waits = (
        [0.998 * story.hold / held] * held + [0.004 * story.hold] + [age] * math.ceil(min(3.0 * story.fade / age, 30.0))
    )
    for dt in waits:
        story.rows.append((story.rows[-1][0], story.rows[-1][1] + dt + age, dt, 0.0))
        machine.run(0.0, dt)
    story.add(machine.rest, 1e6)
    for share, dt in _THERE_AND_BACK:
        story.add(machine.run(share, dt), dt)
    for k in range(24):
        story.add(machine.run(0.5, 20.0) + 1.3 * (machine.high - machine.low) * math.sin(k / 4), 20.0)
    _turn(story, 5)


#: (fraction of top speed, time step [s]) that moves corrections up and down at their rate limit
_THERE_AND_BACK = [(1.0, 7.0)] * 8 + [(1.0, 600.0)] * 8 + [(0.0, 4 * 3600.0)] + [(0.0, 7.0)] * 8
#: offset [degC] of temperatures at a start, by their number, and values of single ones
_STARTS: list[tuple[Callable[[int], float], dict[int, float]]] = [
    (lambda i: 1.5 * (i * 7 % 5 - 2), {0: math.nan, 1: 100.0, 2: -41.0, 3: 151.0, 4: 80.0}),
    (lambda i: 17.0 + 0.1 * (i * 5 % 7), {}),
    (lambda i: -17.0 + 0.1 * (i * 5 % 7), {1: 100.0}),
    (lambda i: 3.0 if i % 2 else 25.0, {0: 22.0, 2: math.nan}),
    (lambda i: 9.0 if i < 3 else 1.0, {}),
    (lambda i: -9.0 if i < 2 else 0.1 * (i * 5 % 7), {}),
    (lambda i: -2.0 if i % 2 else 2.0, {}),
    (lambda i: 0.3 * (i * 5 % 7), {0: -40.0, 1: 150.0, 2: math.nan}),
    (lambda i: 0.3 * (i * 5 % 7), {0: -40.0, 3: 90.0}),
]


def _start_strangely(story: _Story, start: tuple[Callable[[int], float], dict[int, float]]) -> None:
    """Start on another day or a warm machine, with values that are no temperatures, and with a speed that is none."""
    day, wild = start

    def spoil(k: int, values: FloatArray) -> None:
        for i, c in enumerate(story.sensors):
            values[c] = wild.get(i, values[c] + day(i)) if k < 3 else values[c] + day(i)
        if k in (1, 2) and 2 in wild:
            values[story.others] = (math.nan, 1e6)[k - 1]

    story.cold(7, spoil)
    for row in story.rows[-7:-4]:  # without noise
        for i, value in wild.items():
            row[0][story.sensors[i : i + 1]] = value
    if story.tables.sizes["has_speed"] and not wild:  # it just stands, and turns slowly
        for k, row in enumerate(story.rows[-7:]):
            row[0][story.tables.values["speed_channel"]] = story.tables.values["stopped_speed"] * (1.0 + 0.5 * (k > 4))
    story.run(2, 1.0, lambda _, values: spoil(9, values))


def _hide(channels: Any, _: int, values: FloatArray) -> None:
    values[channels] = math.nan


def _lose(story: _Story) -> None:
    """Lose several sensors at once, at last all and the speeds."""
    story.cold()
    story.run(10, (1.0, 0.5))
    groups = [story.sensors[:k] for k in (2, 3, 4, 5)] + [story.sensors[-k:] for k in (2, 4)]
    for lost in groups:
        story.run(2, 0.7, partial(_hide, lost))
        story.run(4, 0.7, dt=250.0)
    story.run(3, 0.7, partial(_hide, story.sensors))
    story.run(2, 0.7, lambda _, values: values.fill(math.nan))
    story.run(2, 0.7, partial(_hide, story.others))
    story.run(5, 0.7)


def _jump(story: _Story) -> None:
    """Let readings jump by just more and just less than the limit, for long and for one reading."""
    story.cold()
    limit = dict(zip(story.tables.values["sensor_channel"], story.tables.values["jump_limit"], strict=True))

    def jump(k: int, values: FloatArray) -> None:
        for i, c in enumerate(story.sensors):
            values[c] += limit[c] * (1.05 if i % 3 == 0 else 0.9 if i % 3 == 1 else 1.05 * (k < 2))

    story.run(4, (0.0, 0.3))
    story.run(9, 0.3, jump)
    story.run(2, 0.3, jump, dt=150.0)
    story.run(3, 0.3)


def _stick(story: _Story) -> None:
    """Let sensors stick: from the start and in a warm-up, and at rest."""
    one, other, third = (story.sensors[k % len(story.sensors)] for k in range(3))
    begin = len(story.rows)
    story.cold()
    story.run(36, (0.3, 1.0, 1.0))
    story.cold()
    story.run(26, 0.0)
    rows = [row[0] for row in story.rows[begin:]]  # without noise
    for k in range(42):
        rows[k][other] = 21.5
        rows[k][one] = rows[min(k, 18)][one]
    for row in rows[50:]:
        row[third] = rows[49][third]


def _coarsen(story: _Story) -> None:
    """Show temperatures as rounded by a coarse converter; one sticks."""
    for digit in (0.5, 2.0):
        story.cold()
        story.run(22, (0.3, 1.0))
        rows = [row[0] for row in story.rows[-28:]]
        for k, values in enumerate(rows):
            values[story.sensors] = np.round(values[story.sensors] / digit) * digit
            values[story.sensors[0]] = rows[min(k, 14)][story.sensors[0]]


def _swap(story: _Story, first: int, second: int) -> None:
    """Exchange two sensors from the start."""
    one, other = story.sensors[first % len(story.sensors)], story.sensors[second % len(story.sensors)]

    def swap(_: int, values: FloatArray) -> None:
        values[[one, other]] = values[[other, one]]

    story.cold(6, swap)
    story.run(24, (1.0, 0.6), swap)


def _mislead(story: _Story, share: float) -> None:
    """Show a fraction of the speed, then none, and the true one for long."""
    story.cold()
    story.run(10, 1.0)
    story.run(26, 1.0, lambda _, values: values.__setitem__(story.others, share * values[story.others]))
    story.run(2, 1.0, partial(_hide, story.others))
    story.run(3, 1.0)
    story.run(20 if share else 52, 1.0, dt=600.0)
    story.run(3, (1.3, 2.5, float(story.tables.values["least_share"])))


def _drift(story: _Story) -> None:
    """Let one sensor drift and another be noisy; they return."""
    story.cold()
    story.run(8, 1.0)
    story.run(1, 1.1)

    def drift(k: int, values: FloatArray) -> None:
        values[story.sensors[2 % len(story.sensors)]] += 0.2 * k
        values[story.sensors[-1]] += 3.0 * (k % 2)
        if k > 12:
            values[story.sensors[3 % len(story.sensors)]] = math.nan

    story.run(26, (1.0, 0.5), drift, dt=200.0)
    story.run(16, 0.9, dt=300.0)


def _repeat(story: _Story) -> None:
    """Let a source repeat its values: as it always does, some of them, then for too long; its counter stands."""
    story.cold()
    slow = story.pace / 3.0
    for k in range(24):
        story.run(1, _share(k), dt=slow)
        if k % 5 == 0:  # a single temperature changes
            story.rows.append((story.rows[-1][0].copy(), 0.0, slow, 0.0))
            story.rows[-1][0][story.heat[:1] if k % 2 else story.heat[-1:]] += 0.05
        story.rows.append((story.rows[-1][0], 0.0, slow, 0.0))
    for k in range(36):
        story.rows.append((story.rows[-1][0].copy(), 0.0, slow, 0.0))
        if story.tables.sensors:  # in two ways not a number: that is no change
            story.rows[-1][0][story.sensors[-1]] = math.nan if k < 18 else math.inf
    story.run(3, 0.5)
    story.cold()
    story.run(4, 0.0)
    for _ in range(14):
        values = story.rows[-1][0].copy()
        values[story.others] = story.machine.run(1.0, story.pace)[story.others]
        story.rows.append((values, 0.0, story.pace, 0.0))
    story.run(3, 0.5)
    for k in range(12):
        counter = 7.0 + (k > 0) + max(k - 8, 0)  # the first shows nothing
        story.add(story.machine.run(0.8, story.age / 3), story.age / 3, counter=counter)


def _switch(story: _Story) -> None:
    """Switch the controller off and on; re-zero targets."""
    day, cold = float(story.tables.values["resumable"]), float(story.tables.values["cold_after"])
    short, last = min(1800.0, 0.9 * cold), REZERO + len(story.tables.targets) - 1
    story.run(1, 0.6)
    for event, amount, calls, shares in (
        (RETAINED, 1800.0, 4, 0.6),
        (RETAINED, story.hold + 1.0, 3, 0.6),
        (RETAINED, story.hold, 3, 0.6),
        (RETAINED, 0.0, 3, 0.6),  # for an unknown time
        (REZERO, -7.0, 6, 0.6),
        (last, 4.0, 1, 0.6),
        (REZERO, math.inf, 1, 0.6),
        (last + 1, 5.0, 2, 0.6),
        (RETAINED, 60.0, 3, 0.6),
        (DAMAGED, short, 2, 0.0),
        (last, 3.0, 8, 0.0),
        (TOLD_COLD, 0.0, 6, (0.3, 0.9, 0.5)),
        (RETAINED, day, 3, 0.6),
        (RETAINED, max(day, cold) + 1.0, 6, 0.6),
        (RETAINED, story.hold + 30.0, 0, 0.6),
    ):
        story.order(event, amount)
        story.run(calls, shares)
    for _ in range(3):  # nothing usable for too long after a power-up: the axes may be in use
        story.add(story.machine.run(0.6, story.pace), 0.6 * story.age, 2.0 * story.age)
    story.run(2, 0.2)
    for share in (1.0, 0.5):  # of the time after which the axes may be in use; then a step is above the rate
        story.order(RETAINED, story.hold + 30.0)
        story.add(story.machine.run(0.6, share * story.age), share * story.age, 2.0 * story.age)
        story.run(2, 0.2, dt=story.age / 6.0)
    for amount, calls in ((short, 2), (cold, 2), (1.01 * cold, 6), (math.inf, 2)):
        story.order(DAMAGED, amount)
        story.run(calls, 0.6)
