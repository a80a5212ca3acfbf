"""Chen 1996, section 3.1: the first screening decides which temperatures are left, not a list (C-11)."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from thermocomp.judging import selecting, splits
from thermocomp.judging.choice import Settings
from thermocomp.models.second_order import SecondOrderRegression
from thermocomp.models.selection.collinearity import Screening
from thermocomp.papers import common
from thermocomp.papers.chen1996 import screening, setup
from thermocomp.papers.chen1996.screening import Screened
from thermocomp.papers.chen1996.setup import DRIFTS, SENSORS, TEMPERATURES

SEED = 3


@pytest.fixture(scope="module")
def screened() -> Screened:
    samples = setup.drift_samples(setup.recordings("chen1996", SEED))
    heat = samples.only(TEMPERATURES)
    wide = {t: common.fit_and_freeze(SecondOrderRegression(second_order=False), heat, [t])[t] for t in DRIFTS}
    learned: Any = SimpleNamespace(samples=samples, models=wide, wide=wide)
    return screening.learn(SEED, SEED + 1, learned)


def test_nine_of_24_are_left(screened: Screened) -> None:
    """All temperatures of the machine are candidates; T5, a mean, is none."""
    assert len(screened.names) == len({*screened.names}) == 24
    assert {*SENSORS} < {*screened.names}
    assert "T5" not in screened.names
    assert len({*screened.kept}) == 9
    assert screened.returned == [t for t in SENSORS if t in screened.kept]


def test_the_command_leaves_the_same(screened: Screened) -> None:
    samples = common.stacked(setup.recordings("chen1996", SEED), tuple(DRIFTS))
    heat = samples.only([n for n in screened.names if n != "T5"])
    (choice,) = selecting.select("correlation", heat, splits.leave_one_cycle_out(heat), Settings())
    assert list(choice.sensors) == screened.kept


def test_models_on_those_left_are_compared_on_the_new_tests(screened: Screened) -> None:
    for errors in screened.errors.values():
        assert list(errors) == [screening.NONE, "Table 2", "Table 1", "screening"]
        assert errors["Table 2"] == errors["Table 1"] != errors["screening"]
        assert 0 < errors["screening"] < errors[screening.NONE]
    # the new tests are not those learned from
    first = common.stacked(setup.recordings("chen1996", SEED), tuple(DRIFTS), ["T1"])
    assert screened.errors["z"][screening.NONE] != pytest.approx(common.rms(common.take_measured(first, "z")), rel=1e-3)


def keeping(names: list[str], kept: list[str]) -> Screened:
    """Return a screening that keeps some of several temperatures; the first are the most strongly correlated."""
    strength = np.linspace(0.9, 0.1, len(names))[:, None] * [1.0, -1.0, 0.5]
    likeness = np.eye(len(names)) * 0.2 + 0.8
    found = Screening(strength, likeness, tuple(names.index(k) for k in kept))
    errors = {t: {"no compensation": 1.0, "Table 2": 1.0, "Table 1": 1.0, "screening": 1.0} for t in DRIFTS}
    return Screened(names, found, (0.1, 0.2, -0.95), errors)


def test_the_claim_can_hold_and_fail() -> None:
    others = [f"other {k}" for k in range(16)]
    whole = keeping([*others, *SENSORS], [*SENSORS, "other 3"])
    (claim,) = screening.claims.judged("table_1", whole)
    assert claim.holds
    assert claim.ours.startswith("24 -> 9: T1 T2 T3 T4 T6 T7 T8 T9, 8 of the 8 places of Table 1 (3 by chance)")
    assert claim.ours.endswith("the 9 with the strongest correlations alone: 0")
    fewer = keeping([*SENSORS, *others], [t for t in SENSORS if t != "T4"] + ["other 3", "other 4"])
    (claim,) = screening.claims.judged("table_1", fewer)
    assert claim.holds is False
    assert claim.ours.endswith("strongest correlations alone: 8")
    assert "T1 for T4 (0.80)" in claim.finding
    assert "correlated by 0.80 or more" in claim.finding
    (strong,) = screening.claims.judged("strong", fewer)
    assert "0.66 (T9) to 0.95" in strong.ours


def test_the_table_shows_all_temperatures(screened: Screened) -> None:
    (table,) = screening.tables(screened)
    assert len(table.rows) == 24 + 1
    assert [row[0] for row in table.rows[:10]] == [*map(str, range(1, 10)), ""]
    assert [row[1] for row in table.rows[:9]] == screened.kept
    assert sorted(int(row[6]) for row in table.rows[:-1]) == [*range(1, 25)]
    assert table.rows[-1][1:3] == ["T5", "mean of T6 to T9"]
    numbers = screening.numbers(replace(screened, average=(0.0, 0.0, 0.0)))
    assert numbers == {
        "screening_candidates": 24.0,
        "screening_kept": 9.0,
        "screening_returned": float(len(screened.returned)),
    }
