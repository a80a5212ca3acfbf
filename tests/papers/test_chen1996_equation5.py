"""Chen 1996, Fig. 2: Eq. 5, planted in 810 rows, is sought; what is told of it can be false."""

import math
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from thermocomp.papers import common
from thermocomp.papers.chen1996 import equation5, setup
from thermocomp.papers.chen1996.drift import EQ5
from thermocomp.papers.chen1996.equation5 import Equation5
from thermocomp.papers.chen1996.law import evaluate
from thermocomp.papers.chen1996.setup import TEMPERATURES
from thermocomp.recordings.samples import Samples


@pytest.fixture(scope="module")
def rows() -> Samples:
    return setup.drift_samples(setup.recordings("chen1996", 0))


@pytest.fixture(scope="module")
def sought(rows: Samples) -> Equation5:
    learned: Any = SimpleNamespace(samples=rows, regressions={"x": SimpleNamespace(standard_error_=3.25)})
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(equation5, "DRAWS", 8)
        return equation5.seek(learned, 0)


def test_what_is_planted_is_eq_5(rows: Samples) -> None:
    """C-18: written out."""
    change = rows.only(TEMPERATURES).change()
    t = dict(zip(TEMPERATURES, change.T, strict=True))
    front, rear = t["T6"] - t["T7"], t["T8"] - t["T9"]
    x = -0.586 * t["T2"] + 7.527 * t["T3"] - 36.966 * front + 10.809 * rear
    x += -0.149 * t["T3"] ** 2 - 18.119 * front**2 + 2.499 * t["T2"] * front
    np.testing.assert_allclose(evaluate(EQ5, change), x, atol=1e-9)


def test_drift_that_the_statistics_imply() -> None:
    """C-19: SEE^2 (n - 7) is the share 1 - R2 of the sum of the squares of x."""
    assert pytest.approx(97, abs=0.5) == equation5.IMPLIED
    assert pytest.approx(1 - 0.988, abs=1e-9) == 10.628**2 * (810 - 7) / (810 * equation5.IMPLIED**2)


def test_the_printed_statistics_come_back(sought: Equation5) -> None:
    """C-18, C-19: with the multiplied law; as printed, x is too small here."""
    multiplied, printed = sought.multiplied, sought.printed
    assert (len(multiplied.found), len(printed.found)) == (8, 8)
    assert 4 < multiplied.factor < 5
    assert math.hypot(multiplied.drift, 10.628) == pytest.approx(equation5.IMPLIED)
    assert multiplied.drift == pytest.approx(multiplied.factor * printed.drift)
    assert multiplied.law["T3"] == pytest.approx(multiplied.factor * 7.527)
    assert multiplied.r2 == pytest.approx([0.988] * 8, abs=0.0025)
    assert multiplied.standard_error == pytest.approx([10.628] * 8, rel=0.1)
    assert len({*multiplied.r2}) == 8  # each draw has its own noise
    assert max(printed.r2) < 0.9
    assert printed.terms < multiplied.terms < 7
    assert 1 - multiplied.missing == multiplied.all_terms


def test_without_noise_all_seven_terms_come_back(rows: Samples, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(equation5, "SEE_X", 1e-3)
    monkeypatch.setattr(equation5, "DRAWS", 2)
    found = equation5.impose("quiet", 2.0, rows.only(TEMPERATURES), 1)
    assert (found.all_terms, found.terms) == (1.0, 7.0)
    for draw in found.found:
        assert [draw[t] for t in EQ5] == pytest.approx([2 * c for c in EQ5.values()], abs=0.01)


def test_claims_can_hold_and_fail(sought: Equation5) -> None:
    law = sought.multiplied.law
    for found, r2, verdicts in (
        ([law] * 20, [0.9884] * 20, (True, True)),
        ([law] * 18 + [{**law, "T1": 1.0}] * 2, [0.9884] * 20, (True, False)),
        ([{"T2": 1.0}] * 20, [0.987] * 20, (False, False)),
    ):
        made = replace(sought, multiplied=replace(sought.multiplied, found=found, r2=r2))
        consistent, recovered, as_printed, moves = equation5.claims(made)
        assert (consistent.holds, recovered.holds) == verdicts
        assert (as_printed.holds, moves.holds) == (None, None)


def test_how_little_x_moves_is_told(sought: Equation5, rows: Samples) -> None:
    """C-19: the range of x, and whether it is below Chen's standard error."""
    width = float(np.ptp(common.take_measured(rows, "x")))
    for times in (1.0, 20.0):
        (claim,) = equation5.claims.judged("moves", replace(sought, moves=times * sought.moves))
        assert f"range {times * width:.0f} um" in claim.ours
        assert ("less than the standard error of Chen's fit" in claim.ours) is (times * width < 10.628)
        assert claim.ours.endswith("standard error of its fit 3.25 um")


def test_the_table_shows_both(sought: Equation5) -> None:
    (table,) = equation5.tables(sought)
    assert [row[0] for row in table.rows] == ["as printed", "multiplied"]
    numbers = equation5.numbers(sought)
    assert numbers["eq5_factor"] == sought.multiplied.factor
    assert numbers["eq5_terms"] == sought.multiplied.terms
    assert numbers["eq5_terms_as_printed"] == sought.printed.terms
