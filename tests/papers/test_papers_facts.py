"""Facts of the claims, from results that are chosen so that one can compute them in the head, and at their limits."""

from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from thermocomp.papers.chen1996 import drift, slope, unseen
from thermocomp.papers.hwang import redo as hwang
from thermocomp.papers.precompensation import redo as precompensation
from thermocomp.papers.precompensation.setup import CuttingTest
from thermocomp.papers.stepwise2017 import redo as stepwise2017
from thermocomp.papers.stepwise2017 import setup as stepwise2017_setup
from thermocomp.papers.wessel2004 import tools, transfer
from thermocomp.papers.wessel2004.trial import ACE_NAME, MLR_NAME


@pytest.mark.parametrize(("left", "holds"), [(1.0, True), (1.05, False)])
def test_a_tenth_is_straight(monkeypatch: pytest.MonkeyPatch, left: float, holds: bool) -> None:
    """C-05: at most a tenth of the thermal part."""
    both = {slope.MEASURED: np.full(4, left), slope.NONE: np.full(4, -10.0)}
    monkeypatch.setattr(slope, "residuals", lambda *_: both)
    (claim,) = slope.claims.judged("straight", SimpleNamespace(learned=None))  # type: ignore[arg-type]
    assert claim.holds is holds


@pytest.mark.parametrize(("z", "many", "as_few"), [(7, [], True), (8, [], False), (10, [], False), (11, ["z"], False)])
def test_half_of_the_terms(z: int, many: list[str], as_few: bool) -> None:
    """C-20: 7, 15 and 7 of 20, 35 and 20."""
    found: Any = SimpleNamespace(terms={"x": 7, "y": 15, "z": z}, candidates={"x": 20, "y": 35, "z": 20})
    facts = drift._halved(found)
    assert (facts["many"], facts["holds"], facts["as_few"]) == (many, not many, as_few)


@pytest.mark.parametrize(
    ("net", "apart"), [(3.0, []), (3.01, ["y"]), (4 / 3, []), (1.33, ["y"]), (2.9, []), (1.4, []), (2.0, [])]
)
def test_close_is_half_as_much_again(net: float, apart: list[str]) -> None:
    """C-31: either way; the paper's own errors are 8.9 / 6.5 apart."""
    found: Any = SimpleNamespace(
        wide={}, samples=None, net={"x": 2.0, "y": net, "z": 2.0}, mra={"x": 2.0, "y": 2.0, "z": 2.0}
    )
    facts = drift._close(found)
    assert (facts["directions"], facts["holds"]) == (apart, not apart)
    assert facts["factor"] == pytest.approx(max(net / 2, 2 / net))
    assert facts["paper_factor"] == pytest.approx(8.9 / 6.5)


@pytest.mark.parametrize("test", [0, 1])
@pytest.mark.parametrize(
    ("mra", "net", "ours", "wide", "reasons"),
    [
        (2.0, 3.0, 1.4, 9.0, []),
        (3.0, 2.0, 1.4, 9.0, []),
        (2.0, 3.01, 1.4, 9.0, ["apart"]),
        (3.01, 2.0, 1.4, 9.0, ["apart"]),
        (2.0, 3.0, 1.39, 9.0, ["past"]),
        (2.0, 3.0, 1.0, 1.0, []),
        (2.0, 3.0, 0.69, 1.0, ["past"]),
        (5.0, 3.9, 9.0, 9.0, ["mra"]),
        (3.9, 5.0, 9.0, 9.0, ["net"]),
    ],
)
def test_new_observations(
    monkeypatch: pytest.MonkeyPatch, test: int, mra: float, net: float, ours: float, wide: float, reasons: list[str]
) -> None:
    """C-32: of a drift of 20 um; a fifth is well, and half as much again is close."""
    monkeypatch.setattr(unseen, "rms", lambda *_: wide)
    found: Any = SimpleNamespace(
        tests=["constant", "random"],
        errors=lambda number, target, _: SimpleNamespace(rms=20.0 if (number, target) == (test, "z") else 0.0),
        nets=lambda *_: np.array([1.0, 4.0]),
        learned=SimpleNamespace(wide={"z": None}),
        left=lambda _, samples: {"MRA": mra, "net": net, "ours": ours} if samples == found.tests[test] else {},
    )
    facts = unseen._new_observations(found, unseen.TESTS[test])
    assert facts["reasons"] == reasons
    assert facts["holds"] is not bool({*reasons} - {"past"})
    assert (facts["figure"], facts["least"], facts["most"]) == (14 + test, 1.0, 4.0)
    assert (facts["mra_share"], facts["net_share"]) == (mra / 20, net / 20)


def test_what_a_lost_sensor_costs(monkeypatch: pytest.MonkeyPatch) -> None:
    """C-34: by regression 2 -> 5 um; by three nets 1 -> 4, 3 -> 5, 2 -> 9 um."""
    monkeypatch.setattr(unseen, "rms", lambda model, samples: model.left[samples])
    regression = SimpleNamespace(left={"intact": 2.0, "cut": 5.0}, sensors=("T1", "T2"))
    nets = {"intact": np.array([1.0, 3.0, 2.0]), "cut": np.array([4.0, 5.0, 9.0])}
    found: Any = SimpleNamespace(
        learned=SimpleNamespace(models={"x": regression}),
        tests=["intact", "other"],
        cut="cut",
        nets=lambda _, samples: nets[samples],
        errors=lambda *_: SimpleNamespace(rms=20.0),
        dynamic={"x": SimpleNamespace(left={"cut": 7.0})},
    )
    facts = unseen._fault(found, "x")
    numbers = ("none", "intact", "cut", "worse", "net", "net_cut", "worse_net", "least", "most", "dynamic")
    assert [facts[n] for n in numbers] == [20.0, 2.0, 5.0, 3.0, 2.0, 5.0, 3.0, 4.0, 9.0, 7.0]
    assert facts["uses_t2"] is True
    regression.sensors = ("T1",)
    assert unseen._fault(found, "x")["uses_t2"] is False


def test_largest_errors() -> None:
    """C-35: of the vector in any row of both tests, and of z from peak to peak."""
    rng = np.random.default_rng(0)
    methods = (unseen.NONE, unseen.MRA, unseen.NET)
    residuals = [{t: {m: rng.normal(size=9) for m in methods} for t in "xyz"} for _ in range(2)]
    found: Any = SimpleNamespace(
        residuals=residuals,
        models=methods[1:],
        errors=lambda k, t, m: SimpleNamespace(peak_to_peak=np.ptp(residuals[k][t][m])),
    )
    for m in methods:
        vectors = [np.linalg.norm([r[t][m] for t in "xyz"], axis=0).max() for r in residuals]
        assert unseen.largest_error(found)[m] == pytest.approx(max(vectors))
        assert unseen.largest_depth(found)[m] == max(np.ptp(r["z"][m]) for r in residuals)


class Trial(SimpleNamespace):
    """Residuals of linear regression and of ACE."""

    mlr: np.ndarray
    ace: np.ndarray

    def residual(self, method: str) -> np.ndarray:
        return {MLR_NAME: self.mlr, ACE_NAME: self.ace}[method]

    def reasons(self) -> dict[str, Any]:
        return {"mlr": 12.0, "ace_rms": 3.0, "reasons": "None."}

    def rms_beside(self, *beside: str) -> Mapping[str, Any]:
        return dict.fromkeys(beside, 1.0)

    def fit_rms(self, _: str) -> float:
        return 0.5


def test_gain_in_stretches() -> None:
    """W-08: ten stretches of ten rows; in the third ACE leaves a twelfth, in none it leaves nothing."""
    mlr, ace = np.full(100, 12.0), np.full(100, 6.0)
    ace[20:30] = 1.0
    trial: Any = Trial(mlr=mlr, ace=ace, unseen=range(100))
    facts = tools._locally(SimpleNamespace(own=trial))
    assert facts["gains"] == pytest.approx([2, 2, 12, 2, 2, 2, 2, 2, 2, 2])
    assert (facts["first"], facts["last"], facts["gain"]) == (21, 30, pytest.approx(12.0))
    assert facts["total"] == pytest.approx(12 / np.sqrt((90 * 36 + 10) / 100))
    ace[20:30] = 0.0  # a thousandth of a nanometre is nothing
    assert tools._locally(SimpleNamespace(own=trial))["gain"] == pytest.approx(12e9)


def test_both_sets_of_the_resting_tool() -> None:
    """W-08: the set of the paper by its models, the chosen one by its own."""
    paper: Any = Trial(measured=np.full(3, 5.0))
    own: Any = Trial(measured=np.full(3, 7.0))
    r: Any = SimpleNamespace(paper=paper, own=own, selection=SimpleNamespace(chosen=(0, 1)))
    for sets, none, name in (("the paper's set", 5.0, "{T1 T2 T8}"), ("another", 7.0, "{T1 T2}")):
        facts = tools._better_at_rest(r, sets)
        assert (facts["none"], facts["times"]) == (none, 4.0)
        assert facts["set"].replace(",", "") == name
        assert facts["better"] is facts["limits"] is True  # both sentences are said


@pytest.mark.parametrize(("middle", "late", "holds"), [(1, -1, True), (0, -1, False), (1, 0, False), (-1, 1, False)])
def test_too_much_first_and_too_little_later(middle: float, late: float, holds: bool) -> None:
    """W-09: points 10 to 40 and from 60; a drift that is none counts as upward."""
    excess = np.repeat([-50.0, middle, 50.0, late], [9, 31, 19, 41])
    for drift_of, sign in ((3.0, 1.0), (-3.0, -1.0), (0.0, 1.0)):
        trial: Any = Trial(measured=np.full(100, drift_of), mlr=-sign * excess, ace=-sign * np.ones(100))
        facts = tools._systematic(trial)
        assert (facts["middle"], facts["late"], facts["holds"]) == (middle, late, holds)
        assert (facts["excess"], facts["ace_excess"]) == (pytest.approx(excess.mean()), 1.0)


@pytest.mark.parametrize(("worst", "first", "last"), [(0, 1, 6), (3, 1, 9), (50, 46, 56), (97, 93, 100)])
def test_an_episode_ends_with_the_test(worst: int, first: int, last: int) -> None:
    """W-09: five points on each side of the worst one, as far as there are."""
    ace = np.ones(100)
    ace[first - 1 : last] = -3.0
    ace[worst] = -9.0
    trial: Any = Trial(mlr=ace, ace=ace, flagged=np.zeros(100))
    facts = tools._without_episode(trial)
    assert (facts["first"], facts["last"], facts["point"], facts["worst"]) == (first, last, worst + 1, -9.0)
    assert facts["left"] == 1.0
    assert facts["total"] == pytest.approx(np.sqrt(np.mean(ace**2)))


def test_the_worst_transfer() -> None:
    """W-14: shares .5, .25 and .2; beside the own models 5, 1 and 2 times."""
    own = {("a", "a"): {"none": 9.0, "ace": 1.0}, ("b", "b"): {"none": 9.0, "ace": 2.5}}
    others = {("b", "a"): {"none": 10.0, "ace": 5.0}, ("a", "b"): {"none": 10.0, "ace": 2.5}}
    t = transfer.Transfer(own | others)
    assert t.others == [("b", "a"), ("a", "b")]
    facts = transfer._transferred(t)
    assert (facts["worst"], facts["share"], facts["before"], facts["after"]) == ("b to a", 0.5, 10.0, 5.0)
    assert (facts["own"], facts["ratio"]) == (1.0, 5.0)


def test_groups_in_use() -> None:
    """H-11: two of four."""
    curve = [SimpleNamespace(columns=range(k), mse=abs(k - 2) + 1.0) for k in (1, 2, 3)]
    found: Any = SimpleNamespace(grouped=SimpleNamespace(curve_=curve, groups_=range(4)))
    facts = hwang._fewer(found)
    assert [facts[n] for n in ("variables", "groups", "share", "most")] == [2, 4, 0.5, 3]


def test_fewest_rows_and_last_step() -> None:
    """T-07: the last of the thinned tests, and of the steps; F = 100 with 25 degrees of freedom explains 4 fifths."""
    log = [SimpleNamespace(df=99), SimpleNamespace(df=25)]
    found: Any = SimpleNamespace(selection=SimpleNamespace(log_=log), chosen=["t1_C", "t2_C"], thinned=[1, 2, 3])
    facts = stepwise2017._few(found)
    assert (facts["fewest"], facts["last"], facts["explained"], facts["any"]) == (3, log[1], 0.8, True)
    assert (facts["holds"], facts["as_many"]) == (True, False)


@pytest.mark.parametrize(("largest", "drift_of", "tiny"), [(4.9, 9.9, True), (5.0, 9.9, False), (4.9, 10.0, False)])
def test_a_bound_that_proves_little(largest: float, drift_of: float, tiny: bool) -> None:
    """T-08: below 5 um of a drift below 10 um; what is exactly 5 um is not above."""
    errors = {stepwise2017_setup.NONE: SimpleNamespace(max_abs=drift_of)}
    left = np.array([5.0, -5.1, 0.0, -5.0])
    found: Any = SimpleNamespace(on_dsp=SimpleNamespace(max_abs=largest), errors=errors, left_exported=left)
    facts = stepwise2017._bounded(found)
    assert (facts["over"], facts["little"], facts["tiny"]) == (0.25, 10.0, tiny)


def test_a_depth_that_stays_is_not_worse() -> None:
    """P-07: means over positions, by magnitude."""
    cuts = [CuttingTest(np.array([3.0, -1.0]), np.array(after)) for after in ([2.0, 2.0], [-2.5, 2.5], [1.0, 0.0])]
    facts = precompensation._depth(SimpleNamespace(depths=(4.0, 1.0), cuts=cuts))
    assert cuts[0].means == (2.0, 2.0)
    assert facts == {"without": 4.0, "with": 1.0, "left": 0.25, "worse": 1}
