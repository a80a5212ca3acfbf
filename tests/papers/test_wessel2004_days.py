"""Wessel's studies: which days teach, which day is judged, and which data go into Appendix B."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from thermocomp.models.selection.maximal_correlation import DataSet, MaximalCorrelations
from thermocomp.papers.study import tell_nobody
from thermocomp.papers.wessel2004 import sets, tools
from thermocomp.papers.wessel2004.trial import trial
from thermocomp.virtual.datasets import record

FloatArray = NDArray[np.float64]


class AskedError(Exception):
    """Ends a study where its data are known."""


def test_four_days_teach_and_the_fifth_is_judged(monkeypatch: pytest.MonkeyPatch) -> None:
    """W-09: four successive measurements with all three temperatures; none of the fifth is learned."""
    asked: list[Any] = []

    def stop(*given: Any) -> None:
        asked.extend(given)
        raise AskedError

    monkeypatch.setattr(tools, "trial", stop)
    with pytest.raises(AskedError):
        tools.milling_machine(0, tell_nobody)
    recordings, displacement, temperatures = asked
    assert [r.name for r in recordings] == [f"wessel-milling-day{k}" for k in range(1, 6)]
    assert (displacement, [*temperatures]) == (0, [0, 1, 2])
    found = trial(recordings, displacement, temperatures, beside=False)
    days = record("wessel-milling", seed=0)
    np.testing.assert_array_equal(found.learned.values[:, 1], np.concatenate([d.table["t_t2_C"] for d in days[:4]]))
    np.testing.assert_array_equal(found.unseen.values[:, 1], days[4].table["t_t2_C"])
    np.testing.assert_allclose(np.diff(found.measured), np.diff(days[4].table["s1_um"]), atol=1e-9)


class Rod:
    """A data set of nine temperatures and three displacements, all numbers of which differ."""

    temperatures, displacements = range(9), range(9, 12)

    def __init__(self, number: int) -> None:
        self.name = f"rod {number}"
        self.table = 1000.0 * number + np.arange(30.0 * 12).reshape(30, 12)

    def __len__(self) -> int:
        return len(self.table)

    def values(self, channels: Sequence[int]) -> FloatArray:
        """Return the columns of channels."""
        return np.asarray(self.table[:, [*channels]])


def test_appendix_b_takes_all_data_of_all_sets(monkeypatch: pytest.MonkeyPatch) -> None:
    """W-10: nine temperatures and three displacements of each of 23 data sets: 35 259 models, 8 901 of them small."""
    asked: list[Sequence[DataSet]] = []

    def correlations(data: Sequence[DataSet], subsets: Any, **_: Any) -> MaximalCorrelations:
        asked.append(data)
        psi = np.random.default_rng(0).uniform(0.9, 1.0, (np.shape(data[0].displacements)[1], len(subsets), len(data)))
        return MaximalCorrelations(psi, tuple(subsets), tuple(d.name for d in data), True)

    rods = [Rod(k) for k in range(23)]
    monkeypatch.setattr(sets, "record", lambda *_, **__: rods)
    monkeypatch.setattr(sets, "maximal_correlations", correlations)
    found = sets.appendix_b(0, tell_nobody)
    assert len(asked) == 3
    for data in asked:
        for given, rod in zip(data, rods, strict=True):
            assert given.name == rod.name
            np.testing.assert_array_equal(given.temperatures, rod.table[:, :9])
            np.testing.assert_array_equal(given.displacements, rod.table[:, 9:])
    assert (found.models(found.sets), found.models(len(found.psi.subsets))) == (35_259, 8_901)
