"""Macros of Fanuc, Haas and Okuma: what they move, what they leave, what they refuse; what is not confirmed."""

import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from driftmodels import growing
from hypothesis import given, settings
from hypothesis import strategies as st
from poorcontroller import exported, growing_machine, left, page_numbers, temperatures

from thermocomp.core.correction import Limits
from thermocomp.core.exceptions import InputError
from thermocomp.export.facts import Facts
from thermocomp.export.heidenhain.package import write_heidenhain
from thermocomp.export.klipper.package import write_klipper
from thermocomp.export.macros.controls import FANUC, HAAS, OKUMA, Control
from thermocomp.export.macros.package import write_macro
from thermocomp.export.reduction.reduced import as_it_is, mark

FACTS = Facts("model.json", "0" * 64, "1.0", "2026-01-31")
CONTROLS = {"fanuc": FANUC, "haas": HAAS, "okuma": OKUMA}
WORDS: dict[str, Callable[[float, float], bool]] = {
    "EQ": lambda a, b: a == b,
    "NE": lambda a, b: a != b,
    "LT": lambda a, b: a < b,
    "GT": lambda a, b: a > b,
}
WORDS |= {"LE": lambda a, b: a <= b, "GE": lambda a, b: a >= b}


@pytest.fixture(params=CONTROLS)
def control(request: pytest.FixtureRequest) -> Control:
    return CONTROLS[request.param]


def on(control: Control) -> str:
    return {"#": "#500", "V": "VC150"}[control.common[0]]


def heat(control: Control) -> str:
    return {"#": "#501", "V": "VC151"}[control.common[0]]


def offsets(control: Control, axis: str = "Z") -> list[str]:
    if control is OKUMA:
        return [f"VZOF{axis}[{n}]" for n in range(1, 7)]
    return [f"#520{1 + 'XYZ'.index(axis)}"]


def macro(per_kelvin: float = 2.0, limits: Limits = Limits(), control: Control = FANUC) -> dict[str, bytes]:
    return write_macro(control, [as_it_is(growing("z_um", per_kelvin), "Z")], limits, "tc", FACTS)


def source(texts: dict[str, bytes]) -> str:
    (text,) = (t for name, t in texts.items() if name.endswith((".nc", ".SSB")))
    return text.decode()


def call(text: str, numbers: dict[str, float]) -> None:
    """Run a macro once, as far as it uses the language: assignments, IF with a jump, labels, M99 or RTS."""
    lines = [re.sub(r"\([^()]*\)", "", line).strip() for line in text.splitlines()]
    lines = [line for line in lines if line and line != "%" and not line.startswith("O")]
    iso = lines[-1] == "M99"
    name = r"#\d+" if iso else r"VZOF[XYZ]\[\d\]|[A-Z]{2}\d{1,3}"

    def real(words: str) -> float:
        tokens = re.findall(rf"ROUND|{name}|\d+\.?\d*|[-+*/\[\]]", words)
        assert "".join(tokens) == words, words
        plain = [{"[": "(", "]": ")"}.get(t, repr(numbers[t]) if re.fullmatch(name, t) else t) for t in tokens]
        return float(eval(" ".join(plain), {"__builtins__": {}, "ROUND": round}))

    def true(words: str) -> bool:
        left_side, word, right_side = words.split(" ")
        if right_side == "#0":  # vacant
            assert iso
            return (left_side not in numbers) == (word == "EQ")
        if left_side not in numbers and iso:  # vacant is not a number
            return word == "NE"
        return WORDS[word](numbers.get(left_side, 0.0), real(right_side))

    k = 0
    while lines[k] not in ("M99", "RTS"):
        line = re.sub(r"^N\d+ ?", "", lines[k])
        k += 1
        if jump := re.fullmatch(r"IF \[(.+)\] GOTO(\d+)" if iso else r"IF \[(.+)\] N(\d+)", line):
            if true(jump[1]):
                (k,) = (j for j, other in enumerate(lines) if re.match(rf"N{jump[2]}(?!\d)", other))
        elif line:
            variable, words = line.split("=")
            assert re.fullmatch(name, variable), line
            numbers[variable] = real(words)


def settle(text: str, numbers: dict[str, float], control: Control = FANUC) -> float:
    """Return the offsets of Z after many calls [um]: all are the same."""
    before: dict[str, float] = {}
    while numbers != before:
        before = dict(numbers)
        call(text, numbers)
    (found,) = {round(1e3 * numbers[place], 9) for place in offsets(control)}
    return found


def begin(control: Control, warm: float, offset: float = 0.0) -> dict[str, float]:
    never = {} if control.vacant else {f"VC17{k}": 0.0 for k in (1, 2, 3)}
    return never | {on(control): 1.0, heat(control): warm, **dict.fromkeys(offsets(control), offset)}


def test_what_grows_is_taken_back(control: Control) -> None:
    text = source(macro(control=control))
    assert settle(text, begin(control, 30.0), control) == pytest.approx(-20.0)  # 10 K of 2 um
    assert settle(text, begin(control, 15.0), control) == pytest.approx(10.0)
    before = 0.0 if control is HAAS else 250.0  # G52 may be cleared by others: it is written, not added to
    assert settle(text, begin(control, 30.0, 0.25), control) == pytest.approx(before - 20.0)


def test_a_call_moves_a_little_and_no_further_than_the_limit(control: Control) -> None:
    text, numbers = source(macro(2.0, Limits(magnitude=15.0, rate=0.05), control)), begin(control, 60.0)
    seen = []
    for _ in range(10):
        call(text, numbers)
        seen.append(1e3 * numbers[offsets(control)[0]])
    assert seen[:6] == pytest.approx([-3.0, -6.0, -9.0, -12.0, -15.0, -15.0])
    assert numbers[control.variable(23)] == numbers[offsets(control)[-1]]
    numbers[heat(control)] = -20.0
    call(text, numbers)
    assert 1e3 * numbers[offsets(control)[0]] == pytest.approx(-12.0)


def test_switching_off_takes_it_back_step_by_step(control: Control) -> None:
    text, numbers = source(macro(control=control)), begin(control, 40.0)
    assert settle(text, numbers, control) == pytest.approx(-40.0)
    numbers[on(control)] = 0.0
    call(text, numbers)
    assert 1e3 * numbers[offsets(control)[0]] == pytest.approx(-34.0)
    assert settle(text, numbers, control) == pytest.approx(0.0, abs=1e-9)
    if control.vacant:
        del numbers[on(control)], numbers[heat(control)]  # vacant at the first power-on: off
    assert settle(text, numbers, control) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("bad", [None, -40.5, 150.5, 850.0, 999.0])
def test_what_is_not_plausible_changes_nothing(bad: float | None, control: Control) -> None:
    text, numbers = source(macro(control=control)), begin(control, 40.0)
    settle(text, numbers, control)
    if bad is None and control.vacant:
        del numbers[heat(control)]
    else:
        numbers[heat(control)] = bad or 999.0
    assert settle(text, numbers, control) == pytest.approx(-40.0)


@pytest.mark.parametrize("to", CONTROLS)
def test_the_printed_error_is_that_of_a_replay(to: str, tmp_path: Path) -> None:
    recording, control = growing_machine(5.0, t3_C=4.0), CONTROLS[to]
    assert exported(tmp_path, recording, to, "--rate", "1000", "--program", "812", method="dynamic") == 0
    text = (tmp_path / "out" / f"tc_thermal.{control.ending}").read_text()
    page = (tmp_path / "out" / "tc_thermal.md").read_text()
    number = {"fanuc": "O0812", "haas": "O00812", "okuma": "O0812"}[to]
    assert text.startswith("%\n" * (to != "okuma") + f"{number} (Z_UM: ")
    assert f"P{812}`" in page or "`CALL O812`" in page
    places = dict(re.findall(r"^\((\S+): (\w+) IN DEGC", text, re.M))
    warm, zero = temperatures(recording)
    upper = {name.upper(): name for name in warm}

    def offset(row: dict[str, float]) -> float:
        numbers = {**begin(control, 0.0), **{n: row[upper[name]] for n, name in places.items()}}
        call(re.sub(r"ROUND\[(\S+)\]", r"\1", text), numbers)  # the error of the formula: rounding comes on top
        return 1e3 * numbers[offsets(control)[0]]

    rows = [dict(zip(warm, values, strict=True)) for values in np.column_stack(list(warm.values())).tolist()]
    correction = np.array([offset(row) for row in rows]) - offset(zero)
    assert page_numbers(page)["written"] == pytest.approx(left(recording, correction), abs=5.1e-4)


def test_what_an_offset_rounds_away_does_not_add_up(control: Control) -> None:
    """Registers hold whole micrometres: a warm-up of 0.02 um per call arrives, and goes back."""
    text, numbers = source(macro(control=control)), begin(control, 20.0)
    for heat_now in (*np.arange(20.0, 30.0, 0.01), *np.arange(30.0, 20.0, -0.01)):
        numbers[heat(control)] = float(heat_now)
        call(text, numbers)
        for place in offsets(control):
            numbers[place] = round(numbers[place], 3)
            assert 1e3 * numbers[place] == pytest.approx(-2.0 * (heat_now - 20.0), abs=0.51)


def test_the_axes_do_not_get_into_each_other(control: Control) -> None:
    both = [as_it_is(growing(f"{axis}_um", factor), axis.upper()) for axis, factor in (("x", 2.0), ("z", -3.0))]
    text = source(write_macro(control, both, Limits(), "tc", FACTS))
    numbers = begin(control, 30.0) | dict.fromkeys(offsets(control, "X"), 0.0)
    assert settle(text, numbers, control) == pytest.approx(30.0)
    assert {round(1e3 * numbers[place], 9) for place in offsets(control, "X")} == {-20.0}


def test_what_is_not_confirmed_is_marked(control: Control) -> None:
    texts = macro(control=control)
    lines, page = source(texts).splitlines(), texts["tc.md"].decode()
    first = next(k for k, line in enumerate(lines) if line.startswith("O"))
    assert re.match(r"O0?7701 \(Z_UM: ACCEPTED ON UNSEEN CYCLES", lines[first])
    begun = next(k for k, line in enumerate(lines) if line.startswith(f"({on(control)}"))
    assert sum(line.startswith("(UNCONFIRMED") for line in lines[:begun]) == len(control.unconfirmed)
    for line in lines[begun:]:
        if re.match(r"\(#50[1-9]|\(VC15[1-9]|#52\d\d=|VZOF", line):
            assert "UNCONFIRMED" in line, line
    assert page.index("UNCONFIRMED") < page.index("# tc")
    assert control.known in page
    assert all(line.isascii() and line.upper() == line and len(line) < 158 for line in lines)
    assert all(re.sub(r"\([^()]*\)", "", line).count("(") == 0 for line in lines)


@pytest.mark.parametrize("name", ["t (front) #1", "Lager \u00d6l %", "[x]; ] M30", "a|b <c>", "\u4e3b\u8f74 \u00b0C"])
def test_a_name_ends_no_comment(name: str, tmp_path: Path) -> None:
    """What somebody called a sensor stands in comments alone, whatever the controller; its page has the table."""
    model = growing("z_um", 12.0)
    model = replace(model, inputs=(replace(model.inputs[0], name=name),))
    writers: list[tuple[str, Any]] = [(c.ending, partial(write_macro, c)) for c in CONTROLS.values()]
    for own, write in (*writers, ("txt", write_heidenhain), ("cfg", write_klipper)):
        for file, content in write([as_it_is(model, "Z")], Limits(), "tc", FACTS).items():
            (tmp_path / file).write_bytes(content)
        done = subprocess.run(
            [sys.executable, str(tmp_path / "tc_check.py")], check=True, capture_output=True, text=True
        )
        assert ", 0 wrong" in done.stdout
        if own != "cfg":  # comments of Klipper are in UTF-8
            page = (tmp_path / "tc.md").read_text(encoding="utf-8")
            row = rf"^\| \S+ \| {mark(name)} \| {re.escape(name.replace('|', '/'))} \|$"
            assert re.search(row, page, re.M | re.IGNORECASE)
            assert (tmp_path / f"tc.{own}").read_bytes().isascii()
    code = [re.sub(r"\([^()]*\)", "", line) for line in (tmp_path / "tc.nc").read_text().splitlines()]
    plain = macro(12.0, control=HAAS)["tc.nc"].decode().splitlines()
    assert code == [re.sub(r"\([^()]*\)", "", line) for line in plain]


def test_names_are_told_apart_and_can_be_read() -> None:
    marks: list[str] = []
    for name in (
        "\u4e3b\u8f74_C",
        "\u5bfc\u8f68_C",
        "Spindelstock hinten \u00b0C",
        "K\u00fchl\u00f6l Au\u00dfen",
        "KUHLOL AUSSEN",
    ):
        marks.append(mark(name, marks))
    assert marks == ["n1_C", "n2_C", "Spindelstock_hinten_C", "Kuhlol_Aussen", "KUHLOL_AUSSEN_4"]


def test_the_vectors_hold_and_find_a_mistake(tmp_path: Path, control: Control) -> None:
    texts = macro(-12.0, control=control)
    for name, content in texts.items():
        (tmp_path / name).write_bytes(content)
    line = [sys.executable, str(tmp_path / "tc_check.py")]
    assert ", 0 wrong" in subprocess.run(line, check=True, capture_output=True, text=True).stdout
    label = "GOTO" if control.vacant else "N"
    wrong = [("-12.0*", "12.0*"), (f"GT 150.0] {label}", f"GT 950.0] {label}"), ("=0.5\n", "=0.6\n")]
    last = offsets(control)[-1]
    wrong += [(f"{last}={last}+", f"{last}={last}-") if control.adds else (f"{last}=#523", f"{last}=#522")]
    for was, becomes in wrong:
        text = source(texts)
        assert was in text
        (tmp_path / "other").write_text(text.replace(was, becomes))
        done = subprocess.run([*line, str(tmp_path / "other")], check=False, capture_output=True)
        assert done.returncode == 1, was


@settings(max_examples=60)
@given(
    per_kelvin=st.one_of(st.floats(1e-9, 900.0), st.floats(-900.0, -1e-9)),
    magnitude=st.floats(1.0, 1e9),
    rate=st.floats(0.017, 1e9),
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
    limits = [Fraction(n) for n in re.findall(r"IF \[#[12] LE (\d+\.\d+)\]", "\n".join(code))]
    asked = [Fraction(repr(magnitude)) / 1000, Fraction(repr(rate)) * 60 / 1000]
    for taken, wanted in zip(limits, asked, strict=True):
        assert 0 < taken <= wanted
        digits = max(Fraction(1, 1000), wanted / 10**7)
        assert wanted - taken < digits or taken == 99_999_999


@pytest.mark.parametrize("limits", [Limits(rate=0.0166), Limits(magnitude=0.99)])
def test_a_limit_of_less_than_a_micrometre_is_refused(limits: Limits) -> None:
    with pytest.raises(InputError, match=r"whole um: give at least --(rate 0\.0167|magnitude 1)$"):
        macro(limits=limits)
