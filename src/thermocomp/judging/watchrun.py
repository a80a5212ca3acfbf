"""A watch (sensor monitoring) applied to recorded readings by the compiled program."""

import numpy as np
from numpy.typing import NDArray

from thermocomp.core.arrays import BoolArray, FloatArray
from thermocomp.core.watch import Watch
from thermocomp.judging.compiled.machine import run
from thermocomp.judging.compiled.rows import believe_rows
from thermocomp.runtime.program.memory import FlatMemory
from thermocomp.runtime.program.tables import constants_of_watch


def run_watch(
    watch: Watch, time: FloatArray, values: FloatArray, resting: BoolArray, reference: FloatArray | None = None
) -> tuple[FloatArray, NDArray[np.int8]]:
    """Return the readings that a watch passes on, and the state of each sensor; see `thermocomp.runtime.watch.look`.

    Parameters
    ----------
    time : ndarray of shape (n_rows,)
        Increasing [s].
    values : ndarray of shape (n_rows, n_inputs)
        Values in the order of the watch's inputs; nan where a value is missing.
    resting : ndarray of bool of shape (n_rows,)
        Whether the spindle is known to be stopped.
    reference : ndarray of shape (n_inputs,), optional
        Zero of the inputs; nan where the first readings determine it, as by default for inputs with ``rezero``.

    Returns
    -------
    passed : ndarray of shape (n_rows, n_inputs)
    faults : ndarray of int of shape (n_rows, n_sensors)
        See `thermocomp.runtime.watchstate.WORDS`.
    """
    sizes, constants = constants_of_watch(watch, reference)
    memory = FlatMemory(sizes | {"ROWS": len(time)}, constants)
    passed, faults = memory.find("r", "value"), memory.find("r", "fault")
    memory.find("r", "time")[:], memory.find("r", "resting")[:], passed[:] = time, resting, values
    run(believe_rows, memory)
    return passed, faults.astype(np.int8)
