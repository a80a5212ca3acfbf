"""Claims by their three verdicts: results that reach the paper's number, that are right in direction only, or wrong."""

from collections.abc import Callable
from dataclasses import replace
from itertools import product
from types import SimpleNamespace
from typing import Any, ClassVar

import numpy as np
import pytest

from thermocomp.models.selection.collinearity import Spectrum
from thermocomp.papers.chen1996 import drift, slope, unseen
from thermocomp.papers.hwang import redo as hwang
from thermocomp.papers.stepwise2017 import redo as stepwise2017
from thermocomp.papers.study import Claim
from thermocomp.papers.wessel2004 import sets, spindle, tools, transfer
from thermocomp.papers.wessel2004.trial import ACE_NAME, FROM_START, MLR_NAME


def regressions(**each: dict[str, Any]) -> dict[str, SimpleNamespace]:
    """Return regressions of x, y and z with some results; default: those of the paper."""
    of = {"x": (7, 20), "y": (15, 35), "z": (7, 20)}
    made = {}
    for t, (terms, candidates) in of.items():
        given = {"terms": terms, "removed": 6 if t == "y" else 0, "r2": 0.988 if t == "x" else 0.973} | each.get(t, {})
        made[t] = SimpleNamespace(
            terms_=["term"] * given["terms"],
            candidates_=["term"] * candidates,
            log_=[SimpleNamespace(action="remove")] * given["removed"],
            r_squared_=given["r2"],
            standard_error_=1.0,
            n_effective_=50.0,
        )
    return made


def learned(**each: dict[str, Any]) -> Any:
    """Return what the claims on the fits of the drifts of Chen look at."""
    made = regressions(**each)
    terms, candidates = ({t: len(getattr(r, name)) for t, r in made.items()} for name in ("terms_", "candidates_"))
    ranges = dict.fromkeys("xyz", 9.0)
    return SimpleNamespace(
        regressions=made, terms=terms, candidates=candidates, independent=ranges, ranges=ranges, samples=[None] * 810
    )


@pytest.mark.parametrize(
    ("entry", "found", "verdict"),
    [
        ("halved", learned(), "yes"),  # C-20
        ("halved", learned(x={"terms": 8}), "in part"),
        ("halved", learned(y={"terms": 16}), "in part"),
        ("halved", learned(z={"terms": 11}), "no"),
        ("removed", learned(), "yes"),  # C-16
        ("removed", learned(y={"removed": 5}, x={"removed": 6}), "in part"),
        ("removed", learned(y={"removed": 0}), "no"),
        ("closely", learned(), "yes"),  # C-19
        ("closely", learned(x={"r2": 0.987}), "in part"),
        ("closely", learned(x={"r2": 0.972}), "no"),
        ("closely", learned(z={"r2": 0.972}), "no"),
    ],
)
def test_fits_of_chens_drifts(entry: str, found: Any, verdict: str) -> None:
    (claim,) = drift.claims.judged(entry, found)
    assert claim.verdict == verdict


@pytest.mark.parametrize(("before", "verdict"), [(92.4, "in part"), (91.0, "no")])
def test_lengths_shrink_by_the_printed_factor(monkeypatch: pytest.MonkeyPatch, before: float, verdict: str) -> None:
    """C-35: 92.4 -> 7.2 um, which the paper measures on parts (C-37)."""
    errors = {slope.NONE: before, slope.MRA: 7.2, slope.NET: 8.0, slope.MEASURED: 1.0}
    monkeypatch.setattr(slope, "largest_length_error", lambda _: errors)
    found: Any = SimpleNamespace(elsewhere={slope.MRA: 1.0, slope.NET: 2.0}, fits={slope.MRA: None})
    (claim,) = slope.length.judged("lateral", found)
    assert (claim.verdict, claim.paper) == (verdict, "92.4 -> 7.2 um, 12.8 times")


@pytest.mark.parametrize(("before", "verdict"), [(196.0, "yes"), (195.0, "no")])
def test_depths_shrink_by_the_printed_factor(monkeypatch: pytest.MonkeyPatch, before: float, verdict: str) -> None:
    """C-35: 196 -> 8 um."""
    largest = {unseen.NONE: before, unseen.MRA: 9.0, unseen.NET: 8.0, unseen.DYNAMIC: 1.0}
    monkeypatch.setattr(unseen, "largest_depth", lambda _: largest)
    monkeypatch.setattr(unseen, "_since_change", lambda *_: 0.5)
    found: Any = SimpleNamespace(models={}, fitted_mra=3.0, fitted_net=3.0)
    (claim,) = unseen.claims.judged("depth", found)
    assert (claim.verdict, claim.paper) == (verdict, "196 -> 8 um, 24.5 times")


@pytest.mark.parametrize(("variables", "verdict"), [(4, "yes"), (5, "in part"), (7, "in part"), (8, "no")])
def test_hwangs_groups_that_are_left(variables: int, verdict: str) -> None:
    """H-11: four of eight."""
    curve = [SimpleNamespace(columns=range(k), mse=abs(k - variables) + 1.0) for k in range(1, 9)]
    found: Any = SimpleNamespace(
        grouped=SimpleNamespace(curve_=curve, groups_=range(8)), fit=range(37), worth=12.0, samples=None
    )
    (claim,) = hwang.claims.judged("fewer", found)
    assert claim.verdict == verdict


@pytest.mark.parametrize(
    ("with_grouping", "verdict"), [((1e4, 3.3), "yes"), ((1e4, 3.2), "in part"), ((1e4, 0.018), "no")]
)
def test_hwangs_eigenvalues(with_grouping: tuple[float, ...], verdict: str) -> None:
    """H-16: the smallest is raised from 0.019 to 3.3."""
    grouped = SimpleNamespace(spectrum_=Spectrum(with_grouping), selected_=(0, 1))
    single = SimpleNamespace(spectrum_=Spectrum((8861.812, 0.019)), selected_=(0, 1, 2))
    found: Any = SimpleNamespace(grouped=grouped, single=single, swept=[(0.9, grouped)])
    (claim,) = hwang.claims.judged("collinearity", found)
    assert claim.verdict == verdict


@pytest.mark.parametrize(("chosen", "verdict"), [(5, "yes"), (4, "in part"), (1, "in part"), (6, "no"), (0, "no")])
def test_sensors_left_by_stepwise(chosen: int, verdict: str) -> None:
    """T-07: five of 24."""
    log = [SimpleNamespace(df=106 - k, r_squared_step=0.1 * k) for k in range(1, chosen + 1)]
    thinned = [SimpleNamespace(rows=20, names=["a"], first=0.8)]
    found: Any = SimpleNamespace(
        selection=SimpleNamespace(log_=log),
        chosen=["table"] * chosen,
        thinned=thinned,
        fit=range(99),
        worth=9.0,
    )
    (claim,) = stepwise2017.claims.judged("few", found)
    assert claim.verdict == verdict
    if chosen > 5:  # the last of the steps is told
        assert "explains 50% of" in claim.finding
        assert "raised R2 by 6.0e-01" in claim.finding


class Trial(SimpleNamespace):
    """Errors of linear regression and ACE, and no reasons; in training ACE is better by default."""

    measured = np.ones(3)
    learned = SimpleNamespace(inputs=range(3))
    fit = 0.5
    estimates: ClassVar[dict[str, Any]] = {}

    def reasons(self) -> dict[str, Any]:
        facts = {"mlr": self.mlr, "ace_rms": 1.0, "fit": self.fit, "fit_mlr": 0.6, "correlation": 0.99}
        return facts | {"reasons": False, "linear": True, "straightness": True}

    def rms_beside(self, *_: str) -> dict[str, float]:
        return {}


@pytest.mark.parametrize(("entry", "printed"), [("better_at_rest", 5.7), ("better_at_work", 5.0 / 2.2)])
@pytest.mark.parametrize(("relative", "verdict"), [(1.01, "yes"), (0.99, "in part"), (0.0, "no")])
def test_wessels_gain_over_linear_regression(entry: str, printed: float, relative: float, verdict: str) -> None:
    """W-08, W-09. Where linear regression is better, the virtual tool cannot test ACE; the virtual machine can."""
    if verdict == "no" and "rest" in entry:
        verdict = "not testable"
    trial: Any = Trial(mlr=max(relative * printed, 0.9))
    of: Callable[..., list[Claim]] = tools.resting.judged if "rest" in entry else tools.milling.judged
    if "rest" in entry:  # the set of the paper, and another one, of which linear regression is better
        found: Any = SimpleNamespace(paper=trial, own=Trial(mlr=0.5), selection=SimpleNamespace(chosen=(0, 1)))
        assert [c.verdict for c in of(entry, found)] == [verdict, "not testable"]
    else:
        assert [c.verdict for c in of(entry, trial)] == [verdict]


def test_a_machine_without_nonlinearity_tests_no_ace() -> None:
    """W-01, W-09: ACE must at least fit the training data more closely than linear regression."""
    for fit, verdict in ((0.59, "yes"), (0.6, "not testable")):
        trial: Any = Trial(mlr=9.0, fit=fit)
        (claim,) = tools.milling.judged("better_at_work", trial)
        assert claim.verdict == verdict
    found: Any = SimpleNamespace(found=trial)
    (bent,) = spindle.claims.judged("bent", found)
    assert bent.verdict == "not testable"
    assert "in the training data, too" in bent.finding.lower()


def test_both_zeros_of_the_milling_machine_are_shown() -> None:
    """W-09: the verdict is that of absolute temperatures, as in the paper."""
    ace, linear = (FROM_START.format(m) for m in (ACE_NAME, MLR_NAME))
    trial: Any = Trial(mlr=0.9, estimates={ace: np.full(3, 0.5), linear: np.full(3, -1.0)})
    (claim,) = tools.milling.judged("better_at_work", trial)
    assert claim.verdict == "no"
    assert claim.ours.startswith("absolute temperatures: MLR 0.90 um, ACE 1.00 um")
    assert claim.ours.endswith("; temperatures from each start: MLR 2.00 um, ACE 0.50 um")


@pytest.mark.parametrize(("single", "verdict"), [(0.99, "yes"), (0.991, "not testable")])
def test_one_temperature_that_is_enough_tests_no_triple(single: float, verdict: str) -> None:
    """W-12."""
    by_size = {1: np.array([single, 0.995]), 2: np.array([0.995, 0.995]), 3: np.array([0.999, 0.999])}
    found: Any = SimpleNamespace(by_size=by_size)
    (claim,) = sets.claims.judged("enough", found)
    assert claim.verdict == verdict


@pytest.mark.parametrize(
    ("transferred", "own", "verdict"), [(2.0, 1.0, "in part"), (2.0, 0.4, "in part"), (2.01, 1.0, "no")]
)
def test_a_model_is_used_with_another_mounting(transferred: float, own: float, verdict: str) -> None:
    """W-14: a fifth of the error without compensation, whatever that of the mounting's own model."""
    errors = {(a, b): {"none": 10.0, "ace": 9.0 if a == b else 1.0} for a, b in product("abc", repeat=2)}
    errors["a", "c"]["ace"], errors["c", "c"]["ace"] = transferred, own
    (claim,) = transfer.claims.judged("transferred", transfer.Transfer(errors))
    assert claim.verdict == verdict
    assert claim.ours.startswith(f"worst a to c: 10.0 -> {transferred:.2f} um")
    assert f"up to {transferred / own:.1f} times that with the model of the mounting itself (a to c)" in claim.finding


@pytest.mark.parametrize(
    ("equivalent", "common", "holds"),
    [
        ([[1, 1, 0], [1, 1, 1]], [(0,), (1,)], True),
        ([[1, 0, 0], [1, 1, 1]], [(0,), (1,)], False),
        ([[1, 1, 0], [1, 1, 1]], [(0,)], False),
        ([[1, 1, 0], [1, 1, 1]], [], False),
    ],
)
def test_one_set_is_not_several(equivalent: list[list[int]], common: list[tuple[int, ...]], holds: bool) -> None:
    """W-11: the best set is as good as itself."""
    of = SimpleNamespace(equivalent=np.array(equivalent), common=common)
    found: Any = SimpleNamespace(small=of, holm=of, converged=of)
    (claim,) = sets.claims.judged("several", found)
    assert claim.holds is holds
    assert replace(claim, again=()).verdict == ("yes" if holds else "no")
