"""Planted cases of claims on the work volume, on whole programs, and on the first step of the selection."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from thermocomp.papers.chen1996 import anywhere
from thermocomp.papers.precompensation import cuttingtold
from thermocomp.papers.precompensation.cutting import RIGHT
from thermocomp.papers.precompensation.program import NEEDED, SAFE
from thermocomp.papers.precompensation.setup import LEAST, NET
from thermocomp.papers.stepwise2017 import redo as stepwise2017
from thermocomp.virtual.geometry import find_cold_component


@pytest.mark.parametrize(("closure", "verdict"), [(0.09, "yes"), (0.11, "no")])
def test_components_give_the_error_anywhere(closure: float, verdict: str) -> None:
    """C-01, C-08: within a tenth of a micrometre of the exact error."""
    found: Any = SimpleNamespace(closure=closure)
    (claim,) = anywhere.claims.judged("closes", found)
    assert claim.verdict == verdict


@pytest.mark.parametrize(("straight", "verdict"), [(10, "in part"), (9, "no"), (8, "no")])
def test_first_order_is_enough_in_most_cases(straight: int, verdict: str) -> None:
    """C-05: in more than half of 18."""
    orders = {f"E{k}": SimpleNamespace(enough=1 if k < straight else 2) for k in range(18)}
    found: Any = SimpleNamespace(learned=SimpleNamespace(fits=orders))
    (claim,) = anywhere.claims.judged("first_order", found)
    assert claim.verdict == verdict
    assert claim.ours.startswith(f"{straight} of 18 components; all but E{straight} (m = 2)")


@pytest.mark.parametrize(("flat", "full", "verdict"), [(0.5, 0.4, "yes"), (0.5, 0.6, "no")])
def test_a_profile_of_two_coordinates_is_nearer(flat: float, full: float, verdict: str) -> None:
    """C-06."""

    def off(by: float) -> SimpleNamespace:
        profile = SimpleNamespace(at=lambda points: find_cold_component("EYX", points) + by)
        return SimpleNamespace(model=SimpleNamespace(profile=profile))

    found: Any = SimpleNamespace(learned=SimpleNamespace(flat=off(flat), fits={"EYX": off(-full)}))
    (claim,) = anywhere.claims.judged("bed", found)
    assert (claim.verdict, claim.ours) == (verdict, f"{flat:.2f} -> {full:.2f} um")


@pytest.mark.parametrize(("after", "verdict"), [(1.9, "yes"), (2.1, "no")])
def test_a_whole_program_mills_the_depths_of_the_paper(after: float, verdict: str) -> None:
    """P-06, P-07: 7 -> 2 um by the net, whatever least squares does."""

    def surfaces(mean: float) -> SimpleNamespace:
        return SimpleNamespace(mean=mean, by_test=np.full(2, mean), depth=np.zeros((2, 4)))

    by_model = {NET: surfaces(after), LEAST: surfaces(0.1)}
    milled: Any = SimpleNamespace(
        without=lambda _: surfaces(7.0),
        paper=lambda _, name=NET: by_model[name],
        surfaces={(RIGHT, m, way): surfaces(1.0) for m in by_model for way in (NEEDED, SAFE)},
        lines=90,
        turning=0.999,
    )
    (claim,) = cuttingtold.claims.judged("revised", milled)
    assert claim.verdict == verdict
    assert claim.ours == f"7.0 -> {after:.1f} um, mean of 2 tests and 4 positions"


@pytest.mark.parametrize("enters", [True, False])
def test_the_best_single_temperature_reaches_f(enters: bool) -> None:
    """T-04: without a first step there is no variable."""
    log = [SimpleNamespace(term="t_motor_C", f=101.0)] if enters else []
    found: Any = SimpleNamespace(
        selection=SimpleNamespace(log_=log), thinned=[SimpleNamespace(first=0.5)], fit=range(99)
    )
    (claim,) = stepwise2017.claims.judged("first", found)
    assert (claim.verdict, claim.ours) == (("yes", "motor: F = 101") if enters else ("no", "none does"))
