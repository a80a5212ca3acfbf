"""Exported code can be read: tables with names and units, short functions, a comment that says what a reader asks."""

import re

import compiledblock
import numpy as np
import pytest
import stmachine
from driftmodels import growing, judged, lags
from watchedmachine import watched_model

from thermocomp.core import expression as e
from thermocomp.core.correction import Limits
from thermocomp.core.polynomial import Polynomial
from thermocomp.export.c99.c99 import translate
from thermocomp.export.pages import explain
from thermocomp.export.st.structuredtext import SourceUnit
from thermocomp.export.st.structuredtext import translate as translate_st
from thermocomp.export.st.ststatements import Dialect
from thermocomp.export.vectors import Readings
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.program.printer import compact
from thermocomp.runtime.program.tables import Tables, gather

WIDE = Limits(magnitude=1e6, rate=1e6)


@pytest.fixture(scope="module")
def compensator() -> Compensator:
    return Compensator.of([watched_model("z_um")], Limits(hold=120.0, fade=60.0))


@pytest.fixture(scope="module")
def tables(compensator: Compensator) -> Tables:
    return gather(compensator)


class Odd(Polynomial):
    """Lags of lags, of products with lags and of sums: what loops over tables cannot compute."""

    def _expression(self, change: "list[e.Node]") -> e.Node:  # type: ignore[override]
        x = change[0]
        inner = e.Sum((e.Product((e.Constant(2.0), x)), e.Product((e.Constant(-0.1), e.Power(x, 2.0)))))
        product = e.Product((e.Lag(x, 60.0), e.Magnitude(x)))
        pace = e.Product((e.Constant(0.05), e.Magnitude(x)))
        parts = [x, e.Lag(e.Lag(x, 60.0), 600.0), e.Lag(product, 300.0), e.Lag(inner, 120.0)]
        parts += [e.PacedLag(e.Named("twice", e.Power(x, 1.0)), 1800.0, 600.0, pace), product, e.Lag(x, 600.0)]
        one, two = e.sum_weighted([0.5, 0.3, 0.1, 0.2, 0.7, -0.3, 0.4], parts, 1.5), e.Sum((inner, x, product))

        def small(node: e.Node) -> e.Node:
            return e.Sigmoid(e.Product((e.Constant(1e-3), node)))

        return e.Sum((e.Product((e.Constant(0.5), one)), small(two), e.Lag(small(e.Sum((x, product))), 90.0)))


def test_what_fits_no_table_is_the_same_number() -> None:
    model = growing("z_um", 1.0)
    odd = Odd(**{f: getattr(model, f) for f in model.__dataclass_fields__})
    compensator = Compensator.of([odd, judged(lags("x_um"), 9.0), growing("y_um", 2.0)], WIDE)
    found = gather(compensator)
    assert found.sizes["LAGS"] > found.sizes["BANKED"] > 3
    rng, channels = np.random.default_rng(3), found.channels
    low, high = (np.array([c.reference + getattr(c, end) for c in channels]) for end in ("low", "high"))
    values = rng.uniform(low, high, (40, len(channels)))
    values[0] = [c.reference for c in channels]
    said = compiledblock.check_block(compensator, values, np.full(40, 60.0))
    assert np.ptp(said.deviation, axis=0).min() > 0.1
    stmachine.check_block(compensator, Readings(values, np.zeros(40), np.full(40, 60.0)))


def test_a_row_per_sensor_and_lag(tables: Tables) -> None:
    """The coefficient beside each name is that of the model."""
    weights = dict(zip(tables.labels["TERMS"], tables.values["coefficient"], strict=True))
    assert "t1_C [degC], lag 600 s" in weights
    table = re.search(r" c_coefficient\[.*?\};", translate(tables, "z").source, re.DOTALL)
    assert table
    rows = re.findall(r"^    \{(?:TC|TC_ROUNDED)\((\S+?)[,)].*\}, /\* (.*?) \*/$", table[0], re.MULTILINE)
    printed = {name: float(number) for number, name in rows}
    assert len(printed) > 20
    assert all(weights[name] == [number] for name, number in printed.items())
    (text,) = (u.declaration for u in translate_st(tables, "z", "codesys") if u.name == "z_tables")
    body = re.search(r"coefficient : .*?\[\n(.*?)\];", text, re.DOTALL)
    assert body
    in_text = re.findall(r"^ +(\S+), \(\* (.*?) \*\)$", body[1], re.MULTILINE)
    beside = {name: float(number) for number, name in in_text}
    assert len(printed.items() - beside.items()) == 1  # behind the last row there is a semicolon


@pytest.mark.parametrize("dialect", ["codesys", "twincat", "scl", "iec"])
def test_no_function_is_long(tables: Tables, dialect: Dialect) -> None:
    for unit in translate_st(tables, "z", "codesys" if dialect == "iec" else dialect):
        if unit.end == "END_FUNCTION":
            assert unit.text(dialect).count("\n") <= 60, unit.name
    if dialect == "codesys":
        source = translate(tables, "z").source
        bodies = re.findall(r"^\w[\w ]* \**(\w+)\([^;]*?\)\n\{\n(.*?)^\}", source, re.MULTILINE | re.DOTALL)
        assert len(bodies) > 60
        assert [name for name, body in bodies if body.count("\n") > 57] == []


def test_lines_that_are_joined_differ_by_spaces_alone(tables: Tables) -> None:
    shorter = 0
    for unit in translate_st(tables, "z", "codesys"):
        whole = "\n".join([unit.declaration, unit.statements, unit.end])
        assert unit.text("codesys").split() == whole.split()
        shorter += whole.count("\n") - unit.text("codesys").count("\n")
    assert shorter > 500


def test_what_is_joined() -> None:
    lines = ["IF a THEN", "    b := 1;", "ELSE", "    c := 2;", "END_IF;", "FOR k := 0 TO 1 DO", "    IF a THEN"]
    lines += ["        b := 2;", "    END_IF;", "END_FOR;", "IF a THEN", f"    b := {'9' * 100};", "END_IF;"]
    unit = SourceUnit("x", "FUNCTION x : BOOL", "\n".join(lines), "END_FUNCTION")
    assert unit.body()[:4] == [
        "IF a THEN b := 1; ELSE c := 2; END_IF;",
        "FOR k := 0 TO 1 DO",
        "    IF a THEN b := 2; END_IF;",
        "END_FOR;",
    ]
    assert unit.body()[4:] == lines[-3:]
    assert (
        compact(["if (a) {", "    b = 1;", "} else if (c) {", "    d = 1;", "}"], r"if \(.*\{", "-", r"\}")[0]
        == "if (a) {"
    )


def test_the_comment_says_what_counts(compensator: Compensator, tables: Tables) -> None:
    told = explain(compensator, tables, "kept", "cold", "age := 1.0E+9")
    model = compensator.models[0]
    (line,) = (x for x in told if x.startswith("z_um: "))
    for name, change in re.findall(r"(\w+) ([+-]\S+) um", line):
        rows = np.array(
            [[i.reference + getattr(i, end) * (i.name == name) for i in model.inputs] for end in ("low", "high")]
        )
        first, last = (model.step(model.init([i.reference for i in model.inputs]), row, 1.0)[1] for row in rows)
        assert float(change) == pytest.approx(float(last - first), rel=6e-3)
    text = " ".join(told)
    assert (
        "Sensors that must not be missing: t3_C, spindle_rpm for z_um" in text
        or "not be missing: t3_C for z_um" in text
    )
    for word in ("held for 120 s", "AT POWER-UP", "25 %", "goes on with these", "TO SWITCH IT OFF: age := 1.0E+9"):
        assert word in text
    bare = Compensator.of([growing("z_um", 1.0)], WIDE)
    assert "not monitored" in " ".join(explain(bare, gather(bare), "", "", ""))
