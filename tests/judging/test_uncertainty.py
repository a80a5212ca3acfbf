"""Measurement uncertainty of RMS and largest error: figures computed by hand, and held in drawn measurements."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from thermocomp.core.arrays import FloatArray
from thermocomp.judging.uncertainty import FigureUncertainty, find_uncertainty
from thermocomp.recordings.declared import Declared, ExpandingBody, MeasuringUncertainty
from thermocomp.recordings.recording import Recording

WHOLE = MeasuringUncertainty(0.3, 1.0, 2.0, 0.2, 0.3, 0.1)
BODIES = {"fixture": ExpandingBody(250.0, 11.5, 0.4), "test bar": ExpandingBody(100.0, 12.0, 0.5)}
#: RMS 25 and largest 40 without compensation; with it, the errors are -1, 2, -1, 2
MEASURED, PREDICTED = np.array([0.0, 30.0, 40.0, 0.0]), np.array([1.0, 28.0, 41.0, -2.0])


def recording(values: FloatArray, declared: Declared) -> Recording:
    table = pd.DataFrame({"time_s": 60.0 * np.arange(len(values)), "z_um": values, "t1_C": 20.0})
    return replace(Recording.from_dataframe(table), declared=declared)


def find(uncertainty: MeasuringUncertainty, bodies: dict[str, ExpandingBody]) -> FigureUncertainty:
    tests = [recording(MEASURED, Declared(uncertainty=uncertainty, expansion=bodies))]
    found = find_uncertainty("z_um", MEASURED, PREDICTED, np.zeros(4, np.intp), tests)
    assert found is not None
    return found


def test_by_hand() -> None:
    """Every number as a pocket calculator gives it: RMS and largest error without, RMS and largest error with."""
    by_hand = {
        "sensitivity": (0.125, 0.2, 0.0206, 0.15),  # 0.5 % of each displacement
        "misalignment": (0.00440, 0.00703, 0.000557, 0.00528),  # (1 - cos 2 deg) / (2 sqrt 3) = 0.01759 %
        "probe": (0.15, 0.15, 0.15, 0.15),  # 0.3 / 2
        "mounting": (0.0577, 0.0577, 0.0577, 0.0577),  # 0.2 / (2 sqrt 3)
        "instrument drift": (0.0866, 0.0866, 0.0866, 0.0866),  # 0.3 / (2 sqrt 3)
        "expansion": (0.5052, 0.5052, 0.5052, 0.5052),  # (1.15 + 0.60) / (2 sqrt 3)
        "zero": (0.0701, 0.1, 0.0344, 0.1),  # 25.0701 and 1.6155 with 0.1 added to all rows
        "repeatability": (0.0500, 0.1, 0.0501, 0.1),  # 0.1 / sqrt 4, and 1.5811 - sqrt(2.5 - 0.01) = 0.0032
    }
    found = find(WHOLE, BODIES)

    for name, values in by_hand.items():
        assert found.contributions.pop(name).ravel() == pytest.approx(values, rel=0.01), name
    assert found.contributions == {}
    found = find(WHOLE, BODIES)
    assert found.expanded("rms", none=True) == pytest.approx(1.116, rel=0.01)
    assert found.expanded("max_abs", none=True) == pytest.approx(1.181, rel=0.01)
    assert found.expanded("rms") == pytest.approx(1.082, rel=0.01)
    assert found.expanded("max_abs") == pytest.approx(1.151, rel=0.01)
    assert found.expanded("mae") is None
    assert found.absent == ()


def test_a_constant_counts_by_the_second_order_where_the_error_is_zero_on_average() -> None:
    measured = np.array([2.0, -2.0])
    tests = [recording(measured, Declared(uncertainty=MeasuringUncertainty(repeatability_um=1.0)))]
    found = find_uncertainty("z_um", measured, np.zeros(2), np.zeros(2, np.intp), tests)
    assert found is not None
    assert found.contributions["zero"][0] == pytest.approx([0.236, 1.0], rel=0.01)  # sqrt(5) - 2
    # 2 - sqrt(4 - 1) = 0.268 by which the noise has raised the RMS, and 1 / sqrt(2)
    assert found.contributions["repeatability"][0] == pytest.approx([0.756, 1.0], rel=0.01)


def test_the_larger_of_both_changes_counts() -> None:
    measured = np.array([-3.0, 1.0])
    tests = [recording(measured, Declared(uncertainty=MeasuringUncertainty(repeatability_um=1.0)))]
    found = find_uncertainty("z_um", measured, np.zeros(2), np.zeros(2, np.intp), tests)
    assert found is not None
    assert found.contributions["zero"][0] == pytest.approx([0.592, 1.0], rel=0.01)  # sqrt(8) - sqrt(5), not - 2


def test_the_zeros_of_two_tests_are_independent() -> None:
    measured = np.full(4, 3.0)
    declared = Declared(uncertainty=MeasuringUncertainty(repeatability_um=0.2))
    tests = [recording(measured, declared)] * 2
    found = find_uncertainty("z_um", measured, np.zeros(4), np.array([0, 0, 1, 1]), tests)
    assert found is not None
    # 0.2 in half of the rows changes an RMS of 3 by 0.1017; two such changes
    assert found.contributions["zero"][0] == pytest.approx([0.1438, 0.2828], rel=0.01)


def test_what_is_not_stated_is_not_invented() -> None:
    found = find(MeasuringUncertainty(probe_um=0.3, repeatability_um=0.0), {})
    assert found.expanded("rms") == pytest.approx(0.3, rel=0.01)
    assert found.absent == (
        *("sensitivity_pct", "misalignment_deg", "mounting_um", "instrument_drift_um", "expansion"),
    )
    stated = recording(MEASURED, Declared(uncertainty=WHOLE))
    silent = recording(MEASURED, Declared())
    two = np.array([0, 0, 1, 1])
    assert find_uncertainty("z_um", MEASURED, PREDICTED, two, [stated, silent]) is None
    assert find_uncertainty("z_um", MEASURED, PREDICTED, two * 0, [stated, silent]) is not None


def test_repeatability_is_the_scatter_of_the_rows_not_their_drift() -> None:
    time = np.arange(2000)
    drift = 60.0 * (1.0 - np.exp(-time / 300.0))
    for noise in (0.0, 0.5):
        measured = drift + np.random.default_rng(1).normal(0.0, noise, len(time))
        tests = [recording(measured, Declared(uncertainty=MeasuringUncertainty(probe_um=0.3)))]
        found = find_uncertainty("z_um", measured, drift, np.zeros(len(time), np.intp), tests)
        assert found is not None
        assert found.repeatability == pytest.approx(noise, rel=0.1, abs=0.01)
    coarse = np.round(drift)  # without noise, the resolution remains: 1 / sqrt 12
    tests = [recording(coarse, Declared(uncertainty=MeasuringUncertainty(probe_um=0.3)))]
    found = find_uncertainty("z_um", coarse, drift, np.zeros(len(time), np.intp), tests)
    assert found is not None
    assert found.repeatability == pytest.approx(0.289, rel=0.01)


@pytest.mark.parametrize("size", [2.0, 0.3])
def test_the_true_figures_lie_within_the_uncertainty(size: float) -> None:
    """Of drawn measurements of a known drift, 95 % must hold the true RMS before and after compensation."""
    rng = np.random.default_rng(0)
    time = np.linspace(0.0, 1.0, 200)
    true = 40.0 * (1.0 - np.exp(-4.0 * time))
    left = size * np.sin(40.0 * time)
    declared = Declared(uncertainty=MeasuringUncertainty(0.3, 1.0, 0.0, 0.0, 0.0, 0.2))
    held = []
    for _ in range(300):
        course = [np.ones(200), left * np.sqrt(2.0) / size, np.sin(3.0 * time) * np.sqrt(2.0)][rng.integers(3)]
        measured = true * (1.0 + 0.005 * rng.normal()) + 0.15 * rng.normal() * course + 0.2 * rng.normal()
        measured = measured + 0.2 * rng.normal(size=200)
        found = find_uncertainty("z_um", measured, true - left, np.zeros(200, np.intp), [recording(measured, declared)])
        assert found is not None
        for none, truth, seen in ((True, true, measured), (False, left, measured - (true - left))):
            off = abs(np.sqrt(np.mean(seen**2)) - np.sqrt(np.mean(truth**2)))
            held.append(off <= found.expanded("rms", none=none))
    assert np.mean(held[::2]) >= 0.93
    assert np.mean(held[1::2]) >= 0.93
