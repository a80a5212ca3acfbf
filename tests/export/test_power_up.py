"""A controller that is switched off and on: with its state, without one, and the ways to a known reference."""

import ctypes
import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from compiledblock import COMPILERS, QUICK, SANITIZED, CompiledBlock, check_same, compiled
from drawnmodels import draw_compensator
from drawnreadings import draw_stream
from driftmodels import growing
from halstand import HalStand, needs_halcompile
from watchedmachine import failing, watched_model

from thermocomp.core.correction import Limits
from thermocomp.core.reading import Reading
from thermocomp.core.thresholds import THRESHOLDS
from thermocomp.export.c99.c99 import translate
from thermocomp.export.facts import Facts
from thermocomp.export.linuxcnc.package import write_package
from thermocomp.export.vectors import DAMAGED, NOTHING, RETAINED, REZERO, TOLD_COLD, Answers, Readings, replay
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.powerup import find_cold_after, find_slowest, is_referenced, power_up, rezero_measured
from thermocomp.runtime.program.tables import gather
from thermocomp.runtime.state import CompensatorState

needs_compiler = pytest.mark.skipif(not COMPILERS, reason="there is no C compiler")
DAY = THRESHOLDS.resumable
UNKNOWN = 5


@pytest.fixture(scope="module")
def watched() -> Compensator:
    return Compensator.of([watched_model("z_um"), watched_model("x_um")], Limits(rate=0.5))


@pytest.fixture(scope="module")
def block(watched: Compensator, tmp_path_factory: pytest.TempPathFactory) -> CompiledBlock:
    return CompiledBlock(watched, tmp_path_factory.mktemp("power"))


def part(said: Answers, begin: int) -> Answers:
    return said._replace(**{name: a[begin:] for name, a in said._asdict().items()})


Run = Callable[..., tuple[Answers, Answers]]


@pytest.fixture(scope="module")
def restart(watched: Compensator, block: CompiledBlock) -> Run:
    """Run a day with a restart, by the C code and in Python, and without it; return what is said after it."""
    day = failing()
    rows = day.table[[c.name for c in block.tables.channels]].to_numpy(dtype=np.float64)

    def run(at: int, off: float, *events: tuple[int, int, float]) -> tuple[Answers, Answers]:
        begin = at + round(off / 60.0)
        values = np.vstack([rows[:at], rows[begin:]])
        orders = np.zeros((len(values), 2))
        orders[0] = TOLD_COLD, 0.0
        for k, event, amount in events:
            orders[at + k] = event, amount
        dt = np.full(len(values), float(np.diff(day.time).min()))
        none = np.zeros(len(values))
        readings = Readings(values, none, dt, none, orders[:, 0].astype(int), orders[:, 1])
        found = block.run(readings)
        check_same(replay(watched, block.tables, readings), found)
        on = block.run(Readings(rows, np.zeros(len(rows)), np.full(len(rows), dt[0])))
        return part(found, at), part(on, begin)

    return run


@needs_compiler
@pytest.mark.parametrize("minutes", [1, 30])
def test_a_retained_state_continues(restart: Run, minutes: int) -> None:
    at = 150
    found, on = restart(at, 60.0 * minutes, (0, RETAINED, 60.0 * minutes))
    assert np.abs(on.correction[:, 0]).max() > 5.0
    assert set(found.status.ravel()) == {1}
    apart = found.correction - on.correction
    assert np.sqrt(np.mean(apart**2)) < 0.1 * np.sqrt(np.mean(on.correction**2))


@needs_compiler
@pytest.mark.parametrize(
    ("event", "amount"),
    [(DAMAGED, 60.0), (RETAINED, 0.0), (RETAINED, -5.0), (RETAINED, math.nan), (RETAINED, math.inf)],
)
def test_without_one_nothing_is_corrected(restart: Run, event: int, amount: float) -> None:
    found, _ = restart(150, 60.0, (0, event, amount))
    assert set(found.status.ravel()) == {UNKNOWN}
    assert not found.correction.any()


@needs_compiler
def test_the_ways_to_a_known_reference(restart: Run, watched: Compensator) -> None:
    cold = find_cold_after(watched)
    assert restart(150, 60.0, (0, RETAINED, cold + 60.0))[0].status[-1].tolist() == ([1, 1] if cold < DAY else [5, 5])
    found, _ = restart(150, 60.0, (0, DAMAGED, max(cold, DAY) + 60.0))
    assert not found.correction[0].any()
    assert set(found.status[30:].ravel()) == {1}
    found, _ = restart(150, 60.0, (0, DAMAGED, 60.0), (5, TOLD_COLD, 0.0))
    assert set(found.status[:5].ravel()) == {UNKNOWN}
    assert set(found.status[30:].ravel()) == {1}
    found, _ = restart(150, 60.0, (0, DAMAGED, 60.0), (20, REZERO + 1, 4.0))
    assert set(found.status[:21].ravel()) == {UNKNOWN} == set(found.status[:, 0])  # one target only
    assert not found.correction[:21].any()
    assert found.status[21, 1] == 1
    assert found.correction[21:26, 1].min() == pytest.approx(-4.0, abs=1.0)


@needs_compiler
def test_a_rezero_of_a_running_correction_is_no_jump(restart: Run) -> None:
    (plain, _), (found, _) = (
        restart(150, 60.0, (0, RETAINED, 60.0)),
        restart(150, 60.0, (0, RETAINED, 60.0), (10, REZERO, 0.0), (40, REZERO, 2.0), (50, REZERO + 7, 2.0)),
    )
    shifted = found.correction - plain.correction
    assert np.abs(shifted[:40, 0]).max() < 1e-9  # its datum was set anew: as it was
    assert shifted[45:, 0] == pytest.approx(-2.0, abs=1e-9)
    assert not shifted[:, 1].any()
    assert np.abs(np.diff(found.correction[:, 0])).max() <= 0.5 * 60.0 + 1e-9


@needs_compiler
def test_the_hint_is_no_decision(restart: Run) -> None:
    found, on = restart(230, 60.0, (0, DAMAGED, 60.0), (5, TOLD_COLD, 0.0))
    assert not on.warm.any()
    assert found.warm[-1]
    assert found.status[8].tolist() == [1, 1]  # as told; later the watch misses the heat of the spindle


@needs_compiler
@pytest.mark.parametrize("seed", [1, 2, 3, 4, 7, 11, 27, 34])
def test_any_compensator_is_switched_off_and_on_as_in_python(seed: int, tmp_path: Path) -> None:
    drawn, count = draw_compensator(seed), 400
    rng, tables = np.random.default_rng((9, seed)), gather(drawn.compensator)
    stream = draw_stream(drawn, seed, count)
    kinds = [NOTHING, RETAINED, DAMAGED, TOLD_COLD, REZERO, REZERO + len(tables.targets)]
    event = rng.choice(kinds, count, p=[0.95, 0.02, 0.005, 0.015, 0.005, 0.005])
    event[0] = TOLD_COLD
    off = rng.choice([60.0, 1800.0, 28800.0, 0.99 * DAY, 1.01 * DAY, 3e6, 0.0, math.nan], count)
    amount = np.where(event >= REZERO, rng.normal(0.0, 5.0, count), off)
    readings = Readings(stream.values, stream.age, stream.dt, stream.counter, event, amount)
    said = replay(drawn.compensator, tables, readings)
    assert UNKNOWN in said.status or drawn.compensator.shadow
    check_same(said, CompiledBlock(drawn.compensator, tmp_path).run(readings), 1e-9)


_SAVING = """
#include "tc_kept.c"

static tc_kept_state s;
static tc_kept_saved saved;
int size(void) { return (int)sizeof saved; }
void *bytes(void) { return &saved; }
void cold(void) { tc_kept_start(&s); tc_kept_cold(&s); tc_kept_save(&s, &saved); }
int on(int some, double off) { return tc_kept_power_up(&s, some ? &saved : (void *)0, off); }
int known(void) { return s.referenced[0]; }
"""


@needs_compiler
def test_a_saved_state_that_is_damaged_or_of_other_models_counts_as_none(watched: Compensator) -> None:
    def load(compensator: Compensator) -> ctypes.CDLL:
        made = translate(gather(compensator), "kept")
        files = ((f"{made.name}.h", made.header), (f"{made.name}.c", made.source), ("driver.c", _SAVING))
        flags = ("-fsanitize=undefined", "-fsanitize-trap=undefined") if QUICK == "clang" else SANITIZED
        library = compiled(files, made.name, QUICK, flags)
        library.bytes.restype = ctypes.c_void_p
        return library

    library, after = load(watched), find_cold_after(watched)

    def on(off: float, some: int = 1) -> int:
        return int(library.on(some, ctypes.c_double(off)))

    library.cold()
    assert (on(60.0), library.known()) == (0, 1)
    assert (on(60.0, 0), library.known()) == (2, 0)
    assert (on(max(after, DAY) + 1.0, 0), library.known()) == (1, 1)
    assert [on(off) for off in (0.0, -1.0, math.nan, math.inf, 60.0)] == [2, 2, 2, 2, 0]
    held = (ctypes.c_ubyte * library.size()).from_address(library.bytes())
    for at in np.random.default_rng(1).integers(0, len(held), 200).tolist():
        held[at] ^= 16
        assert on(60.0) == 2 or at >= len(held) - 16  # the rest is padding, model and check value
        held[at] ^= 16
    assert on(60.0) == 0
    model = watched_model("z_um")
    other = load(Compensator.of([replace(model, target="y_um"), watched_model("x_um")], Limits(rate=0.5)))
    assert other.size() == library.size()
    limits = load(Compensator.of(list(watched.models), Limits(rate=0.25)))
    for another, what in ((other, 0), (limits, 0)):
        ctypes.memmove(another.bytes(), library.bytes(), library.size())
        assert on(60.0) == 0
        assert another.on(1, ctypes.c_double(60.0)) == what


def test_a_state_without_power_is_decided_on_in_python(watched: Compensator) -> None:
    state = watched.start()
    names = [i.name for i in watched.watches[0].inputs]
    for k in range(40):
        values = dict.fromkeys(names, 20.0) | {"spindle_rpm": 0.0}
        state, _ = watched.step(state, Reading(10.0 * k, values), 10.0 * k)
    after = find_cold_after(watched)
    assert after == 4.0 * find_slowest(watched)

    def known(found: CompensatorState) -> set[bool]:
        return {is_referenced(found, t) for t in watched.lines}

    continued = power_up(watched, state, 600.0)
    assert known(continued) == {True}
    assert continued.clock == 390.0 + 600.0
    assert known(power_up(watched, None, 600.0)) == known(power_up(watched, state, math.nan)) == {False}
    assert known(power_up(watched, None, after)) == {False}
    assert known(power_up(watched, None, after + 1.0)) == {True}
    unknown = power_up(watched, None, 0.0)
    assert known(power_up(watched, unknown, 600.0)) == {False}  # it was not known before either
    moved = rezero_measured(watched, state, "z_um", 400.0, 3.0)
    assert moved.corrections == state.corrections
    assert moved.references["z_um"].shift.offset == pytest.approx(state.raw["z_um"].offset - 3.0)


def test_models_without_a_time_constant_are_cold_after_a_day() -> None:
    assert find_cold_after(Compensator.of([growing("z_um", 2.0)])) == DAY


@needs_halcompile
def test_the_state_outlasts_linuxcnc_in_a_file(tmp_path: Path) -> None:
    model, facts = growing("z_um", 2.0), Facts("model.json", "0" * 64, "1", "2026-01-31")
    for file, text in write_package(Compensator.of([model], Limits(rate=1e3)), "mill", facts).items():
        (tmp_path / file).write_bytes(text)
    kept = tmp_path / "mill.state"

    def run(stand: HalStand, *temperatures: float) -> None:
        for k, t in enumerate(temperatures, 1):
            stand["value-0"], stand["reading"] = t, k
            stand.run(1, 1_000_000_000)

    stand = HalStand(tmp_path, str(kept))
    run(stand, 20.0, 25.0)
    assert (stand["status-0"], stand["correction-0"]) == (UNKNOWN, 0.0)
    stand["told-cold"] = True
    run(stand, 20.0, 25.0)
    assert (stand["status-0"], stand["correction-0"]) == (1, pytest.approx(-0.010))
    stand.exit()
    assert kept.exists()
    stamp = kept.read_bytes()

    again = HalStand(tmp_path, str(kept), ago=100)
    assert not kept.exists()
    run(again, 26.0)
    assert (again["status-0"], again["correction-0"]) == (1, pytest.approx(-0.012))
    again["measured"], again["rezero"] = 0.001, True
    run(again, 26.0, 26.5)
    assert again["correction-0"] == pytest.approx(-0.014)
    for damage in (b"", stamp[:-9], stamp[:40] + b"\x55" + stamp[41:]):
        kept.write_bytes(damage)
        lost = HalStand(tmp_path, str(kept), ago=100)
        run(lost, 26.0)
        assert (lost["status-0"], lost["correction-0"]) == (UNKNOWN, 0.0)


@needs_compiler
@pytest.mark.parametrize("missing", [0, 1, 30])
def test_what_is_taken_at_once_is_so_right_after_power_up_or_not_at_all(missing: int, tmp_path: Path) -> None:
    """Once readings have been missing for longer than they may be old, the axes may be in use: no step then."""
    slow = Compensator.of([watched_model("z_um")], Limits(rate=0.002))
    block, day = CompiledBlock(slow, tmp_path), failing()
    rows = day.table[[c.name for c in block.tables.channels]].to_numpy(dtype=np.float64)
    at, off, dt = 150, 3600.0, float(np.diff(day.time).min())
    values = np.vstack([rows[:at], rows[at + round(off / dt) :]])
    age, orders = np.zeros(len(values)), np.zeros((len(values), 2))
    orders[0], orders[at] = (TOLD_COLD, 0.0), (RETAINED, off)
    age[at : at + missing] = 1e9
    steps = np.full(len(values), dt)
    readings = Readings(values, age, steps, np.zeros(len(values)), orders[:, 0].astype(int), orders[:, 1])
    found = block.run(readings)
    check_same(replay(slow, block.tables, readings), found)
    moved = np.abs(np.diff(found.correction[at - 1 :, 0]))
    assert (moved[0] > 1.0) == (missing == 0)
    assert (moved[1:] <= 0.002 * dt + 1e-9).all() == (missing != 1)
