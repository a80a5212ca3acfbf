"""Structured text: parsed by blark, types checked, run over readings, and the same as the compensator."""

import copy
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import stmachine
from blark.parse import parse
from driftmodels import ACCEPTED
from hypothesis import HealthCheck, Phase, example, given, settings
from hypothesis import strategies as st
from spoiling import models_of, spoiled
from stmachine import Machine, check_block, check_same, run
from stparsing import parsed
from watchedmachine import watched_model

from thermocomp.core.correction import Limits
from thermocomp.core.model import ErrorModel
from thermocomp.export.facts import Facts
from thermocomp.export.scenarios import make_readings
from thermocomp.export.st.package import write_package
from thermocomp.export.st.structuredtext import SourceUnit, translate
from thermocomp.export.st.ststatements import RESERVED
from thermocomp.export.st.sttest import write_test
from thermocomp.export.vectors import NOTHING, TOLD_COLD, Readings, replay
from thermocomp.recordings.readers.recordings import read
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.program.tables import gather

FREE = Limits(magnitude=1e9, rate=1e9)
SLOW: dict[str, Any] = {
    "suppress_health_check": list(HealthCheck),
    "deadline": None,
    "phases": [Phase.explicit, Phase.reuse, Phase.generate],
}
FACTS = Facts("model.json", "0" * 64, "0", "2026-01-31")


def accepted(model: ErrorModel, **changes: Any) -> ErrorModel:
    return replace(model, honest_error=ACCEPTED, **changes)


@pytest.fixture(scope="module")
def watched() -> Compensator:
    return Compensator.of([watched_model("z_um")], Limits(magnitude=20.0, rate=0.05, hold=120.0, fade=60.0))


@pytest.fixture(scope="module")
def units(watched: Compensator) -> list[SourceUnit]:
    return translate(gather(watched), "tc_x", "codesys")


@pytest.fixture(scope="module")
def machine(units: list[SourceUnit]) -> Machine:
    return Machine(units)


def test_it_says_what_the_compensator_says(watched: Compensator) -> None:
    said = check_block(watched, make_readings(gather(watched)))
    assert set(said.status.ravel()) == {0, 1, 2, 3, 5}
    assert {0, 1} <= set(said.fault.ravel())


def proof(watched: Compensator, units: list[SourceUnit]) -> Any:
    """Run the block that runs the vectors."""
    tables = gather(watched)
    readings = make_readings(tables)
    machine = Machine([*units, *write_test(tables, "tc_x", "codesys", readings, replay(watched, tables, readings))])
    for _ in readings.age:
        assert not machine.memory.done
        machine.call()
    assert machine.memory.done
    return machine.memory


def test_its_own_test_passes(watched: Compensator, units: list[SourceUnit]) -> None:
    said = proof(watched, units)
    assert (said.wrong, said.largest < 1e-9) == (0, True)


@pytest.mark.parametrize(
    ("block", "was", "becomes"),
    [
        ("tc_x_check", "w.passes := FALSE", "w.passes := TRUE"),
        ("tc_x_tell_time", "s.clock + w.tc_dt", "s.clock + w.tc_dt + 1.0E-06"),
        ("tc_x_limit", "current + reach", "current + reach * 1.001"),
        ("tc_x_tables", "substitute_fade : LREAL := 3600.0", "substitute_fade : LREAL := 3700.0"),
        ("tc_x_tables", "hold : LREAL := 120.0", "hold : LREAL := 121.0"),
    ],
)
def test_its_own_test_finds_a_mistake(
    watched: Compensator, units: list[SourceUnit], block: str, was: str, becomes: str
) -> None:
    broken = []
    for unit in units:
        if unit.name == block:
            assert was in unit.statements + unit.declaration
            unit = replace(  # noqa: PLW2901
                unit,
                statements=unit.statements.replace(was, becomes),
                declaration=unit.declaration.replace(was, becomes),
            )
        broken.append(unit)
    assert proof(watched, broken).wrong > 0


def test_a_restart_moves_nothing_at_once(watched: Compensator, units: list[SourceUnit]) -> None:
    tables, machine = gather(watched), Machine(units)
    readings = make_readings(tables)
    warm = Readings(
        readings.values[:165], readings.age[:165], readings.dt[:165]
    )  # and none of the events but the first
    run(machine, warm, 1, len(tables.sensors))
    before = machine.memory.correction[0]
    assert abs(before) > 5.0
    values = [float(v) for v in readings.values[164]]
    again = {"value": values, "good": [True] * len(values), "age": 0.0, "elapsed": 10.0, "reading": 0.0}
    none, told = (stmachine.happening(event, 0.0) for event in (NOTHING, TOLD_COLD))
    said = machine.call(**again, **told)
    assert said.status[0] == 0
    assert said.correction[0] == before
    fresh, moved = Machine(units), [before]
    fresh.call(**again, **told)
    for _ in range(200):
        moved.append(machine.call(**again, **none).correction[0])
        assert list(fresh.call(**again, **none).status) == list(machine.memory.status)
    assert (np.abs(np.diff(moved)) <= 0.5 + 1e-9).all()
    assert moved[-1] == fresh.memory.correction[0]


def test_a_kept_state_counts_unless_it_is_damaged_or_of_other_models(machine: Machine) -> None:
    given = {"value": [21.0, 20.5, 20.0, 0.0], "good": [True] * 4, "age": 0.0, "elapsed": 10.0, "reading": 0.0}
    machine.start()
    assert machine.call(**given, **stmachine.happening(NOTHING, 0.0)).status[0] == 5
    for k in range(40):
        told = machine.call(**given, **stmachine.happening(NOTHING, 0.0) | {"cold": k >= 2})
        assert told.status[0] == (5 if k < 2 else 0 if k < 32 else 1)
    kept = copy.deepcopy(machine.memory.kept)

    def on(off: float, change: Callable[[Any], Any] = lambda _: None) -> int:
        machine.start()
        machine.memory.kept = copy.deepcopy(kept)
        change(machine.memory.kept)
        return int(machine.call(**given, **stmachine.happening(NOTHING, off)).status[0])

    assert (on(60.0), on(0.0), on(-1.0), on(1e31)) == (1, 5, 5, 5)
    assert (on(86400.0), on(86401.0)) == (1, 0)  # longer than its longest time constant, too
    for name, value in vars(kept).items():
        one = value[len(value) - 1] if isinstance(value, list) else value
        other = not one if isinstance(one, bool) else one + 1

        def change(of: Any, name: str = name, other: Any = other) -> None:
            found = getattr(of, name)
            if isinstance(found, list):
                found[len(found) - 1] = other
            else:
                setattr(of, name, other)

        assert on(60.0, change) == 5, name


@pytest.mark.long
@pytest.mark.parametrize("method", ["averaged", "mra"])
def test_a_whole_recording_with_sensors_that_fail(shared_data: Path, method: str) -> None:
    recording = read(shared_data / "fl_thermal" / "recording.csv")
    targets = [c.name for c in recording.channels if c.quantity == "displacement"][:1]
    compensator = Compensator.of(models_of(recording, targets, method), Limits(rate=0.5))
    tables = gather(compensator)
    rows = recording.table[[c.name for c in tables.channels]].to_numpy(dtype=np.float64)
    for seed in range(3):
        dt = np.diff(recording.time, prepend=recording.time[0])
        check_block(compensator, Readings(spoiled(rows, seed) if seed else rows, np.zeros(len(rows)), dt))


ODD = st.one_of(st.floats(), st.sampled_from([np.nan, np.inf, -np.inf, 1e308, -0.0, 85.0, -127.0, 65535.0]))


#: a speed that goes missing while the zero is averaged; its substitute tells whether the spindle still stands
LOST_SPEED = [
    (24.4, 65535.0, 24.8, -4e127, 0.0, 80.0),
    (21.0, 21.0, 20.6, -2.7e-167, 0.0, 52.0),
    (0.0, 21.0, 0.0, 21.0, 0.0, 64.0),
    (24.2, 21.0, 21.0, -1.4e83, 0.0, 15.0),
    (21.0, 21.0, np.nan, -2.7e16, 0.0, 18.0),
    (21.3, -1.8e73, 3.6e16, 21.0, 0.0, 40.0),
    (20.4, 25.6, 12.7, -3.7e16, 2.0, 86.0),
]


@settings(**SLOW, max_examples=150)
@example(rows=LOST_SPEED, quiet=True)
@given(
    rows=st.lists(
        st.tuples(*[st.one_of(st.just(21.0), st.floats(20, 26), ODD)] * 4, ODD, ODD), min_size=1, max_size=60
    ),
    quiet=st.booleans(),
)
def test_nothing_that_comes_in_moves_it_beyond_its_limits(
    watched: Compensator, machine: Machine, rows: list[tuple[float, ...]], quiet: bool
) -> None:
    table = np.array(rows, dtype=np.float64)
    age = np.abs(np.nan_to_num(table[:, 4], posinf=0, neginf=0)) % 5 if quiet else table[:, 4]
    dt = np.abs(np.nan_to_num(table[:, 5], posinf=0, neginf=0)) % 90 if quiet else table[:, 5]
    readings, tables = Readings(table[:, :4], age, dt), gather(watched)
    machine.start()
    said = run(machine, readings, 1, len(tables.sensors))
    check_same(replay(watched, tables, readings), said)
    moved = np.abs(np.diff(said.correction[:, 0], prepend=0.0))
    assert (np.abs(said.correction) <= 20.0).all()
    assert (moved <= 0.05 * np.clip(np.nan_to_num(dt), 0.0, 60.0) + 1e-9).all()


def test_scl_is_the_same_but_for_its_marks(watched: Compensator) -> None:
    tables = gather(watched)
    readings = make_readings(tables)
    answers = replay(watched, tables, readings)
    plain, scl = (
        [*translate(tables, "tc_x", dialect), *write_test(tables, "tc_x", dialect, readings, answers)]
        for dialect in ("codesys", "scl")
    )

    def bare(text: str) -> str:
        text = re.sub(r"(TYPE \"\w+\")\n", r"\1 :\n", text)
        text = " ".join(re.sub(r'[#"]|\{ S7_.*? \}\n|VERSION : 0.1\n|\bBEGIN\n', "", text).split())
        text = re.sub(r"SEL\(G := (.*?), IN0 := (.*?), IN1 := (.*?)\)", r"SEL(\1, \2, \3)", text)
        text = text.replace(": Void", ": BOOL").replace("VAR_TEMP", "VAR").replace("END_STRUCT;", "END_STRUCT")
        return text.replace("END_VAR VAR ", "")  # a block has two sections of its own in one dialect

    for one, other in zip(plain, scl, strict=True):
        assert "#" in other.statements or not other.end
        # a block has two sections of variables of its own in one dialect
        assert bare(other.text("scl")) == bare(one.text("codesys"))


def test_names_are_no_words_of_the_language(units: list[SourceUnit]) -> None:
    declared = {n for u in units for n in re.findall(r"^    (\w+) : ", u.declaration, re.M)}
    assert {"tc_time", "tc_step"} <= declared
    assert not {n for n in declared if n.lower() in RESERVED}
    assert all(re.fullmatch(r"[A-Za-z](_?[A-Za-z0-9])*", n) for n in declared)


def test_the_files_of_twincat_are_read_by_blark(tmp_path: Path, watched: Compensator) -> None:
    files = write_package(watched, "x", FACTS, "twincat")
    assert {Path(f).suffix for f in files} == {".TcPOU", ".TcDUT", ".md"}
    for name in ("tc_x.TcPOU", "tc_x_limit.TcPOU", "tc_x_gather.TcPOU", "tc_x_test.TcPOU", "tc_x_work.TcDUT"):
        (tmp_path / name).write_bytes(files[name])
        found = list(parse(tmp_path / name))
        assert len(found) == (2 if name.endswith("POU") else 1)
        assert [result.exception for result in found] == [None] * len(found)
    again = write_package(watched, "x", FACTS, "twincat")
    assert files == again


def test_the_first_line_is_the_verdict(watched: Compensator) -> None:
    for dialect in ("codesys", "scl"):
        files = write_package(watched, "x", FACTS, dialect)
        if project := files.pop("tc_x.xml", None):
            assert b'contentDescription="z_um: accepted on unseen cycles;' in project
        for name, text in files.items():
            assert text.decode().split("\n")[0].strip("(* )") == "z_um: accepted on unseen cycles", name


def test_a_name_that_would_end_a_comment_does_not() -> None:
    model = replace(watched_model("z_um"), target="z *) (* um")
    units = translate(gather(Compensator.of([model])), "tc_x", "codesys")
    parsed(units[-1].text("codesys"))
