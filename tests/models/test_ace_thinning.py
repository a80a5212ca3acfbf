"""The tables of `ace`, thinned: a small file that predicts the same for the rows that were fitted."""

import json
from dataclasses import asdict
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from thermocomp.core.additive import Additive
from thermocomp.core.curves import Curve
from thermocomp.core.inputs import Input
from thermocomp.files import modelfile
from thermocomp.models.ace import ACE
from thermocomp.models.ace_thinning import POINTS, SMALL, TOLERANCE, thin
from thermocomp.models.training import train
from thermocomp.recordings.readers import recordings
from thermocomp.recordings.recording import Recording
from thermocomp.recordings.stacking import stack
from thermocomp.virtual.datasets import record

FloatArray = NDArray[np.float64]


def frozen(ace: ACE, target: str = "z_um") -> Additive:
    """Return the model as it is read from its file."""
    inputs = [
        Input(f"t{k}", "temperature", "degC", 0.0, False, float(a), float(b))
        for k, (a, b) in enumerate(zip(ace.data_min_, ace.data_max_, strict=True))
    ]
    (read,) = modelfile.loads(modelfile.dumps([ace.freeze(target=target, inputs=inputs)]))
    assert isinstance(read, Additive)
    return read


def says(model: Additive, change: FloatArray) -> FloatArray:
    time = np.arange(len(change), dtype=np.float64)
    return model.predict({"time_s": time} | {f"t{k}": change[:, k] for k in range(change.shape[1])})


def rms(errors: FloatArray) -> float:
    return float(np.sqrt(np.mean(errors**2)))


def check(recording: Recording, target: str, ace: ACE) -> None:
    """Fit three of four rows; the others are new to both."""
    samples = stack([recording], [target])
    hot = [k for k, c in enumerate(samples.inputs) if c.quantity == "temperature"]
    change, y = samples.values[:, hot] - samples.values[0, hot], samples.deviations[:, 0]
    fitted = np.arange(len(y)) % 4 != 3
    ace.fit(change[fitted], y[fitted])
    model = frozen(ace)
    assert len(modelfile.dumps([model])) < 300_000
    assert sum(len(c.x) for c in model.curves) <= POINTS
    assert np.abs(says(model, change[fitted]) - ace.predict(change[fitted])).max() <= TOLERANCE
    # between the rows the steps are noise: neither is nearer to the truth
    new = ~fitted
    assert rms(says(model, change[new]) - y[new]) < 1.05 * rms(ace.predict(change[new]) - y[new])


@pytest.mark.long
@pytest.mark.parametrize("target", ["ch1_um", "ch3_um"])
@pytest.mark.parametrize("ace", [ACE(), ACE(window_share=0.05), ACE(converged=True)])
def test_a_measured_spindle(shared_data: Path, target: str, ace: ACE) -> None:
    check(recordings.read(shared_data / "fl_thermal" / "recording.csv"), target, ace)


@pytest.mark.long
@pytest.mark.parametrize("ace", [ACE(), ACE(window_share=0.05)])
def test_a_virtual_spindle(ace: ACE) -> None:
    recording = record("demo")[0]
    assert len(recording.table) > 5000
    check(recording, "z_um", ace)


def test_9000_measured_rows_are_one_small_file(shared_data: Path) -> None:
    """With all that stands beside the numbers: fingerprints of the rows, what was covered."""
    samples = stack([recordings.read(shared_data / "fl_thermal" / "recording.csv")], ["ch3_um"])
    assert len(samples) > 8800
    trained = train("ace", samples, 0, np.ones(len(samples), np.bool_), prints=True)
    assert len(modelfile.dumps([trained.model])) < 300_000
    assert len(json.dumps(asdict(trained.model)["provenance"])) > 10_000


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 4), st.sampled_from([0.0, 0.05, 2.0]), st.booleans())
def test_rows_that_were_fitted_keep_their_prediction(seed: int, n: int, noise: float, coarse: bool) -> None:
    rng = np.random.default_rng(seed)
    change = np.cumsum(rng.normal(size=(3000, n)), axis=0)
    change = np.round(change, 1) if coarse else change
    y = np.tanh(change[:, 0] / 20) * 30 + change[:, -1] + noise * rng.normal(size=3000)
    ace = ACE(window_share=0.02, max_sweeps=5).fit(change, y)
    model = frozen(ace)
    small = sum(len(c.x) for c in (*ace._curves, ace._inverse)) <= SMALL
    assert small == (model.response == ace._inverse)
    moved = np.abs(says(model, change) - ace.predict(change))
    assert (moved > TOLERANCE).sum() <= 10  # of 3000: those whose sum has become that of another row
    assert moved.max() <= 10 * TOLERANCE


def test_few_rows_are_left_as_they_are() -> None:
    curve, response = Curve((0.0, 1.0), (0.0, 1.0, 2.0), "step"), Curve((0.0,), (1.0, 2.0), "step")
    assert thin([curve], response, [np.zeros(3)]) == ((curve,), response)
