"""Wessel's study from the recordings to what it prints: which test is learned, what is estimated, what is drawn."""

from collections.abc import Iterator, Sequence
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import twin_ace
from numpy.typing import NDArray
from test_wessel2004 import curved, heated_rod, schedule, stand_in

from thermocomp.models.ace import ACE
from thermocomp.models.selection.maximal_correlation import MaximalCorrelations
from thermocomp.papers.study import Figure, Study, tell_nobody
from thermocomp.papers.wessel2004 import redo, sets, spindle, tools, transfer
from thermocomp.papers.wessel2004.sets import Selection
from thermocomp.papers.wessel2004.trial import ACE_NAME, AVERAGED, MLR_NAME, MillingTrial, trial
from thermocomp.recordings.recording import Recording
from thermocomp.virtual.datasets import find_experiment
from thermocomp.virtual.protocol import PlannedTest

FloatArray = NDArray[np.float64]


def temperatures(recording: Recording, columns: Sequence[int]) -> FloatArray:
    return recording.values(recording.temperatures)[:, list(columns)]


def s(recording: Recording, column: int) -> FloatArray:
    return np.asarray(recording.values(recording.displacements)[:, column])


@pytest.fixture
def resting(monkeypatch: pytest.MonkeyPatch) -> tuple[list[Recording], tools.Resting, Sequence[Figure]]:
    """The resting tool on the heated rod; Appendix B chose {T2, T5}."""
    kept: list[tools.Resting] = []

    def claims(r: tools.Resting) -> tuple[()]:
        kept.append(r)
        return ()

    monkeypatch.setattr(tools, "record", stand_in)
    monkeypatch.setattr(tools, "resting", claims)
    small = SimpleNamespace(subsets=((0, 1, 7), (1, 4)), summed=np.ones((3, 2)))
    chosen: Any = SimpleNamespace(chosen=(1, 4), small=small, psi=SimpleNamespace(tests=range(23)))
    part = tools.resting_tool(0, tell_nobody, chosen)
    return stand_in("wessel-tool"), kept[0], part.figures


def test_the_resting_tool_is_learned_in_one_test_and_estimated_in_the_other(
    resting: tuple[list[Recording], tools.Resting, Sequence[Figure]],
) -> None:
    """W-08: S1 by {T1, T2, T8} and by the own set; both methods learn from the first test alone."""
    (learned, unseen), r, _ = resting
    for found, columns in ((r.paper, (0, 1, 7)), (r.own, (1, 4))):
        assert [c.name for c in found.learned.inputs] == [f"t_t{k + 1}_C" for k in columns]
        np.testing.assert_array_equal(found.measured, s(unseen, 0))
        X, new = temperatures(learned, columns), temperatures(unseen, columns)
        y = found.learned.deviations[:, 0]
        np.testing.assert_array_equal(y, s(learned, 0))
        A = np.column_stack([X, np.ones(len(X))])
        weights = np.linalg.lstsq(A, y, rcond=None)[0]
        np.testing.assert_allclose(found.estimates[MLR_NAME], np.column_stack([new, np.ones(len(new))]) @ weights)
        ace = ACE(max_sweeps=20_000).fit(X, y)
        np.testing.assert_allclose(found.estimates[ACE_NAME], ace.predict(new), atol=1e-6)
        assert found.ace.psi_ == pytest.approx(ace.psi_, abs=1e-12)


def test_the_sweeps_of_the_study_end_by_the_rule_of_the_paper() -> None:
    """W-03: when the error fails to decrease, not before."""
    found = trial([curved(199, 10.0), curved(150, 9.0, seed=1)], 0, (0, 1), beside=False)
    assert (np.diff(found.ace.errors_)[:-1] < 0).all()
    assert np.diff(found.ace.errors_)[-1] >= 0


def test_the_reported_correlation_is_that_of_the_transformations() -> None:
    """W-02, W-06: Psi of the reference series, whichever series has the wider span."""
    with pytest.MonkeyPatch.context() as patch:
        both = [curved(199, 12.0), curved(199, 10.0, seed=1)]
        patch.setattr(spindle, "record", lambda *_, **__: both)
        part = spindle.spindle(0, tell_nobody)
    reference = both[0]
    ace = ACE(max_sweeps=20_000).fit(temperatures(reference, (0, 1)), s(reference, 0))
    assert part.numbers["fem_psi"] == pytest.approx(ace.psi_, abs=1e-12)
    assert ace.psi_ == pytest.approx(abs(np.corrcoef(ace.sum_phi_.x, ace.sum_phi_.y)[0, 1]), abs=1e-12)


def stretches(plan: PlannedTest) -> list[tuple[float, dict[str, float]]]:
    return [(float(p.duration), dict(p.loads or {})) for p in plan.segments]  # type: ignore[arg-type]


def test_the_training_has_a_break_near_point_400() -> None:
    """W-08: the only difference of the two tests; the tool cools, and is warmed from the start again."""
    training, test = find_experiment("wessel-tool").tests
    assert training.sampling == test.sampling == 10.0
    learned, unseen = stretches(training), stretches(test)
    same = next(k for k, (a, b) in enumerate(zip(learned, unseen, strict=False)) if a != b)
    begin = (sum(d for d, _ in learned[: same + 1]) + 0.0) / 10.0
    assert 350 <= begin <= 450
    assert learned[same + 1] == (1800.0, {})  # nothing is heated
    assert learned[same][1] == unseen[same][1]
    # after it everything is as in the test
    assert learned[same + 2 :] == unseen[1:]


def test_the_spindle_is_calculated_at_the_tip() -> None:
    """W-06: S4 is at the front tip of the tool; a calculation without sensor errors, three places and 100 s."""
    for plan in find_experiment("wessel-fem").tests:
        assert dict(plan.probes) == {"s3": "nose", "s4": "tip"}  # type: ignore[arg-type]
        assert [*plan.places] == ["t2", "t3", "t4"]
        assert (plan.perfect, plan.sampling) == (True, 100.0)


def test_all_temperatures_of_the_spindle_are_used(monkeypatch: pytest.MonkeyPatch) -> None:
    """W-06: T2, T3, T4, and the last displacement."""
    asked: list[tuple[int, list[int]]] = []

    def seen(recordings: Sequence[Recording], target: int, columns: Sequence[int], **more: bool) -> MillingTrial:
        asked.append((target, [*columns]))
        return trial(recordings, target, columns, **more)

    monkeypatch.setattr(spindle, "trial", seen)
    monkeypatch.setattr(spindle, "record", stand_in)
    spindle.spindle(0, tell_nobody)
    assert asked[0] == (1, [0, 1, 2])


def test_the_guard_has_no_margin() -> None:
    """W-07: a temperature just beyond the trained range is flagged where its curve is cropped."""
    learned, unseen = curved(199, 10.0), curved(150, 10.2, seed=1)
    found = trial([learned, unseen], 0, (0, 1), beside=False)
    X, new = temperatures(learned, (0, 1)), temperatures(unseen, (0, 1))
    beyond = ((new < X.min(axis=0)) | (new > X.max(axis=0))).any(axis=1)
    assert beyond.any()
    np.testing.assert_array_equal(found.flagged, beyond)


def peaked(estimate: FloatArray, flagged: FloatArray) -> Any:
    """Return what the claims on peaks look at: trained from 0 to 10 um, with a valley and a peak beyond."""
    measured = np.array([5.0, -9.0, 5.0, 19.0, 5.0])
    learned = SimpleNamespace(deviations=np.linspace(0.0, 10.0, 9)[:, None])
    found = SimpleNamespace(
        measured=measured,
        beyond=np.array([False, True, False, True, False]),
        flagged=flagged > 0,
        learned=learned,
        estimates={ACE_NAME: estimate},
        residual=lambda _: measured - estimate,
    )
    return SimpleNamespace(found=found, peaked=found, exchanged=False)


@pytest.mark.parametrize(
    ("estimate", "holds"),
    [
        ([5.0, 0.0, 5.0, 10.0, 5.0], True),
        ([5.0, 0.0, 5.0, 11.0, 5.0], False),
        ([5.0, -1.0, 5.0, 10.0, 5.0], False),
        ([50.0, 0.0, 5.0, 10.0, 5.0], False),
    ],
)
def test_cropped_is_within_the_trained_range_and_worse(estimate: list[float], holds: bool) -> None:
    """W-07: below and above, and only beyond the range."""
    (claim,) = spindle.claims.judged("cropped", peaked(np.array(estimate), np.ones(5)))
    assert claim.holds is holds


@pytest.mark.parametrize(("flagged", "holds"), [([0, 1, 0, 1, 0], True), ([0, 1, 0, 0, 0], False), ([1] * 5, True)])
def test_every_peak_must_be_flagged(flagged: list[int], holds: bool) -> None:
    """W-07."""
    (claim,) = spindle.claims.judged("guarded", peaked(np.zeros(5), np.array(flagged, dtype=np.float64)))
    assert claim.holds is holds


@pytest.mark.parametrize("k", [1, 2, 5])
def test_the_estimate_is_that_of_the_nearest_neighbours(k: int) -> None:
    """W-05, Eq. 5: both phi and the inverse of theta by k neighbours."""
    rng = np.random.default_rng(3)
    X, new = rng.uniform(0, 10, (120, 2)), rng.uniform(1, 9, (30, 2))
    y = X[:, 0] + 0.3 * X[:, 1] ** 2
    ace = ACE(neighbours=k).fit(X, y)
    total = np.zeros(len(new))
    for phi, at in zip(ace.phi_, new.T, strict=True):
        total += twin_ace.neighbours(at, phi.x.tolist(), phi.y.tolist(), k)
    order = np.argsort(ace.theta_.y, kind="stable")
    values, back = ace.theta_.y[order], ace.theta_.x[order]
    expected = twin_ace.neighbours(total, values.tolist(), back.tolist(), k)
    np.testing.assert_allclose(ace.predict(new), expected, atol=1e-9)


def test_neighbours_are_swept_in_the_unseen_series() -> None:
    """W-05: k = 1 to 10, each beside k = 2; of the span of the estimated series."""
    learned, unseen = curved(199, 10.0), curved(150, 7.0, seed=1)
    found = trial([learned, unseen], 0, (0, 1), beside=False)
    both = spindle.Spindle([learned, unseen], found, found)
    y = s(learned, 0)
    fits = {k: ACE(neighbours=k, max_sweeps=20_000).fit(temperatures(learned, (0, 1)), y) for k in range(1, 11)}
    estimates = {k: fit.predict(temperatures(unseen, (0, 1))) for k, fit in fits.items()}
    for k, (left, beside) in both.sweep.items():
        assert left == pytest.approx(np.sqrt(np.mean((found.measured - estimates[k]) ** 2)), rel=1e-9)
        assert beside == pytest.approx(np.sqrt(np.mean((estimates[k] - estimates[2]) ** 2)), rel=1e-9)
    assert len({left for left, _ in both.sweep.values()}) == 10
    assert both.span == np.ptp(found.measured) < np.ptp(y) - 1


def test_enough_temperatures_on_the_mean_of_all_data_sets() -> None:
    """W-12: of each size the best set, by its mean; larger sets are not triples; for every displacement."""
    rng = np.random.default_rng(5)

    def made(subsets: tuple[tuple[int, ...], ...]) -> MaximalCorrelations:
        return MaximalCorrelations(rng.uniform(0.8, 1.0, (3, len(subsets), 23)), subsets, ("set",) * 23, complete=True)

    psi, larger = made(((0,), (1,), (0, 1), (0, 2), (0, 1, 2), (0, 1, 3))), made(((0, 1, 2, 3), (0, 1, 2, 4)))
    found = Selection(psi, larger, None, None, None, [9], 0.0)  # type: ignore[arg-type]
    means, more = psi.psi.mean(axis=2), larger.psi.mean(axis=2)
    for k, best in ((1, means[:, :2]), (2, means[:, 2:4]), (3, means[:, 4:]), (4, more)):
        np.testing.assert_array_equal(found.by_size[k], best.max(axis=1))
    once = MaximalCorrelations(np.array([[[0.8, 1.0]]]), ((0,),), ("a", "b"), complete=True)
    assert (once.least_size(0.89), once.least_size(0.91)) == (1, None)


# -- figures -----------------------------------------------------------------------------------------------------------


def shown(figure: Figure) -> list[dict[str, FloatArray]]:
    return [{c.label: c.y for c in panel.curves} for panel in figure.panels]


@pytest.fixture(scope="module")
def parts() -> Iterator[tuple[Study, dict[str, MillingTrial]]]:
    """The study on the heated rod, and its trials by experiment."""
    kept: dict[str, MillingTrial] = {}
    with pytest.MonkeyPatch.context() as patch:
        for module in (spindle, sets, tools, transfer):
            patch.setattr(module, "record", stand_in)
        for module in (spindle, tools):
            patch.setattr(
                module, "trial", lambda *given, **more: kept.setdefault(str(len(kept)), trial(*given, **more))
            )
        yield redo.run(0, tell_nobody), kept


def test_series_estimates_and_residuals_in_the_figures(parts: tuple[Study, dict[str, MillingTrial]]) -> None:
    """W-13: 2(a), 5, 6 and 8 show what was measured in which test, 2(b), 3, 7 and 9 its model."""
    study, kept = parts
    figures = {f.key.removeprefix("wessel2004-"): f for f in study.figures}
    fem, tool, days = (stand_in(e) for e in ("wessel-fem", "wessel-tool", "wessel-milling"))
    found = kept["0"]
    _, own = (t for t in kept.values() if len(t.unseen) == 240)  # the paper's set, and the one that was chosen
    chosen = [int(c.name.removeprefix("t_t").removesuffix("_C")) - 1 for c in own.learned.inputs]
    milling = next(t for t in kept.values() if len(t.unseen) == 80)
    for key, tests, columns in (
        ("fig2a", fem[:1], range(3)),
        ("fig5", tool[:1], chosen),
        ("fig6", tool[1:], chosen),
        ("fig8", days[:-1], range(3)),
    ):
        warm, moved = shown(figures[key])
        assert [*warm] == [f"T{k + 1}" for k in columns]
        np.testing.assert_array_equal(
            np.column_stack([*warm.values()]), np.vstack([temperatures(t, [*columns]) for t in tests])
        )
        series = np.vstack([t.values(t.displacements) for t in tests])
        np.testing.assert_allclose(np.column_stack([*moved.values()]), series, atol=1e-9)
    transforms = figures["fig2b"].panels
    for panel, f in zip(transforms, (found.ace.theta_, *found.ace.phi_), strict=False):
        np.testing.assert_array_equal(panel.curves[0].x, f.x)
        np.testing.assert_array_equal(panel.curves[0].y, f.y)
    estimated = shown(figures["fig3"])[1]
    np.testing.assert_array_equal(estimated["measured"], found.measured)
    np.testing.assert_array_equal(estimated["ACE"], found.estimates[ACE_NAME])
    for key, t in (("fig7", own), ("fig9", milling)):
        above, below = shown(figures[key])[-2:]
        np.testing.assert_array_equal(above["measured"], t.measured)
        for m in (MLR_NAME, ACE_NAME):
            np.testing.assert_array_equal(above[m], t.estimates[m])
        for m in (MLR_NAME, ACE_NAME, AVERAGED):
            np.testing.assert_array_equal(below[m], t.measured - t.estimates[m])


def test_a_rod_is_another_one_in_each_test() -> None:
    assert not np.array_equal(heated_rod("a", schedule("a", 30, 2)).table, heated_rod("b", schedule("b", 30, 2)).table)
