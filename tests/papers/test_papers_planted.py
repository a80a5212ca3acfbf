"""Claims of the papers' studies, for a result for which each holds and for one for which it does not."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from thermocomp.judging.robustness import Robustness
from thermocomp.models.selection.grouping import Interval
from thermocomp.papers.chen1996 import drift, law, slope
from thermocomp.papers.chen1996.setup import EQ8
from thermocomp.papers.common import Errors
from thermocomp.papers.hwang import redo as hwang
from thermocomp.papers.hwang.setup import JUDGED, LAWS, LINEAR, NOISES, OPTIMAL, PLAIN, QUADRATIC, SINGLE, TABLE_1
from thermocomp.papers.stepwise2017 import redo as stepwise2017
from thermocomp.papers.stepwise2017.setup import LEAST, PURSUIT, STEPWISE
from thermocomp.papers.study import Claim
from thermocomp.papers.wessel2004 import sets, spindle, tools


@pytest.mark.parametrize(("exchanged", "verdict"), [(False, "yes"), (True, "no")])
def test_the_groups_of_hwang(exchanged: bool, verdict: str) -> None:
    """H-03, H-10: a single sensor in another group is another grouping."""
    groups = [[k - 1 for k in group] for group in TABLE_1]
    if exchanged:
        groups[0], groups[2] = [*groups[0], *groups[2]], []
    found = Interval(0.9, 0.95, tuple(tuple(sorted(g)) for g in groups if g))
    c: Any = SimpleNamespace(interval=found, swept=[(found, None)])
    (claim,) = hwang.claims.judged("groups", c)
    assert claim.verdict == verdict


@pytest.mark.parametrize(("without", "verdict"), [(7, "yes"), (6, "in part"), (4, "no")])
def test_variables_without_grouping(without: int, verdict: str) -> None:
    """H-15: seven instead of four."""
    c: Any = SimpleNamespace(
        grouped=SimpleNamespace(selected_=(6, 7, 1, 5)),
        single=SimpleNamespace(selected_=tuple(range(without))),
        fits={SINGLE: SimpleNamespace(model=SimpleNamespace(formula=lambda: "2 (T1-T14)"))},
    )
    (claim,) = hwang.claims.judged("more", c)
    assert claim.verdict == verdict
    assert "z = 2 (T1-T14)" in claim.finding


@pytest.mark.parametrize(("strong", "verdict"), [((6, 7), "yes"), ((1, 7), "no")])
def test_temperatures_related_to_the_drift(strong: tuple[int, int], verdict: str) -> None:
    """H-17: T7 and T8 more than T2 and T6, whatever the sign."""
    rng = np.random.default_rng(17)
    change = rng.normal(size=(40, 13))
    drift = -change[:, strong[0]] - change[:, strong[1]]
    grouped = SimpleNamespace(selected_=(6, 7), contributions_=np.array([0.7, 0.7]))
    (claim,) = hwang.claims.judged("contributions", SimpleNamespace(change=change, drift=drift, grouped=grouped))  # type: ignore[arg-type]
    assert claim.verdict == verdict


@pytest.mark.parametrize(
    ("psi", "other", "verdict"),
    [(0.9995, 1.0, "yes"), (0.9985, 1.0, "in part"), (0.98, 1.0, "no"), (0.9995, 0.0, "not testable")],
)
def test_the_transformations_of_the_spindle_fit(psi: float, other: float, verdict: str) -> None:
    """W-06: Psi is .9994 in the paper; where one temperature makes the displacement, it tests nothing."""
    time = np.linspace(0.0, 9.0, 199)
    warm = np.column_stack([np.sin(time), np.cos(3 * time)])
    learned = SimpleNamespace(values=warm, deviations=(warm @ [1.0, other])[:, None])
    ace = SimpleNamespace(psi_=psi, errors_=[1.0], falling_theta_=0.0)
    found: Any = SimpleNamespace(found=SimpleNamespace(learned=learned, ace=ace))
    (claim,) = spindle.claims.judged("fits", found)
    assert claim.verdict == verdict


@pytest.mark.parametrize(("ours", "verdicts"), [(0.9, ["yes", "yes"]), (1.1, ["no", "yes"]), (1.3, ["no", "no"])])
def test_stepwise_beside_the_other_methods(ours: float, verdicts: list[str]) -> None:
    """T-08: smaller RMS on-line, whatever the fit."""
    wave = np.sin(np.arange(60.0))
    left = {STEPWISE: ours * wave, LEAST: wave, PURSUIT: 1.2 * wave}
    fits = {STEPWISE: wave, LEAST: 0.5 * wave, PURSUIT: 2.0 * wave}
    c: Any = SimpleNamespace(errors={name: Errors.of(e) for name, e in left.items()}, left_in_fit=fits)
    assert [claim.verdict for claim in stepwise2017.claims.judged("beats", c)] == verdicts


@pytest.mark.parametrize(("rms", "verdict"), [(0.49, "in part"), (0.51, "no")])
def test_an_estimate_close_to_the_series(rms: float, verdict: str) -> None:
    """W-05: within 5 % of the span."""
    found = SimpleNamespace(rms=lambda _: rms, rms_beside=lambda *_: {"linear": 0.3})
    (claim,) = spindle.claims.judged("close", SimpleNamespace(found=found, span=10.0))  # type: ignore[arg-type]
    assert claim.verdict == verdict


class Rows(list[int]):
    """Rows of a displacement that does not move."""

    deviations = np.zeros((9, 1))


@pytest.mark.parametrize(("differs", "verdict"), [(0.09, "in part"), (0.11, "no")])
def test_neighbours_make_a_slight_difference(differs: float, verdict: str) -> None:
    """W-05: below 1 % of the span, at every number of them."""
    found = SimpleNamespace(learned=Rows(range(9)), ace=SimpleNamespace(falling_theta_=0.0))
    sweep = {1: (0.5, 0.05), 2: (0.5, 0.0), 10: (0.6, differs)}
    (claim,) = spindle.claims.judged("neighbours", SimpleNamespace(found=found, sweep=sweep, span=10.0))  # type: ignore[arg-type]
    assert claim.verdict == verdict


@pytest.mark.parametrize(("ace", "verdict"), [(0.99, "yes"), (1.01, "no")])
def test_linear_regression_is_not_sufficient(ace: float, verdict: str) -> None:
    """W-01: where ACE follows the training more closely, the test decides."""
    facts = {"ace_rms": ace, "mlr": 1.0, "fit": 0.5, "fit_mlr": 0.6, "reasons": False}
    found = SimpleNamespace(reasons=lambda: facts)
    (claim,) = spindle.claims.judged("bent", SimpleNamespace(found=found))  # type: ignore[arg-type]
    assert claim.verdict == verdict


@pytest.mark.parametrize(("triple", "verdict"), [(0.991, "yes"), (0.989, "no")])
def test_three_temperatures_are_enough(triple: float, verdict: str) -> None:
    """W-12: for every displacement."""
    by_size = {1: np.array([0.9, 0.9]), 2: np.array([0.98, 0.95]), 3: np.array([0.999, triple])}
    (claim,) = sets.claims.judged("enough", SimpleNamespace(by_size=by_size))  # type: ignore[arg-type]
    assert claim.verdict == verdict


@pytest.mark.parametrize(
    ("least", "most", "verdict", "finding"),
    [
        (20.1, 59.9, "yes", ""),
        (19.9, 59.8, "in part", "It covers the test but for 0.10 degC: T1."),
        (20.2, 60.1, "in part", "It covers the test but for 0.10 degC: T1."),
        (20.1, 60.2, "no", "Wider in the test: T1."),
        (19.9, 59.95, "no", "Wider in the test: T1."),
    ],
)
def test_the_training_is_at_least_as_wide_as_the_test(least: float, most: float, verdict: str, finding: str) -> None:
    """W-08: of each temperature, of the paper's set and of our own."""

    def trial(name: str, low: float, high: float) -> SimpleNamespace:
        channel = SimpleNamespace(name=name)
        learned, unseen = (
            SimpleNamespace(inputs=[channel], values=np.array([[a], [b]])) for a, b in ((20.0, 60.0), (low, high))
        )
        return SimpleNamespace(learned=learned, unseen=unseen, flagged=np.zeros(2), beyond=np.zeros(2))

    found: Any = SimpleNamespace(paper=trial("t_t1_C", least, most), own=trial("t_t5_C", 30.0, 50.0))
    (claim,) = tools.resting.judged("range", found)
    assert (claim.verdict, claim.finding) == (verdict, finding)
    assert claim.ours.startswith(f"T1 20.0-60.0 (test {least:.1f}-{most:.1f}), T5 20.0-60.0 (test 30.0-50.0) degC")


def fitted(ratio: float, key: str) -> Claim:
    """Return a claim on a linear model whose error is this multiple of that with squares."""
    model = SimpleNamespace(sensors=("T7", "T14"))
    fits = {m: SimpleNamespace(error=e, r_squared=0.97, model=model) for m, e in ((OPTIMAL, ratio), (JUDGED, 1.0))}
    wave = np.sin(np.arange(60.0))
    left = {"no compensation": 9 * wave, OPTIMAL: ratio * wave, JUDGED: wave}
    c: Any = SimpleNamespace(
        fits=fits, residuals=left, errors={m: Errors.of(e) for m, e in left.items()}, fit=range(39)
    )
    (claim,) = hwang.claims.judged(key, c)
    return claim


@pytest.mark.parametrize("key", ["fits", "predicts"])
@pytest.mark.parametrize(
    ("ratio", "verdict"), [(6.39 / 6.73, "yes"), (6.39 / 6.71, "in part"), (1.09, "in part"), (1.11, "no")]
)
def test_a_linear_model_beside_one_with_squares(key: str, ratio: float, verdict: str) -> None:
    """H-12, H-13: 6.39 and 6.72 um."""
    claim = fitted(ratio, key)
    assert claim.verdict == verdict
    assert ("1.1 times is our reading of 'nearly the same level'" in claim.finding) is (verdict == "in part")


@pytest.mark.parametrize(("linear", "where", "verdict"), [(0.009, 0, "yes"), (0.011, 7, "no"), (0.011, 0, "no")])
def test_sensor_errors_scatter_r2(linear: float, where: int, verdict: str) -> None:
    """H-18: the linear model scatters less at every size of the error and for both distributions."""
    stds = [0.009] * 8
    stds[where] = linear
    keys = [(law, size) for law in LAWS for size in NOISES]
    shaken = {
        key: {
            m: SimpleNamespace(std=s, mean=0.9, r_squared=0.97)
            for m, s in ((LINEAR, std), (QUADRATIC, 0.01), (PLAIN, 0.01))
        }
        for key, std in zip(keys, stds, strict=True)
    }
    (claim,) = hwang.claims.judged("noise", SimpleNamespace(shaken=shaken))  # type: ignore[arg-type]
    assert claim.verdict == verdict
    assert ("; not above for " in claim.finding) is (verdict == "no")


@pytest.mark.parametrize(
    ("noise", "lost", "verdict"), [(2.9, 9.9, "in part"), (3.1, 9.9, "no"), (2.9, 10.1, "no"), (3.5, 11.0, "no")]
)
def test_robustness_beside_both_other_methods(noise: float, lost: float, verdict: str) -> None:
    """E-T5: by smaller factors than with each of both, under noise and without the worst sensor."""
    disturbed = {STEPWISE: (0.5 * noise, 0.5 * lost), LEAST: (3.0, 12.0), PURSUIT: (4.0, 10.0)}
    shaken = {
        m: Robustness(0.4, {"uniform": (n, n)}, {"a": 0.1, "b": worst}, 0.0, 0.0, 1.0)
        for m, (n, worst) in disturbed.items()
    }
    errors = {m: SimpleNamespace(rms=0.5 if m == STEPWISE else 1.0) for m in disturbed}
    (claim,) = stepwise2017.claims.judged("robust", SimpleNamespace(shaken=shaken, errors=errors))  # type: ignore[arg-type]
    assert claim.verdict == verdict
    assert claim.ours.startswith(f"noise x {noise:.1f}, lost sensor x {lost:.1f}; least squares x 3.0, x 12.0")


def slopes(**given: Any) -> Any:
    """Return what the claims on Chen's slopes look at."""
    net = SimpleNamespace(n_epochs=100)
    found = {
        "linear": None,
        "left": lambda _: 2.0,
        "other_slopes": 60.0,
        "elsewhere": {slope.MRA: 1.8},
        "k1": np.ones(9),
    }
    trained = [SimpleNamespace(estimator=net)]
    return SimpleNamespace(**found | {"nets": [SimpleNamespace(trained=trained)], "learned": range(51)} | given)


@pytest.mark.parametrize(("terms", "verdict"), [(["T3", "T4", "T7-T9"], "yes"), (["T3", "T4*T3"], "no")])
def test_slopes_without_products(terms: list[str], verdict: str) -> None:
    """C-23, C-24: a square is a product, too."""
    (claim,) = slope.claims.judged("terms", slopes(regression=SimpleNamespace(terms_=terms)))
    assert claim.verdict == verdict


@pytest.mark.parametrize(("r2", "verdict"), [(0.974, "in part"), (0.972, "no")])
def test_slopes_are_fitted_closely(r2: float, verdict: str) -> None:
    """C-24, C-27: the median net counts."""
    regression = SimpleNamespace(r_squared_=r2, standard_error_=1.0)
    (claim,) = slope.claims.judged("closely", slopes(regression=regression))
    (net,) = slope.claims.judged("net_closely", slopes(net_r2=np.array([0.5, r2, 0.999])))
    assert (claim.verdict, net.verdict) == (verdict, verdict)


@pytest.mark.parametrize(("bend", "verdict"), [(0.09, "in part"), (0.11, "no")])
def test_only_the_slope_varies(monkeypatch: pytest.MonkeyPatch, bend: float, verdict: str) -> None:
    """C-04, C-05, C-07: what a line leaves of the thermal part, by RMS."""
    thermal = np.outer(np.arange(1.0, 5.0), np.array([-1.0, 0.0, 1.0, 2.0]))
    left = {slope.NONE: thermal, slope.MEASURED: bend * thermal}
    monkeypatch.setattr(slope, "residuals", lambda *_: left)
    (claim,) = slope.claims.judged("straight", slopes())
    assert (claim.verdict, claim.ours) == (verdict, f"{bend:.1%}")


@pytest.mark.parametrize(("factor", "verdict"), [(1.3, "yes"), (1 / 1.3, "yes"), (1.45, "in part"), (1.55, "no")])
def test_nets_and_regressions_are_very_close(factor: float, verdict: str) -> None:
    """C-31: in the paper the larger error is up to 8.9 / 6.5 = 1.37 times the smaller one."""
    mra = dict.fromkeys("xyz", 2.0)
    typical = SimpleNamespace(net=SimpleNamespace(n_parameters_=263))
    found: Any = SimpleNamespace(net=mra | {"y": factor * 2.0}, mra=mra, wide={}, terms=mra, typical=typical)
    (claim,) = drift.claims.judged("close", found)
    assert claim.verdict == verdict


@pytest.mark.parametrize(
    ("ours", "paper", "verdict"), [(0.96, 0.96, "yes"), (0.96, 0.94, "in part"), (0.94, 0.97, "no")]
)
def test_a_known_law_is_recovered(ours: float, paper: float, verdict: str) -> None:
    """C-23: in at least 95 % of the draws, by our measurement and by that of the paper."""
    found: Any = SimpleNamespace(
        recoveries={
            design: law.Recovery(EQ8, [EQ8 if k < 100 * share else {"T3": 1.0} for k in range(100)])
            for design, share in ((law.OURS, ours), (law.DESIGNS[0], paper))
        }
    )
    (claim,) = law.claims.judged("whole", found)
    assert claim.verdict == verdict


@pytest.mark.parametrize(("within", "verdict"), [(0.96, "yes"), (0.94, "no")])
def test_coefficients_are_those_of_the_law(within: float, verdict: str) -> None:
    """C-24: within three standard errors."""
    drawn = [{t: c + (2.9 if k < 100 * within else 3.1) for t, c in EQ8.items()} for k in range(100)]
    fit = SimpleNamespace(coefficient_errors=[dict.fromkeys(EQ8, 1.0)])
    found: Any = SimpleNamespace(recoveries={law.OURS: law.Recovery(EQ8, drawn)}, fit=fit)
    (claim,) = law.claims.judged("within", found)
    assert claim.verdict == verdict


def test_representatives_of_the_participating_groups() -> None:
    groups = ((6,), (8, 9, 10, 11), (12,), (7, 3), (4,), (1,), (5, 0), (2,))
    g = SimpleNamespace(representatives_=(6, 9, 7, 12, 1, 4, 0, 2), groups_=groups, participating_=(0, 3, 5, 6))
    (claim,) = hwang.claims.judged("representatives", SimpleNamespace(grouped=g))  # type: ignore[arg-type]
    assert claim.ours == claim.paper == "T7 T8 T2 T1"
