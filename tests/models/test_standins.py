"""Sensors that stand in for each other: closed forms, and sets that stay what they are whatever cycle is left out."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from smallmachine import two_that_matter

from thermocomp.judging.sensorsets import choose_sets
from thermocomp.models.numerics.folds import halve
from thermocomp.models.selection.standins import StandInAnswer, make_up
from thermocomp.recordings.readers.recordings import read
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack
from thermocomp.recordings.starts import COLD


def products(*columns: np.ndarray) -> np.ndarray:
    table = np.column_stack(columns)
    return np.asarray(table.T @ table / len(table))


@pytest.fixture(scope="module")
def three() -> np.ndarray:
    """Three temperatures: the second is twice the first, the third is one of its own."""
    rng = np.random.default_rng(0)
    a, b = rng.normal(size=(2, 500))
    return products(a, 2 * a, b)


def test_a_copy_is_made_up_exactly(three: np.ndarray) -> None:
    made = make_up(three, [0, 2], 0.0)
    assert made == pytest.approx(np.array([[1, 2, 0], [0, 0, 0], [0, 0, 1]]), abs=1e-9)


def test_noise_shrinks_what_is_made_up_as_ridge_does(three: np.ndarray) -> None:
    for noise in (0.1, 0.5, 2.0):
        made = make_up(three, [0], noise)
        assert made[0, 1] == pytest.approx(three[0, 1] / (three[0, 0] + noise**2))
        assert made[0, 0] == 1
    weights = [float(make_up(three, [0], noise)[0, 1]) for noise in (0.0, 0.1, 0.5, 2.0)]
    assert weights == sorted(weights, reverse=True)


def test_a_dead_sensor_makes_nothing_and_costs_nothing(three: np.ndarray) -> None:
    gram = np.zeros((4, 4))
    gram[:3, :3] = three
    for noise in (0.0, 0.4):
        assert make_up(gram, [0, 2], noise)[:, 3] == pytest.approx(0)
        assert make_up(gram, [3], noise)[:, :3] == pytest.approx(0)
        answer = StandInAnswer(np.ones((1, 4, 1)), gram, noise)
        assert answer.stand_ins([0, 2]).residual[3] == 0
        assert answer.stand_ins([0, 2]).loss[3] == 0
    assert make_up(np.zeros((2, 2)), [0], 0.0) == pytest.approx(np.array([[1, 0], [0, 0]]))  # all of them are dead


def test_with_none_kept_nothing_is_made(three: np.ndarray) -> None:
    assert not make_up(three, [], 0.4).any()


def test_stand_ins_and_what_they_cost(three: np.ndarray) -> None:
    """The answer is 1 um per degC of the second sensor: what is missed of it is lost of the answer."""
    answer = StandInAnswer(np.array([[[0.0], [1.0], [0.0]]]), three, 0.0)
    found = answer.stand_ins([0, 2])
    assert found.single[:2] == (1, 0)
    assert found.single_residual[:2] == pytest.approx([0, 0], abs=1e-5)
    assert found.residual[1] == pytest.approx(0, abs=1e-5)
    assert found.loss[:, 0] == pytest.approx([0, 0, 0], abs=1e-5)
    # the only one that says what the second does is gone
    alone = answer.stand_ins([2])
    left = np.sqrt(three[1, 1] - three[1, 2] ** 2 / three[2, 2])
    assert alone.residual[1] == pytest.approx(left)
    assert alone.loss[1, 0] == pytest.approx(left)
    assert answer.lose(make_up(three, [2], 0.0))[0] == pytest.approx(left)
    # what is kept is made up from the others that are kept, here from none
    assert alone.residual[2] == pytest.approx(np.sqrt(three[2, 2]))
    assert not alone.weights[:, 2].any()


def test_what_lags_lose_together_is_counted_together() -> None:
    """The lag takes back what the temperature says: the answer loses nothing, though each of them would."""
    gram = np.ones((2, 2))
    both = StandInAnswer(np.array([[[1.0]], [[-1.0]]]), gram, 0.0)
    assert both.lose(np.zeros((1, 1)))[0] == 0
    assert StandInAnswer(np.array([[[1.0]], [[1.0]]]), gram, 0.0).lose(np.zeros((1, 1)))[0] == pytest.approx(2)


def test_a_single_temperature_has_no_other() -> None:
    found = StandInAnswer(np.ones((1, 1, 1)), np.eye(1), 0.4).stand_ins([0])
    assert found.single == (0,)
    assert np.isinf(found.single_residual[0])
    assert found.residual[0] == found.loss[0, 0] == 1


def names(samples: Samples, places: tuple[int, ...]) -> set[str]:
    temperatures = [c.name for c in samples.inputs if c.quantity == "temperature"]
    return {temperatures[j] for j in places}


@pytest.mark.parametrize("seed", range(3))
def test_of_two_copies_either_is_fine_and_never_both(seed: int) -> None:
    """Two sensors say what neither speed nor others do, and each has a copy: one of each is chosen, for any cycle."""
    plain = stack([two_that_matter(seed)], ["x_um"], starts=COLD)
    weather = 3 * np.sin(np.outer(plain.time / 3600, (0.9, 0.55)))
    samples = replace(plain, deviations=plain.deviations + weather @ [[6.0], [8.0]])
    samples.values[:, :2] = 20 + weather + 0.1 * (samples.values[:, :2] - 20)
    noise = np.random.default_rng(seed).normal(size=(len(samples), 2))
    for copied in (samples.values[:, :2], samples.values[:, :2] + 0.02 * noise):  # quite the same, and nearly so
        values = samples.values.copy()
        values[:, 6:8] = copied  # t7_C is as t1_C, and t8_C as t2_C
        given = replace(samples, values=values)
        for left_out in (None, 0, 2, 4):
            sets = choose_sets(given, 2, (given.cycle >= 0) & (given.cycle != left_out)).sets
            assert [len(s) for s in sets] == [1, 2, 8]
            chosen = names(given, sets[1])
            assert len(chosen & {"t1_C", "t7_C"}) == len(chosen & {"t2_C", "t8_C"}) == 1, (left_out, chosen)
            assert set(sets[0]) < set(sets[1]) < set(sets[2])


def test_the_six_of_fl_thermal_whatever_cycle_is_left_out(shared_data: Path) -> None:
    """In the first 6669 rows: those of its sixteen sensors that are chosen, but for one."""
    samples = stack([read(shared_data / "fl_thermal" / "recording.csv")], [f"ch{k}_um" for k in range(1, 6)])
    first = np.arange(len(samples)) < 6669
    six = {f"t{k}_C" for k in (4, 5, 7, 9, 11, 16)}
    assert names(samples, choose_sets(samples, 6, first).sets[5]) == six
    common = [
        len(six & names(samples, choose_sets(samples, 6, first & (samples.cycle != k)).sets[5])) for k in range(4)
    ]
    assert sorted(common) == [5, 6, 6, 6]


def test_a_cycle_of_one_row_leaves_no_half_without_rows() -> None:
    parts, _ = halve(np.array([0, 0, 0, 0, 1, 2, 2, -1]), np.zeros(8, dtype=np.bool_))
    assert parts.tolist() == [0, 0, 1, 1, 2, 3, 4, -1]
