"""Bands: what share of unseen cycles they hold, where the truth is known."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from thermocomp.core.band import CONFORMAL
from thermocomp.models.averaged import AveragedDynamic
from thermocomp.models.bands import find_band
from thermocomp.models.numerics.folds import find_neighbours

ROWS = 40


def errors(rng: np.random.Generator, cycles: int, *, heavy: bool = False) -> NDArray[np.float64]:
    """Return errors (cycles, rows) that a cycle has as a whole, and a little of its own in each row."""
    own = stats.t.rvs(2, size=cycles, random_state=rng) if heavy else rng.normal(size=cycles)
    return own[:, None] + 0.1 * rng.normal(size=(cycles, ROWS))


def held(rng: np.random.Generator, cycles: int, *, heavy: bool = False) -> float:
    seen, new = errors(rng, cycles, heavy=heavy), errors(rng, 50, heavy=heavy)
    running = np.arange(ROWS) < ROWS // 2
    band = find_band(
        seen.ravel(), np.zeros(seen.size), np.repeat(np.arange(cycles), ROWS), np.tile(running, cycles), (0,)
    )
    assert band is not None
    widths = band.half_width(np.where(running, 1000.0, 0.0)[:, None], np.zeros(ROWS))
    return float((np.abs(new) <= widths).mean())


@pytest.mark.parametrize("cycles", [3, 5])
def test_few_cycles_hold_what_is_assumed(cycles: int) -> None:
    rng = np.random.default_rng(cycles)
    assert 0.9 <= np.mean([held(rng, cycles) for _ in range(400)]) <= 0.97


@pytest.mark.parametrize("heavy", [False, True])
@pytest.mark.parametrize("cycles", [9, 20])
def test_many_cycles_hold_whatever_the_law(cycles: int, heavy: bool) -> None:
    rng = np.random.default_rng(cycles)
    mean = np.mean([held(rng, cycles, heavy=heavy) for _ in range(300)])
    assert 0.88 <= mean <= 0.9 + 1 / (cycles + 1) + 0.02


def test_nine_cycles_are_needed_for_that() -> None:
    def basis(cycles: int) -> str:
        seen = errors(np.random.default_rng(0), cycles)
        labels = np.repeat(np.arange(cycles), ROWS)
        band = find_band(seen.ravel(), np.zeros(seen.size), labels, np.ones(seen.size, dtype=bool))
        assert band is not None
        assert band.cycles == cycles
        return band.basis

    assert CONFORMAL == 9
    assert [basis(n) for n in (2, 8, 9, 15)] == ["assumption", "assumption", "conformal", "conformal"]


def test_one_cycle_says_nothing() -> None:
    assert find_band(np.ones(9), np.ones(9), np.zeros(9, dtype=int), np.ones(9, dtype=bool)) is None


def test_phases_and_spread_have_a_width_each() -> None:
    rng = np.random.default_rng(1)
    cycle, turning = np.repeat(np.arange(6), 100), np.tile(np.arange(100) < 50, 6)
    spread = np.where(np.arange(600) % 2, 3.0, 1.0)
    band = find_band(rng.normal(size=600) * spread * np.where(turning, 4.0, 1.0), spread, cycle, turning, (0,))
    assert band is not None
    assert band.running > 2.0 * band.stopped
    at = band.half_width(np.zeros((2, 1)), np.array([0.0, 30.0]))
    assert at[0] == pytest.approx(band.stopped * band.floor)
    assert at[1] == pytest.approx(30.0 * band.stopped, rel=1e-2)


def test_errors_of_zero_have_a_band_of_zero() -> None:
    cycle = np.repeat(np.arange(10), 5)
    band = find_band(np.zeros(50), np.zeros(50), cycle, np.ones(50, dtype=bool))
    assert band is not None
    assert 0.0 < band.half_width(np.zeros(1), np.zeros(())) < 1e-9


def near(cycles: int, recordings: int = 1) -> list[list[int]]:
    """Return the folds left out with each fold, for recordings of equally many cycles of three rows."""
    folds = np.repeat(np.arange(cycles * recordings), 3)
    step = np.where(np.arange(len(folds)) % (3 * cycles) == 0, np.inf, 60.0)
    return [np.flatnonzero(row).tolist() for row in find_neighbours(folds, step)]


@pytest.mark.parametrize("cycles", [1, 3, 4])
def test_few_cycles_are_left_out_one_by_one(cycles: int) -> None:
    assert near(cycles) == [[k] for k in range(cycles)]


def test_neighbours_are_left_out_too() -> None:
    assert near(5) == [[0, 1], [0, 1, 2], [1, 2, 3], [2, 3, 4], [3, 4]]
    assert near(9)[:3] == [[0, 1, 2], [0, 1, 2, 3], [0, 1, 2, 3, 4]]
    assert max(map(len, near(40))) == 5


def test_cycles_of_other_recordings_are_no_neighbours() -> None:
    assert near(1, 9) == [[k] for k in range(9)]
    assert near(3, 2) == [[0, 1], [0, 1, 2], [1, 2], [3, 4], [3, 4, 5], [4, 5]]


def test_a_cycle_is_not_predicted_by_its_neighbours() -> None:
    """The deviation of a cycle may be known from its neighbours only: then its error is that of an unknown one."""
    rng = np.random.default_rng(0)
    cycle, dt = np.repeat(np.arange(6), ROWS), np.r_[np.inf, np.full(6 * ROWS - 1, 60.0)]
    temperatures = rng.normal(size=(6, 1, 3)).repeat(2, axis=0)[:6].repeat(ROWS, axis=1).reshape(-1, 3)
    rises = temperatures + 0.01 * rng.normal(size=temperatures.shape)
    rises[0] = 0.0
    y = rises @ np.array([5.0, -3.0, 4.0])

    def apart(step: NDArray[np.float64]) -> float:
        fit = AveragedDynamic(time="routed", noise=0.0, structures=20).fit(rises, y, dt=step, cycle=cycle)
        return float(np.sqrt(np.mean((fit.left_out_[:, 0] - y) ** 2)))

    alone = np.where(np.arange(len(y)) % ROWS == 0, np.inf, 60.0)  # each cycle a recording
    assert apart(dt) > 1.2 * apart(alone)
