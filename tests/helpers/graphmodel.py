"""The graph of a model, run by onnxruntime in this process and compared with the model."""

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from thermocomp.core.exceptions import ReadingError
from thermocomp.core.model import ErrorModel
from thermocomp.export.onnx.graph import translate

FloatArray = NDArray[np.float64]


class GraphModel:
    """The graph of a model.

    Parameters
    ----------
    model : ErrorModel
    """

    def __init__(self, model: ErrorModel) -> None:
        self.model = model
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads = 1
        text = translate(model).serialize("model", ["facts"], {}, "0")
        self.session = onnxruntime.InferenceSession(text, options, providers=["CPUExecutionProvider"])
        self.shapes: dict[str, list[int]] = {i.name: i.shape for i in self.session.get_inputs()}

    def step(
        self, value: FloatArray, zero: FloatArray, dt: float, state: FloatArray
    ) -> tuple[float, list[bool], FloatArray]:
        """Call it once."""
        given = {"value": value, "zero": zero, "dt": np.array([dt]), "state": state}
        given = {name: np.asarray(given[name], dtype=np.float64) for name in self.shapes}
        deviation, outside, *after = self.session.run(None, given)
        return float(deviation[0]), outside.tolist(), after[0] if after else state

    def check(self, values: FloatArray, steps: FloatArray, zero: FloatArray, within: float = 1e-9) -> FloatArray:
        """Compare it with `ErrorModel.step`, call by call: deviation, inputs outside and memory; return the deviations.

        Parameters
        ----------
        values : ndarray of shape (n_calls, n_inputs)
        steps : ndarray of shape (n_calls,)
        zero : ndarray of shape (n_inputs,)
        """
        known, state, found = self.model.init(zero), np.zeros(self.shapes.get("state", 0)), list[float]()
        largest, kept = np.array(1.0), np.ones(len(state))  # what was large before is rounded accordingly
        for value, dt in zip(values, steps.tolist(), strict=True):
            before = state
            deviation, outside, state = self.step(value, zero, dt, state)
            found.append(deviation)
            try:
                known, wanted = self.model.step(known, value, dt if self.model.remembers else 0.0)
            except ReadingError:
                assert np.isnan(deviation)
                assert np.array_equal(state, before)
                continue
            assert outside == known.outside.tolist()
            largest = np.maximum(largest, np.abs(wanted))
            _check_near(np.array(deviation), wanted, within * largest)
            if len(state):
                assert known.memory is not None
                expected = np.array([1.0, wanted, *known.memory])
                kept = np.maximum(kept, np.abs(expected))
                _check_near(state, expected, within * kept)
        return np.array(found)


def _check_near(found: FloatArray, wanted: FloatArray, within: FloatArray) -> None:
    assert found.shape == wanted.shape
    assert np.isfinite(found).all()
    assert (np.abs(found - wanted) <= within).all()
