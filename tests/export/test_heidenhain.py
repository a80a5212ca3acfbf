"""Heidenhain's formulas: their error by a replay of what is printed; what nobody has confirmed is marked."""

import csv
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from driftmodels import growing
from poorcontroller import (
    exported,
    growing_machine,
    heidenhain,
    left,
    left_out_cycles,
    page_numbers,
    temperatures,
)

from thermocomp.core.correction import Limits
from thermocomp.export.facts import Facts
from thermocomp.export.heidenhain.package import UNCONFIRMED, formula, write_heidenhain
from thermocomp.export.reduction.reduced import as_it_is

FACTS = Facts("model.json", "0" * 64, "1.0", "2026-01-31")


def test_the_example_of_the_field() -> None:
    """A bar of steel, 300 mm long, of 11.5 um/m/K: 300+3.45e-3*(W486-20)."""
    bar = as_it_is(growing("z_um", 3.45), "Z")
    words = {"t": np.array([20.0, 30.0, -5.0])}
    assert formula(bar, {"t": "t"}) == "+0.00345*(W<t>-20)"
    ours, theirs = (
        heidenhain(f"<L>{formula(bar, {'t': 't'})}", words, 300.0),
        heidenhain("300+3.45e-3*(W<t>-20)", words),
    )
    assert ours == pytest.approx(theirs, abs=1e-12)
    assert heidenhain(formula(bar, {"t": "t"}, word=True), words) == pytest.approx([0.0, -34.5, 86.25])


def test_the_printed_error_is_that_of_a_replay(tmp_path: Path) -> None:
    recording = growing_machine(5.0, t3_C=4.0)
    assert exported(tmp_path, recording, "heidenhain", method="dynamic") == 0
    text, page = ((tmp_path / "out" / f"tc_thermal.{end}").read_text() for end in ("txt", "md"))
    found = re.search(r"^Z formula: (.*)$", text, re.M)
    word = re.search(r"^Z word: (.*)$", text, re.M)
    assert found is not None
    assert word is not None
    warm, zero = temperatures(recording)
    at_zero = {n: np.array(v) for n, v in zero.items()}
    growth = 1e3 * (heidenhain(found[1], warm, 300.0) - heidenhain(found[1], at_zero, 300.0))
    printed = page_numbers(page)
    assert printed["written"] == pytest.approx(left(recording, -growth), abs=5.1e-4)
    assert heidenhain(word[1], warm) - heidenhain(word[1], at_zero) == pytest.approx(-growth, abs=1e-9)
    squares, rows = 0.0, 0
    for cycle, (factors, (_, _, reduced)) in zip(recording.cycles, left_out_cycles(page), strict=True):
        said = np.sum([f * (warm[n] - zero[n]) for n, f in factors.items()], axis=0)
        rms, _ = left(recording, -said, slice(cycle.start, cycle.stop))
        assert reduced == pytest.approx(rms, abs=5.1e-4)
        squares, rows = squares + rms**2 * (cycle.stop - cycle.start), rows + cycle.stop - cycle.start
    assert printed["RMS"][2] == pytest.approx(np.sqrt(squares / rows), abs=5.1e-4)
    assert printed["RMS"][2] < 0.2
    assert printed["RMS"][0] > 10


def test_what_is_not_confirmed_is_marked() -> None:
    texts = write_heidenhain([as_it_is(growing("z_um", 2.0), "Z")], Limits(), "tc", FACTS)
    lines, page = texts["tc.txt"].decode().splitlines(), texts["tc.md"].decode()
    first = lines.index("")
    assert lines[0] == "; z_um: accepted on unseen cycles; the full model, not reduced"
    assert all(f"; {line}" in lines[:first] for line in UNCONFIRMED)
    for k, line in enumerate(lines):
        if line.startswith(("Z formula", "Z word")):
            assert lines[k - 1].startswith("; UNCONFIRMED")
    assert page.index("UNCONFIRMED") < page.index("## Residual error")
    assert page.partition("## Install")[2].partition("## Check")[0].count("**UNCONFIRMED**") == 2


def test_the_vectors_hold_and_find_a_mistake(tmp_path: Path) -> None:
    both = [as_it_is(growing("z_um", 2.0), "Z"), as_it_is(growing("x_um", -0.123456), "X")]
    texts = write_heidenhain(both, Limits(), "tc", FACTS)
    for name, text in texts.items():
        (tmp_path / name).write_bytes(text)
    formulas = dict(re.findall(r"^([XZ]) formula: (.*)$", texts["tc.txt"].decode(), re.M))
    with (tmp_path / "tc_vectors.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        growth = float(heidenhain(formulas[row["axis"]], {"t": np.array(float(row["t_degC"]))}))
        assert growth == pytest.approx(float(row["growth_mm"]), abs=1e-6)
        assert -1e3 * growth == pytest.approx(float(row["correction_um"]), abs=0.01)
    warm = [float(row["t_degC"]) for row in rows]
    assert min(warm) < -30 < 70 < max(warm)
    line = [sys.executable, str(tmp_path / "tc_check.py")]
    assert ", 0 wrong" in subprocess.run(line, check=True, capture_output=True, text=True).stdout
    other = tmp_path / "other.txt"
    other.write_text(texts["tc.txt"].decode().replace("-20)", "-21)"))
    assert subprocess.run([*line, str(other)], check=False, capture_output=True).returncode == 1


@pytest.mark.parametrize(("magnitude", "word"), [(500.0, 500), (12345.9, 12345), (1e9, 32767), (0.5, 0)])
def test_the_limit_of_a_word_is_whole_and_never_larger(magnitude: float, word: int) -> None:
    limits = Limits(magnitude=magnitude)
    text = write_heidenhain([as_it_is(growing("z_um", 2.0), "Z")], limits, "tc", FACTS)["tc.txt"].decode()
    assert f"rounded, within +-{word}\n" in text
