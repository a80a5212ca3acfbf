"""Claims of the papers' studies, for a result for which each holds and for one for which it does not."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from thermocomp.models.selection.grouping import Interval
from thermocomp.papers.common import Errors
from thermocomp.papers.hwang import redo as hwang
from thermocomp.papers.hwang.setup import TABLE_1
from thermocomp.papers.stepwise2017 import redo as stepwise2017
from thermocomp.papers.stepwise2017.setup import LEAST, PURSUIT, STEPWISE
from thermocomp.papers.wessel2004 import spindle


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
        grouped=SimpleNamespace(selected_=(6, 7, 1, 5)), single=SimpleNamespace(selected_=tuple(range(without)))
    )
    (claim,) = hwang.claims.judged("more", c)
    assert claim.verdict == verdict


@pytest.mark.parametrize(("strong", "verdict"), [((6, 7), "yes"), ((1, 7), "no")])
def test_temperatures_related_to_the_drift(strong: tuple[int, int], verdict: str) -> None:
    """H-17: T7 and T8 more than T2 and T6, whatever the sign."""
    rng = np.random.default_rng(17)
    change = rng.normal(size=(40, 13))
    drift = -change[:, strong[0]] - change[:, strong[1]]
    grouped = SimpleNamespace(selected_=(6, 7), contributions_=np.array([0.7, 0.7]))
    (claim,) = hwang.claims.judged("contributions", SimpleNamespace(change=change, drift=drift, grouped=grouped))  # type: ignore[arg-type]
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
