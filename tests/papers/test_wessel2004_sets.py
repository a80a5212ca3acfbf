"""Wessel's appendix B, from the recordings to the sets that are reported, and the window of his ACE."""

from typing import Any

import numpy as np
import pytest
from test_wessel2004 import heated_rod

from thermocomp.models.ace import ACE
from thermocomp.models.selection.equivalents import equivalents
from thermocomp.models.selection.maximal_correlation import MaximalCorrelations
from thermocomp.papers.study import tell_nobody
from thermocomp.papers.wessel2004 import sets, spindle


def test_appendix_b(monkeypatch: pytest.MonkeyPatch) -> None:
    asked = list[MaximalCorrelations]()
    rng = np.random.default_rng(0)

    def correlations(data: Any, subsets: Any, *, converged: bool = True, **_: Any) -> MaximalCorrelations:
        psi = 0.9 + 0.01 * rng.random((3, len(subsets), 1)) + 0.02 * rng.random((3, len(subsets), len(data)))
        asked.append(MaximalCorrelations(psi, tuple(subsets), tuple(d.name for d in data), converged))
        return asked[-1]

    rods = [heated_rod(f"rod {k}", np.ones((30, 2)) * k) for k in range(23)]
    monkeypatch.setattr(sets, "record", lambda *_, **__: rods)
    monkeypatch.setattr(sets, "maximal_correlations", correlations)
    s = sets.appendix_b(0, tell_nobody)
    assert {len(a.tests) for a in asked} == {23}
    assert [(len(a.subsets), a.complete) for a in asked] == [(129, False), (382, False), (129, True)]
    for found, of, holm in ((s.small, asked[0], False), (s.holm, asked[0], True), (s.converged, asked[2], False)):
        expected = equivalents(list(of.psi), of.subsets, holm=holm)
        np.testing.assert_array_equal(found.p_values, expected.p_values)
        np.testing.assert_array_equal(found.equivalent, expected.equivalent)


def test_the_choice_is_a_common_set() -> None:
    base, small = np.linspace(0.5, 0.8, 23), 1e-3 * np.where(np.arange(23) % 2, 1.0, -1.0) * np.linspace(1, 2, 23)
    much = np.r_[0.15, np.zeros(22)]
    one, other = np.stack([base + small + much, base]), np.stack([base, base + 1e-3 * np.linspace(1, 2, 23)])
    found = equivalents([one, other], [(0,), (1,)])
    assert found.common == ((1,),)
    assert found.summed.sum(axis=0).argmax() == 0
    assert sets._choice(found) == (1,)


def test_every_ace_of_the_spindle_has_the_paper_s_window(monkeypatch: pytest.MonkeyPatch) -> None:
    made = list[ACE]()

    def make(**given: Any) -> ACE:
        made.append(ACE(**given))
        return made[-1]

    monkeypatch.setattr(spindle, "ACE", make)
    spindle.spindle(0, tell_nobody)
    assert {(a.half_window, a.window_share, a.converged) for a in made} == {(10, None, False)}
