"""How much test is enough: whole cycles are unseen, and the curve says when more of the same is not worth it."""

from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np
import pytest
from smallmachine import small_machine

from thermocomp.core.exceptions import FitError
from thermocomp.judging import budget
from thermocomp.judging.compare import compare
from thermocomp.judging.planning.learningcurve import LearningCurve, Point, learning_curve, n_pieces
from thermocomp.judging.splits import Judging, Split, leave_one_cycle_out
from thermocomp.recordings.samples import Samples
from thermocomp.recordings.stacking import stack


def small(speeds: Sequence[float] = (1000.0, 2500.0, 1800.0, 3000.0)) -> Samples:
    return stack([small_machine(speeds)], ["z_um"])


def curve_of(errors: dict[int, float], none: float = 40.0) -> LearningCurve:
    points = [Point(n, n, block, (rms,)) for n, rms in errors.items() for block in (0, 1)]
    return LearningCurve("averaged", tuple(points), none, np.ones((2, 1)))


def test_more_cycles_leave_less_on_an_unseen_one() -> None:
    samples = small()
    judging = leave_one_cycle_out(samples)
    told: list[str] = []

    def note(text: str, /, steps: int = 1) -> None:
        told.extend([text] * steps)

    found = learning_curve(samples, judging, progress=note)
    levels = found.by_cycles()
    assert [x.learned for x in levels] == [1, 2, 3]
    assert levels[-1].rms < 0.6 * levels[0].rms
    assert levels[0].rms < found.none
    assert {p.unseen for p in found.points} == {0, 1, 2, 3}
    assert len(told) == len(found.points) <= n_pieces(judging)
    assert learning_curve(samples, judging).points == found.points  # the draw is the same


def test_its_last_level_is_the_error_that_compare_states() -> None:
    """The RMS over all unseen rows, not the mean over the cycles; blocks count by their rows."""
    samples = small()
    samples = samples.take(np.arange(len(samples)) < 750)  # the last cycle is shorter
    judging = leave_one_cycle_out(samples)
    found = learning_curve(samples, judging)
    (level,) = [x for x in found.by_cycles() if x.learned == 3]
    (overall,) = compare(samples, ["averaged"], judging, robustness=False).overall()
    assert level.rms == pytest.approx(overall.metric("rms"), rel=1e-6)
    assert found.none == pytest.approx(overall.none_metric("rms"), rel=1e-9)
    two = LearningCurve("m", (Point(1, 1, 0, (3.0,)), Point(1, 1, 1, (6.0,))), 9.0, np.array([[300.0], [100.0]]))
    (pooled,) = two.by_cycles()
    assert pooled.rms == pytest.approx(np.sqrt((3 * 9 + 36) / 4))
    assert pooled.error == pytest.approx(1.5)  # leaving out either block: 6 or 3


def test_what_is_learned_from_never_holds_the_unseen_cycle(monkeypatch: pytest.MonkeyPatch) -> None:
    samples = small()
    learned: list[np.ndarray] = []
    pairs: list[tuple[set[int], set[int]]] = []

    def train(name: str, given: Samples, target: int, learn: np.ndarray, **how: bool) -> SimpleNamespace:
        learned.append(learn)
        return SimpleNamespace(model=None)

    def replay(model: None, given: Samples, rows: np.ndarray) -> SimpleNamespace:
        pairs.append((set(given.cycle[learned[-1]].tolist()), set(given.cycle[rows].tolist())))
        return SimpleNamespace(compensated=np.zeros(int(rows.sum())))

    monkeypatch.setattr(budget, "train", train)
    monkeypatch.setattr(budget, "replay_compensated", replay)
    found = learning_curve(samples, leave_one_cycle_out(samples))
    assert len(pairs) == len(found.points)
    assert all(len(judged) == 1 and judged.isdisjoint(own) for own, judged in pairs)
    assert [len(own) for own, _ in pairs] == [p.learned for p in found.points]


def test_the_same_speed_again_is_one_speed() -> None:
    found = learning_curve(small((1500.0, 1500.0, 2500.0)), leave_one_cycle_out(small((1500.0, 1500.0, 2500.0))), "ols")
    assert {(p.learned, p.speeds) for p in found.points} == {(1, 1), (2, 1), (2, 2)}
    assert [x.learned for x in found.by_speeds()] == [1, 2]


def test_a_curve_that_is_flat_is_enough_and_one_that_falls_is_not() -> None:
    assert curve_of({1: 8.0, 2: 3.0, 3: 2.9, 4: 2.85}).enough
    falling = curve_of({1: 12.0, 2: 9.0, 3: 6.0, 4: 3.0})
    assert not falling.enough
    assert falling.last_gain == pytest.approx(3.0)
    assert "the error is still decreasing" in falling.words
    assert "does not help on unseen cycles" in curve_of({1: 8.0, 2: 7.9}, none=5.0).words
    assert curve_of({1: 0.0, 2: 0.0}, none=0.0).enough
    assert curve_of({1: 3.0, 2: 2.9}, none=0.5).worth == pytest.approx(0.025)


def test_two_cycles_have_no_curve() -> None:
    samples = small((1000.0, 2000.0))
    with pytest.raises(FitError, match="at least three thermal cycles or files; there are 2"):
        learning_curve(samples, leave_one_cycle_out(samples))


def test_a_part_that_cannot_be_learned_from_is_left_out() -> None:
    samples = small()
    splits = leave_one_cycle_out(samples).splits
    tiny = np.zeros(len(samples), dtype=np.bool_)
    tiny[:2] = True
    judging = Judging("cycles", (*splits[1:], Split("cycle tiny", ~tiny, tiny)))
    found = learning_curve(samples, judging)
    assert any(not p.rms for p in found.points)
    assert all(np.isfinite(x.rms) for x in found.by_cycles())
