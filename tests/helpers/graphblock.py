"""A compensator as a graph of ONNX, run in this process."""

from typing import NamedTuple

import numpy as np
import onnxruntime
from numpy.typing import NDArray

from thermocomp.export.onnx.graph import translate
from thermocomp.export.onnx.nodes import serialize
from thermocomp.export.onnx.vectors import without_watch
from thermocomp.export.vectors import Readings
from thermocomp.runtime.compensator import Compensator
from thermocomp.runtime.program.tables import Tables, gather

FloatArray = NDArray[np.float64]


class Said(NamedTuple):
    """What a graph says of readings."""

    correction: FloatArray
    slope: FloatArray
    status: NDArray[np.int64]
    deviation: FloatArray


def session_of(model: bytes) -> onnxruntime.InferenceSession:
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = 1
    return onnxruntime.InferenceSession(model, options, providers=["CPUExecutionProvider"])


class GraphBlock:
    """The graph of a compensator.

    Parameters
    ----------
    compensator : Compensator
    """

    def __init__(self, compensator: Compensator) -> None:
        self.inside = without_watch(compensator)
        self.tables: Tables = gather(self.inside)
        self.block = translate(self.tables)
        self.session = session_of(serialize(self.block.graph, "block", ["facts"], {}, "0"))

    def step(
        self, value: FloatArray, zero: FloatArray, dt: float, state: FloatArray
    ) -> tuple[FloatArray, FloatArray, NDArray[np.int64], FloatArray]:
        """Call it once."""
        given = {"value": value, "zero": zero, "dt": np.array([dt]), "state": state}
        correction, slope, status, after = self.session.run(
            ["correction", "slope", "status", "next_state"], {k: v.astype(np.float64) for k, v in given.items()}
        )
        return correction, slope, status, after

    def run(self, readings: Readings, zero: FloatArray) -> Said:
        """Run it from the start; `zero` is one row, or a row per call."""
        state, rows = np.zeros(self.block.size), []
        zeros = np.broadcast_to(zero, readings.values.shape)
        for value, begin, dt in zip(readings.values, zeros, readings.dt.tolist(), strict=True):
            correction, slope, status, state = self.step(value, begin, dt, state)
            first = self.block.deviation
            rows.append((correction, slope, status, state[first : first + len(self.tables.models)]))
        return Said(*(np.array([r[k] for r in rows]) for k in range(4)))
