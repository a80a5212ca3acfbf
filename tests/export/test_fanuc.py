"""Fanuc's macro: what it moves, what it leaves, what it refuses; what nobody has confirmed is marked."""

import re
import subprocess
import sys
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from driftmodels import growing
from hypothesis import given, settings
from hypothesis import strategies as st
from poorcontroller import exported, growing_machine, left, page_numbers, temperatures

from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError
from thermocomp.export.facts import Facts
from thermocomp.export.fanuc.package import UNCONFIRMED, write_fanuc
from thermocomp.export.heidenhain.package import write_heidenhain
from thermocomp.export.klipper.package import write_klipper
from thermocomp.export.reduction.reduced import as_it_is

FACTS = Facts("model.json", "0" * 64, "1.0", "2026-01-31")
ON, T, FORCE, Z = 500, 501, 523, 5203


def macro(per_kelvin: float = 2.0, limits: Limits = Limits()) -> dict[str, bytes]:
    return write_fanuc([as_it_is(growing("z_um", per_kelvin), "Z")], limits, "tc", FACTS)


def call(text: str, numbers: dict[int, float]) -> None:
    """Run a macro once, as far as it uses the language: assignments, IF with GOTO or THEN, labels, M99."""
    lines = [re.sub(r"\([^()]*\)", "", line).replace(" ", "") for line in text.splitlines()]
    lines = [line for line in lines if line and line != "%" and not line.startswith("O")]

    def real(words: str) -> float:
        filled = re.sub(r"#(\d+)", lambda m: f"({numbers[int(m[1])]!r})", words)
        return float(eval(filled.replace("[", "(").replace("]", ")"), {"__builtins__": {}}))

    def true(words: str) -> bool:
        left_side, word, right_side = re.fullmatch(r"(.+?)(EQ|NE|LT|GT)(.+)", words).groups()  # type: ignore[union-attr]
        if right_side == "#0":  # vacant
            return (int(left_side[1:]) not in numbers) == (word == "EQ")
        if left_side.startswith("#") and int(left_side[1:]) not in numbers:  # vacant is not a number
            return word == "NE"
        a, b = real(left_side), real(right_side)
        return {"EQ": a == b, "NE": a != b, "LT": a < b, "GT": a > b}[word]

    k = 0
    while lines[k] != "M99":
        line = re.sub(r"^N\d+", "", lines[k])
        k += 1
        jump = re.fullmatch(r"IF\[(.+)\]GOTO(\d+)", line)
        then = re.fullmatch(r"IF\[(.+)\]THEN(.+)", line)
        if jump and true(jump[1]):
            (k,) = (j for j, other in enumerate(lines) if re.match(rf"N{jump[2]}(?!\d)", other))
        if jump or not line or (then and not true(then[1])):
            continue
        variable, words = (then[2] if then else line).split("=")
        numbers[int(variable[1:])] = real(words)


def settle(text: str, numbers: dict[int, float]) -> float:
    """Return the external offset of Z after many calls [um]."""
    before: dict[int, float] = {}
    while numbers != before:
        before = dict(numbers)
        call(text, numbers)
    return 1e3 * numbers[Z]


def test_what_grows_is_taken_back() -> None:
    text = macro()["tc.nc"].decode()
    assert settle(text, {ON: 1.0, T: 30.0, Z: 0.0}) == pytest.approx(-20.0)  # 10 K of 2 um
    assert settle(text, {ON: 1.0, T: 15.0, Z: 0.0}) == pytest.approx(10.0)
    assert settle(text, {ON: 1.0, T: 30.0, Z: 0.25}) == pytest.approx(230.0)  # what stood there before stays


def test_a_call_moves_a_little_and_no_further_than_the_limit() -> None:
    text, numbers = macro(2.0, Limits(magnitude=15.0, rate=0.05))["tc.nc"].decode(), {ON: 1.0, T: 60.0, Z: 0.0}
    seen = []
    for _ in range(10):
        call(text, numbers)
        seen.append(1e3 * numbers[Z])
    assert seen[:6] == pytest.approx([-3.0, -6.0, -9.0, -12.0, -15.0, -15.0])
    assert numbers[FORCE] == numbers[Z]


def test_switching_off_takes_it_back_step_by_step() -> None:
    text, numbers = macro()["tc.nc"].decode(), {ON: 1.0, T: 40.0, Z: 0.0}
    assert settle(text, numbers) == pytest.approx(-40.0)
    numbers[ON] = 0.0
    call(text, numbers)
    assert 1e3 * numbers[Z] == pytest.approx(-34.0)
    assert settle(text, numbers) == pytest.approx(0.0, abs=1e-9)
    del numbers[ON], numbers[T]  # vacant at the first power-on: off
    assert settle(text, numbers) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("bad", [None, -40.5, 150.5, 850.0])
def test_what_is_not_plausible_changes_nothing(bad: float | None) -> None:
    text, numbers = macro()["tc.nc"].decode(), {ON: 1.0, T: 40.0, Z: 0.0}
    settle(text, numbers)
    if bad is None:
        del numbers[T]
    else:
        numbers[T] = bad
    assert settle(text, numbers) == pytest.approx(-40.0)


def test_the_printed_error_is_that_of_a_replay(tmp_path: Path) -> None:
    recording = growing_machine(5.0, t3_C=4.0)
    assert exported(tmp_path, recording, "fanuc", "--rate", "1000", method="dynamic") == 0
    text, page = ((tmp_path / "out" / f"tc_thermal.{end}").read_text() for end in ("nc", "md"))
    places = {int(n): name for n, name in re.findall(r"^\(#(\d+): (\w+) IN DEGC", text, re.M)}
    warm, zero = temperatures(recording)
    upper = {name.upper(): name for name in warm}

    def offset(row: dict[str, float]) -> float:
        numbers = {ON: 1.0, Z: 0.0, **{n: row[upper[name]] for n, name in places.items()}}
        call(text, numbers)
        return 1e3 * numbers[Z]

    rows = [dict(zip(warm, values, strict=True)) for values in np.column_stack(list(warm.values())).tolist()]
    correction = np.array([offset(row) for row in rows]) - offset(zero)
    assert page_numbers(page)["written"] == pytest.approx(left(recording, correction), abs=5.1e-4)


def test_what_is_not_confirmed_is_marked() -> None:
    texts = macro()
    lines, page = texts["tc.nc"].decode().splitlines(), texts["tc.md"].decode()
    assert lines[1].startswith("O7701 (Z_UM: ACCEPTED ON UNSEEN CYCLES")
    begin = next(k for k, line in enumerate(lines) if line.startswith("(#500"))
    assert sum(line.startswith("(UNCONFIRMED") for line in lines[:begin]) == len(UNCONFIRMED)
    for line in lines[begin:]:
        if ("THEN" in line and "GT" in line) or re.match(r"\(#50[1-9]|#52\d\d=", line):
            assert "UNCONFIRMED" in line, line
    assert page.index("UNCONFIRMED") < page.index("# tc")
    assert all(line.isascii() and line.upper() == line for line in lines)
    assert all(re.sub(r"\([^()]*\)", "", line).count("(") == 0 for line in lines)


@pytest.mark.parametrize("name", ["t (front) #1", "Lager \u00d6l %", "[x]; ] M30", "a|b <c>"])
def test_a_name_ends_no_comment(name: str, tmp_path: Path) -> None:
    """What somebody called a sensor stands in comments alone, whatever the controller."""
    model = growing("z_um", 12.0)
    model = replace(model, inputs=(replace(model.inputs[0], name=name),))
    for write in (write_fanuc, write_heidenhain, write_klipper):
        for file, content in write([as_it_is(model, "Z")], Limits(), "tc", FACTS).items():
            (tmp_path / file).write_bytes(content)
        done = subprocess.run(
            [sys.executable, str(tmp_path / "tc_check.py")], check=True, capture_output=True, text=True
        )
        assert ", 0 wrong" in done.stdout
    code = [re.sub(r"\([^()]*\)", "", line) for line in (tmp_path / "tc.nc").read_text().splitlines()]
    plain = macro(12.0)["tc.nc"].decode().splitlines()
    assert code == [re.sub(r"\([^()]*\)", "", line) for line in plain]


def test_the_vectors_hold_and_find_a_mistake(tmp_path: Path) -> None:
    texts = macro(-12.0)
    for name, content in texts.items():
        (tmp_path / name).write_bytes(content)
    line = [sys.executable, str(tmp_path / "tc_check.py")]
    assert ", 0 wrong" in subprocess.run(line, check=True, capture_output=True, text=True).stdout
    for was, becomes in (("-12.0*", "12.0*"), ("GT150.0]GOTO", "GT950.0]GOTO"), ("THEN#1=0.5", "THEN#1=0.6")):
        text = texts["tc.nc"].decode()
        assert was in text
        (tmp_path / "other.nc").write_text(text.replace(was, becomes))
        done = subprocess.run([*line, str(tmp_path / "other.nc")], check=False, capture_output=True)
        assert done.returncode == 1, was


@settings(max_examples=60)
@given(
    per_kelvin=st.one_of(st.floats(1e-9, 900.0), st.floats(-900.0, -1e-9)),
    magnitude=st.floats(1e-4, 1e9),
    rate=st.floats(2e-6, 1e9),
)
def test_every_number_has_eight_digits_and_no_limit_gets_larger(
    per_kelvin: float, magnitude: float, rate: float
) -> None:
    text = macro(per_kelvin, Limits(magnitude=magnitude, rate=rate))["tc.nc"].decode()
    code = [re.sub(r"\(.*?\)", "", line) for line in text.splitlines() if not line.startswith("%")]
    numbers = re.findall(r"(?<![#\d.])\d+\.\d+", "\n".join(code))
    assert numbers
    for number in numbers:
        whole, behind = number.split(".")
        assert len(whole.lstrip("0")) + len(behind.rstrip("0")) <= 8, number
        assert len(behind) <= 7, number
    limits = [Fraction(n) for n in re.findall(r"THEN#[12]=(\d+\.\d+)", "\n".join(code))]
    asked = [Fraction(repr(magnitude)) / 1000, Fraction(repr(rate)) * 60 / 1000]
    for taken, wanted in zip(limits, asked, strict=True):
        assert 0 < taken <= wanted
        digits = max(Fraction(1, 10**7), wanted / 10**7)
        assert wanted - taken < digits or taken == 99_999_999


@pytest.mark.parametrize("limits", [Limits(rate=1.5e-6), Limits(magnitude=9e-5)])
def test_a_limit_that_is_nothing_in_eight_digits_is_refused(limits: Limits) -> None:
    with pytest.raises(
        InputError, match=r"accepts eight digits, in which this value is 0: give at least --(rate|magn)"
    ):
        macro(limits=limits)
