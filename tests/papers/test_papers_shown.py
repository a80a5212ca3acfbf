"""Figure 4 of precompensation, and the peaks of Wessel's spindle."""

from types import SimpleNamespace
from typing import Any

import numpy as np

from thermocomp.papers.precompensation import redo, setup
from thermocomp.papers.precompensation.setup import CUTS, POSITIONS
from thermocomp.virtual.datasets import record


def test_the_prediction_at_the_first_and_the_last_position() -> None:
    """P-05: Fig. 4 shows what the net predicts of the verification, beside what was measured."""
    z, free = np.random.default_rng(0).normal(size=(2, 30, len(POSITIONS)))
    some, one = np.zeros(3), SimpleNamespace(means=(2.0, 1.0))
    c: Any = SimpleNamespace(
        judge=SimpleNamespace(time=3600.0 * np.arange(30.0), deviations=z),
        left={setup.NET: z - free},
        free_run={setup.NET: free},
        schedule=-free,
        cuts=[one] * CUTS,
        warm=SimpleNamespace(hours=some, drift=some, cold=some, carried=some),
    )
    figure = next(f for f in redo._figures(c) if f.key == "precompensation-fig4")
    for panel, k in zip(figure.panels, (0, len(POSITIONS) - 1), strict=True):
        drawn = {curve.label: curve.y for curve in panel.curves}
        np.testing.assert_array_equal(drawn["measured"], z[:, k])
        np.testing.assert_array_equal(drawn["net"], free[:, k])
        np.testing.assert_array_equal(drawn["residual"], z[:, k] - free[:, k])


def test_the_test_series_has_peaks_beyond_the_reference() -> None:
    """W-07, Fig. 3."""
    reference, test = (r.table["s4_um"].to_numpy() for r in record("wessel-fem", seed=0))
    assert np.abs(test).max() > 1.01 * np.abs(reference).max()
