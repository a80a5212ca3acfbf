"""Structured text of the second edition: what it does is the same, without what its compilers refuse."""

import re
from dataclasses import replace
from xml.etree import ElementTree as ET

import pytest
from stmachine import Machine
from watchedmachine import watched_model

from thermocomp.core.correction import Limits
from thermocomp.export.facts import Facts
from thermocomp.export.scenarios import make_readings
from thermocomp.export.st.package import write_package
from thermocomp.export.st.plcopen import NAMESPACE, write_project
from thermocomp.export.st.rules import find_violations
from thermocomp.export.st.secondedition import adapt
from thermocomp.export.st.structuredtext import SourceUnit, translate
from thermocomp.export.st.sttest import write_test
from thermocomp.export.vectors import replay
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.program.tables import gather

FACTS = Facts("model.json", "0" * 64, "0", "2026-01-31")
XML = {"p": NAMESPACE, "h": "http://www.w3.org/1999/xhtml"}


@pytest.fixture(scope="module")
def compensator() -> Compensator:
    return Compensator.of([watched_model("z_um")], Limits(magnitude=20.0, rate=0.05, hold=120.0, fade=60.0))


@pytest.fixture(scope="module")
def usual(compensator: Compensator) -> list[SourceUnit]:
    tables = gather(compensator)
    readings = make_readings(tables)
    tests = write_test(tables, "tc_x", "codesys", readings, replay(compensator, tables, readings))
    return [*translate(tables, "tc_x", "codesys"), *tests]


@pytest.fixture(scope="module")
def plain(usual: list[SourceUnit]) -> list[SourceUnit]:
    return adapt(usual, "tc_x")


def without_names_of_arrays(units: list[SourceUnit]) -> list[SourceUnit]:
    """Write array types out, as the machine of the tests reads them."""
    arrays = {u.name: u.declaration for u in units if " : ARRAY" in u.declaration and "STRUCT" not in u.declaration}
    found = []
    for unit in units:
        if unit.name not in arrays:
            text = unit.declaration.replace("END_STRUCT;", "END_STRUCT")
            for name, whole in arrays.items():
                text = re.sub(rf": {name}\b", f": {re.findall(r': (.*?);', whole)[0]}", text)
            found.append(replace(unit, declaration=text))
    return found


def test_it_does_the_same(plain: list[SourceUnit]) -> None:
    machine = Machine(without_names_of_arrays(plain))
    calls = 0
    while not machine.memory.done:
        found = machine.call()
        calls += 1
    assert calls > 300
    assert (found.wrong, found.row) == (0, calls)
    assert found.largest < 1e-9
    assert found.tested.filled


def test_values_are_assigned_once(plain: list[SourceUnit]) -> None:
    machine = Machine(without_names_of_arrays(plain))
    machine.call()
    number = next(n for n, v in vars(machine.memory.tested.t).items() if isinstance(v, float) and v)
    setattr(machine.memory.tested.t, number, 77.0)
    assert getattr(machine.call().tested.t, number) == 77.0


def test_what_the_compilers_refused(usual: list[SourceUnit], plain: list[SourceUnit]) -> None:
    """In the text for CODESYS each of it is there; none is in the other."""
    found = find_violations(usual)
    for word, least in (("a call of a function", 40), ("a structure ends", 3), ("members of", 40), ("one pass", 10)):
        assert sum(word in line for line in found) >= least
    assert find_violations(plain) == []


WRONG = {
    "a structure ends": SourceUnit("t", "TYPE t :\nSTRUCT\n    a : DINT;\nEND_STRUCT\nEND_TYPE"),
    "members of structures": SourceUnit("t", "TYPE t :\nSTRUCT\n    a : DINT := 1;\nEND_STRUCT;\nEND_TYPE"),
    "a call of a function": SourceUnit("f", "FUNCTION f : BOOL", "f(a := 1);\nf := TRUE;", "END_FUNCTION"),
    "the result of": SourceUnit("f", "FUNCTION f : BOOL", "a := 1;", "END_FUNCTION"),
    "an array passed": SourceUnit(
        "b", "FUNCTION_BLOCK b\nVAR\n    a : ARRAY[0..1] OF DINT;\nEND_VAR", "", "END_FUNCTION_BLOCK"
    ),
    "no loop of": SourceUnit(
        "b", "FUNCTION_BLOCK b", "FOR k := 0 TO 0 DO\n    a := k;\nEND_FOR;", "END_FUNCTION_BLOCK"
    ),
    "no reserved word": SourceUnit("b", "FUNCTION_BLOCK b\nVAR\n    Step : DINT;\nEND_VAR", "", "END_FUNCTION_BLOCK"),
    "single underscores": SourceUnit("b", "FUNCTION_BLOCK b\nVAR\n    a__b : DINT;\nEND_VAR", "", "END_FUNCTION_BLOCK"),
    "not nested": SourceUnit("b", "FUNCTION_BLOCK b\n(* a (* b *)", "", "END_FUNCTION_BLOCK"),
}


@pytest.mark.parametrize("rule", WRONG)
def test_each_rule(rule: str) -> None:
    (found,) = find_violations([WRONG[rule]])
    assert rule in found


def test_branches_loops_and_lines_that_are_wrapped() -> None:
    body = """FOR k := 0 TO 0 DO
    FOR j := 0 TO 2 DO
        IF a THEN
            x_go(s := s,
                k := k);
        ELSE
            b := 1;
        END_IF;
    END_FOR;
END_FOR;"""
    (unit,) = adapt(
        [SourceUnit("x_f", "FUNCTION x_f : BOOL\nVAR_INPUT\n    a : BOOL;\nEND_VAR", body, "END_FUNCTION")], "x"
    )
    assert unit.declaration.endswith("END_VAR\nVAR\n    called : BOOL;\nEND_VAR")
    assert unit.statements.splitlines() == [
        "k := 0;",
        "FOR j := 0 TO 2 DO",
        "    IF a THEN",
        "        called := x_go(s := s, k := k);",
        "    ELSE",
        "        b := 1;",
        "    END_IF;",
        "END_FOR;",
        "x_f := TRUE;",
    ]


def test_the_project_holds_the_same(plain: list[SourceUnit]) -> None:
    root = ET.fromstring(write_project(plain, "tc_x", FACTS, "about"))
    pous = {p.attrib["name"]: p for p in root.iterfind(".//p:pou", XML)}
    kinds = [k.attrib["name"] for k in root.iterfind(".//p:dataType", XML)]
    assert [*kinds, *pous] == [u.name for u in sorted(plain, key=lambda u: bool(u.end))]
    for unit in plain:
        if unit.end:
            assert (pous[unit.name].findtext(".//p:ST/h:xhtml", "", XML)) == unit.statements.rstrip("\n")
            names = [v.attrib["name"] for v in pous[unit.name].iterfind(".//p:variable", XML)]
            assert names == re.findall(
                r"\w+", " ".join(re.findall(r"^    ([\w, ]+) :", unit.declaration, re.MULTILINE))
            )
    block = pous["tc_x"]
    assert block.attrib["pouType"] == "functionBlock"
    assert {
        v.attrib["value"] for v in block.iterfind(".//p:inputVars/p:variable[@name='good']//p:simpleValue", XML)
    } == {"TRUE"}
    (array,) = root.iterfind(".//p:dataType[@name='tc_x_lreal_4']//p:dimension", XML)
    assert array.attrib == {"lower": "0", "upper": "3"}


def test_files(compensator: Compensator) -> None:
    files = write_package(compensator, "x", FACTS, "iec")
    assert sorted(files) == ["tc_x.md", "tc_x.st", "tc_x.xml", "tc_x_test.st"]
    block, test = files["tc_x.st"].decode(), files["tc_x_test.st"].decode()
    assert "FUNCTION_BLOCK tc_x\n" in block
    assert "_vectors" not in block
    assert "FUNCTION_BLOCK tc_x_test" in test
    assert write_package(compensator, "x", FACTS, "iec") == files
    assert "tc_x.xml" in write_package(compensator, "x", FACTS)
    assert "tc_x.xml" in files["tc_x.md"].decode()
