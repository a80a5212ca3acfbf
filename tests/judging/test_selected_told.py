"""Selected sensors: the variance of their coefficients (H-14), and no more of them than are enough (W-12)."""

from typing import Any

import numpy as np
import pandas as pd
import pytest
from smallmachine import small_machine

from thermocomp.judging import maximal
from thermocomp.judging.candidates import Candidates
from thermocomp.judging.choice import Settings
from thermocomp.models.selection.maximal_correlation import DataSet, MaximalCorrelations
from thermocomp.recordings.stacking import stack


def test_what_is_told_of_selected_sensors_is_of_their_changes() -> None:
    """H-14, E-H6: X'X as it is, neither centred nor scaled."""
    rng = np.random.default_rng(14)
    X = pd.DataFrame(rng.normal(size=(50, 3)) + 5.0, columns=["t1_C", "t2_C", "t3_C"])
    found = Candidates("z_um", X, rng.normal(size=50), np.zeros(50, dtype=np.intp)).repeats(["t3_C", "t1_C"])
    values = X[["t3_C", "t1_C"]].to_numpy()
    eigenvalues = np.linalg.eigvalsh(values.T @ values)
    assert f"smallest eigenvalue {eigenvalues[0]:.3g}, sum of inverse" in found.caption
    assert f"eigenvalues {np.sum(1 / eigenvalues):.3g}, condition" in found.caption


def test_no_more_sensors_than_are_enough(monkeypatch: pytest.MonkeyPatch) -> None:
    """W-12: pairs reach .99, triples are better still, and a pair is chosen."""

    def correlations(tests: list[DataSet], subsets: Any, **_: Any) -> MaximalCorrelations:
        by_size = {1: 0.98, 2: 0.992, 3: 0.999}
        psi = np.tile([by_size[len(s)] for s in subsets], (1, 1)).astype(np.float64)
        psi = psi + 1e-5 * np.arange(len(subsets))
        return MaximalCorrelations(
            np.repeat(psi[:, :, None], len(tests), axis=2), tuple(subsets), ("",) * len(tests), True
        )

    monkeypatch.setattr(maximal, "maximal_correlations", correlations)
    samples = stack([small_machine()], ["z_um"])
    choice = maximal.choose(samples, Settings(max_sensors=3), jobs=1, progress=lambda *_, **__: None)
    assert len(choice.sensors) == 2
    assert any("needs 2 sensor(s); no more are selected" in note for note in choice.notes)
