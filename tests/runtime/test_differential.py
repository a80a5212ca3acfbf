"""One differential test over all implementations of the compensator, on what is drawn from a seed.

Compared with each other over the same readings: numpy, step by step (`Compensator.step`), and the program as machine
code, as C by each compiler with sanitizers, and as structured text. The program has no probings and no bands: these are
compared between numpy, step by step, and the replay of a whole test (`runtime.batch`, behind the compiled watch); and
`Fleet` with as many compensators as it has machines. Decisions are equal; numbers to rounding.
"""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from compiledblock import COMPILERS
from drawnmodels import draw_alone, draw_compensator, draw_fleet
from drawnreadings import DAMAGES, Stream, draw_stream, draw_values
from fourways import CCode, MachineCode, Said, StructuredText, run_numpy
from numpy.typing import NDArray
from watchedmachine import watched_model

from thermocomp.core.autoregressive import Ticking
from thermocomp.core.reading import Reading
from thermocomp.core.ticker import EARLY
from thermocomp.files.modelfile import FAMILIES
from thermocomp.judging.watchrun import run_watch
from thermocomp.runtime import batch
from thermocomp.runtime.adaptation import Probing
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.fleet import Fleet
from thermocomp.runtime.program.tables import Tables, gather
from thermocomp.runtime.watchstate import WORDS

FloatArray = NDArray[np.float64]
#: of an ordinary run, and of a long one: seeds of compensators, and readings of each; 34, 38 and 42 find planted faults
#: that the others do not: in the return of a sensor, in the rate of a fade, and in the exclusion of swaps; 27 and 31
#: add speeds that are wrong or missing, and a swap; 46, 146 and 166 many temperatures, of which several fail
SHORT, LONG = ((*range(1, 14), 27, 31, 34, 38, 42, 46, 102, 129, 146, 166), 640), (range(1000, 1200), 5000)
#: of an ordinary run in structured text
IN_TEXT = (range(1, 6), 200)
#: smallest difference that counts [um]
FLOOR = 1e-9


def seeds(short: Sequence[int], long: range) -> list[object]:
    """Return the seeds of an ordinary run, and of a long one."""
    return [*short, *(pytest.param(s, marks=pytest.mark.long) for s in long)]


@cache
def expected(seed: int, count: int) -> tuple[Compensator, Tables, Stream, Said]:
    """Return a compensator, its readings, and what numpy makes of them."""
    drawn = draw_compensator(seed)
    tables, stream = gather(drawn.compensator), draw_stream(drawn, seed, count)
    return drawn.compensator, tables, stream, run_numpy(drawn.compensator, tables, stream)


def check(seed: int, way: type, *args: object, count: int, first: int | None = None, within: float = 1e-12) -> None:
    """Hold one way of taking readings against numpy, and show the shortest stream found on which they differ."""
    compensator, tables, stream, said = expected(seed, count)
    other = way(tables, *args)

    def differ(rows: NDArray[np.intp]) -> bool:
        shorter = stream.part(rows)
        one = run_numpy(compensator, tables, shorter)
        return bool(find_apart(tables, shorter, one, other.run(shorter), within).size)

    stream, said = stream.part(slice(first)), Said(said.decisions[:first], said.numbers[:first])
    found = other.run(stream)
    apart = find_apart(tables, stream, said, found, within)
    if apart.size:
        k, rows = int(apart[0]), shrink(differ, np.arange(apart[0] + 1))
        pytest.fail(
            f"{way.__name__}{args} of seed {seed} differs from numpy at reading {k} of {count} ({apart.size} in all)\n"
            f"models: {[m.family for m in tables.models]}, watched: {tables.sensors}, {compensator.limits}\n"
            f"status, faults, rejected, outside: {said.decisions[k]} != {found.decisions[k]}\n"
            f"corrections, slopes, deviations: {said.numbers[k]} != {found.numbers[k]}\n"
            f"also after these readings alone: {rows.tolist()}\n{stream.part(rows[-3:])}"
        )


def find_apart(tables: Tables, stream: Stream, one: Said, other: Said, within: float) -> NDArray[np.intp]:
    """Return the calls after which two ways have decided differently, or have other numbers."""
    clocks = [m.interval for m in tables.models if isinstance(m, Ticking)]
    # a value that ticks is as exact as the time, and as a tick that may be made early: it changes by its size in a tick
    total = np.nansum(stream.dt, where=np.isfinite(stream.dt))
    steep = (20.0 * np.spacing(total) / min(clocks) + 2.0 * EARLY) * np.abs(one.numbers).max() if clocks else 0.0
    allowed = np.maximum(FLOOR + steep, within * np.abs(one.numbers))
    same = (np.abs(one.numbers - other.numbers) <= allowed).all(axis=1)
    decisions = one.decisions == other.decisions
    several = len({m.inputs for m in tables.models}) > 1
    if several:  # which of several reasons for a rejection comes first
        decisions[:, -2] |= np.minimum(one.decisions[:, -2], other.decisions[:, -2]) >= 2
    if len({m.support.margin for m in tables.models}) > 1:  # until a zero is known, models of fewer margins run
        waiting = (one.decisions[:, : len(tables.targets)] == 0).any(axis=1)
        used = np.where(one.decisions[:, -2] == 0, np.arange(len(waiting)), 0)
        decisions[:, -1] |= waiting[np.maximum.accumulate(used)]  # also after a reading that is rejected
    return np.flatnonzero(~(same & decisions.all(axis=1)))


def shrink(differ: Callable[[NDArray[np.intp]], bool], rows: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return fewer readings after which two ways still differ."""
    size = len(rows) // 2
    while size:
        begin = 0
        while begin < len(rows):
            fewer = np.delete(rows, slice(begin, begin + size))
            if fewer.size and differ(fewer):
                rows = fewer
            else:
                begin += size
        size //= 2
    return rows


ORDINARY = seeds(SHORT[0], LONG[0])


def count_of(seed: int) -> int:
    return SHORT[1] if seed in SHORT[0] else LONG[1]


@pytest.mark.parametrize("seed", ORDINARY)
def test_the_program_is_numpy(seed: int) -> None:
    check(seed, MachineCode, count=count_of(seed))
    for compiler in COMPILERS if seed % 2 else COMPILERS[-1:]:
        check(seed, CCode, compiler, count=count_of(seed))


@pytest.mark.parametrize("seed", seeds(IN_TEXT[0], LONG[0][:40]))
def test_structured_text_is_numpy(seed: int) -> None:
    count = count_of(seed)
    check(seed, StructuredText, count=count, first=IN_TEXT[1] if seed in IN_TEXT[0] else None, within=1e-9)


@pytest.mark.parametrize("seed", seeds((3, 5, 6, 11, 12), range(1200, 1240)))
def test_repeated_temperatures_are_numpy(seed: int) -> None:
    """Some or all temperatures change, after intervals of any length, from the first readings on."""
    drawn, count, rng = draw_compensator(seed), 1500, np.random.default_rng((7, seed))
    tables, stream = gather(drawn.compensator), draw_stream(drawn, seed, count)
    heat = [k for k, c in enumerate(tables.channels) if c.quantity == "temperature"]
    values = draw_values(rng, drawn.plant, tables.channels, 10.0 * np.arange(count, dtype=np.float64))
    values[:, heat] += rng.normal(0.0, 0.01, (count, len(heat)))
    k, length = 0, 1
    while k < count:
        before, length = length, int(rng.choice([1, 2, 12, 40, 90], p=[0.7, 0.2, 0.04, 0.04, 0.02]))
        values[k : k + length, heat] = values[k, heat]
        if k and rng.random() < (0.5 if before <= 2 else 0.05):  # few change, or half of them
            same = rng.permutation(heat)[: (len(heat) + int(rng.integers(0, 2))) // 2]
            values[k : k + length, same] = values[k - 1, same]
        k += length
    never = np.zeros(count, dtype=np.bool_)
    stream = stream._replace(values=values, age=np.zeros(count), dt=np.full(count, 10.0), clock=np.zeros(count))
    stream = stream._replace(restarts=never, resumed=never, stored=rng.random(count) < 0.01)
    said = run_numpy(drawn.compensator, tables, stream)
    # of others, a long interval may be learned as usual before the source stops
    assert 4 in said.decisions[:, -2] or len(heat) < 3 or seed >= 1200
    assert not find_apart(tables, stream, said, MachineCode(tables).run(stream), 1e-12).size


def test_the_draws_contain_what_matters() -> None:
    families, in_text, policies, statuses, faults, codes = (set[object]() for _ in range(6))
    for seed in SHORT[0]:
        _, tables, _, said = expected(seed, SHORT[1])
        families |= {m.family for m in tables.models}
        policies |= {(m.support.policy, m.joint is not None) for m in tables.models}
        statuses |= set(said.decisions[:, : len(tables.targets)].ravel().tolist())
        faults |= set(said.decisions[:, len(tables.targets) : -2].ravel().tolist())
        codes |= set(said.decisions[:, -2].tolist())
        in_text |= {m.family for m in tables.models if seed in IN_TEXT[0]}
    assert families == in_text == set(FAMILIES)
    assert len(policies) == 6
    assert (statuses, faults, codes) == (set(range(5)), set(range(7)), set(range(5)))


def only_later(stream: Stream) -> tuple[FloatArray, FloatArray]:
    """Return times and values of the readings of a stream each of which is later than the one before."""
    later = (stream.dt > 0.0) & (stream.dt < 1e6)
    return np.cumsum(stream.dt[later]), stream.values[later]


@pytest.mark.parametrize("seed", seeds(range(20, 28), range(2000, 2040)))
def test_a_replay_is_numpy_with_probings_and_bands(seed: int) -> None:
    drawn, rng = draw_alone(seed), np.random.default_rng((5, seed))
    own = replace(drawn.compensator, repeats="exception")  # a recording is no source that may stop
    names = [c.name for c in gather(own).channels]
    (model,), limits = own.models, own.limits
    time, table = only_later(draw_stream(drawn, seed, 300 if seed < 2000 else 2000))
    probed = np.where(rng.random(len(time)) < 0.03, rng.normal(0.0, 8.0, len(time)), np.nan)
    speed = table[:, names.index(model.zeroing.speed)].tolist() if model.zeroing.speed else [None] * len(time)
    stands = np.array([model.zeroing.stands(s) for s in speed], dtype=np.bool_)
    passed, undriven, failed = table.copy(), np.zeros(len(time), dtype=np.bool_), undriven_by_nobody(len(time))
    if (watch := model.watch) is not None:
        places = [names.index(i.name) for i in watch.inputs]
        seen, faults = run_watch(watch, time, table[:, places], stands)
        passed[:, places], failed = seen, faults != 0
        for k in np.flatnonzero(failed.any(axis=1)).tolist():
            of = zip(watch.failing, faults[k].tolist(), strict=True)
            lost = {n: WORDS[f] for n, f in of if f and n in model.sensors}
            undriven[k] = bool(lost) and (not model.may_lose(lost) or bool(model.wrong_speeds(lost)))
    values = passed[:, [names.index(i.name) for i in model.inputs]]
    found = batch.run(model, limits, time, values, resting=stands, undriven=undriven, probed=probed)
    state, refused, same_so_far = own.start(), list[str](), True
    for k, (now, row) in enumerate(zip(time.tolist(), table.tolist(), strict=True)):
        probing = {"z_um": Probing(probed[k], 0.5, 0.0, (str(k),))} if np.isfinite(probed[k]) else {}
        state, said = own.step(state, Reading(now, dict(zip(names, row, strict=True))), now, probing)
        where = f"seed {seed}, reading {k}: {said}"
        assert found.compensated[k] == pytest.approx(-said.corrections["z_um"].offset, rel=1e-12, abs=FLOOR), where
        complete = bool(np.isfinite(values[k]).all())
        assert found.rejected[k] == (complete and bool(said.rejected)), where
        drives = said.states["z_um"].word == "active"
        refused += [why for why in said.refused.values() if drives]
        same_so_far &= not found.rejected[k] and not undriven[k]
        if "z_um" in said.half_widths and same_so_far and not failed[k].any():
            assert found.half_width[k] == pytest.approx(said.half_widths["z_um"], rel=1e-9), where
    assert list(found.refused) == refused


def undriven_by_nobody(count: int) -> NDArray[np.bool_]:
    return np.zeros((count, 1), dtype=np.bool_)


@pytest.mark.parametrize("seed", seeds((*range(5), 22), range(3000, 3040)))
def test_a_fleet_is_as_many_compensators(seed: int) -> None:
    model, limits, plant = draw_fleet(seed)
    rng, count, machines = np.random.default_rng((6, seed)), 200 if seed < 3000 else 1000, 3
    dt = rng.choice([5.0, 60.0, 60.0, 600.0, 0.01, 7e5], count, p=[0.2, 0.3, 0.3, 0.1, 0.09, 0.01])
    dt[rng.random(count) < 0.5] = dt[-1]  # the same again, often
    dt[0] = 0.0
    time = np.cumsum(dt)
    streams = []
    for _ in range(machines):
        values = draw_values(rng, plant, model.inputs, time)
        with np.errstate(invalid="ignore"):
            for damage in rng.choice(np.array(DAMAGES, dtype=object), 3):
                damage(rng, values, model.inputs)
        streams.append(values)
    usual = np.array([i.reference for i in model.inputs])
    zeros = np.array([np.where(rng.random(len(usual)) < 0.5, usual, np.nan_to_num(s[0])) for s in streams])
    zeros = np.clip(zeros, -60.0, 6000.0)
    # a fleet does not tell whether a source has stopped
    fleet, one = Fleet(model, zeros, limits), replace(Compensator.of([model], limits), repeats="exception")
    states = [one.start()._replace(models=(model.init(zero),)) for zero in zeros]
    for k in range(count):
        used = fleet.tick(np.array([s[k] for s in streams]).T, float(dt[k]))
        for m, values in enumerate(streams):
            table = dict(zip((i.name for i in model.inputs), values[k].tolist(), strict=True))
            states[m], said = one.step(states[m], Reading(float(time[k]), table), float(time[k]))
            where = f"seed {seed}, machine {m}, reading {k}: {table}"
            assert used[m] == (not said.rejected), where
            allowed = FLOOR + 4.0 * np.spacing(time[k])  # a correction that moves is as exact as the time
            assert fleet.corrections[m] == pytest.approx(said.corrections["z_um"].offset, rel=1e-12, abs=allowed), where


@pytest.mark.parametrize("set_back", [5, 10, 15])
def test_a_clock_is_set_back_before_a_reading_is_used(set_back: int) -> None:
    """The watch starts again, while its zero is averaged and later; left out of the draws: the program has a clock."""
    own = Compensator.of([watched_model("z_um")])
    state, names = own.start(), own.watches[0].names
    for k in range(40):
        # no start of a machine: the gate refuses it, the watch has begun
        table = dict.fromkeys(names, 40.0 if k < 20 else 33.0) | {"spindle_rpm": 0.0}
        if k >= 20:
            table[names[0]] = np.nan
        now = 30.0 * k - 1e6 * (k >= set_back)
        state, said = own.step(state, Reading(now, table), now, tick=30.0 * k)
    assert said.failed.get(names[0]) == "missing"
