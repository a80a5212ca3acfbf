"""State of a model between two steps."""

from typing import NamedTuple

from thermocomp.core.arrays import BoolArray, FloatArray


class State(NamedTuple):
    """Model state between two steps.

    Leading axes, if any, are a batch of independent runs.
    """

    reference: FloatArray  #: (..., n_inputs), values that count as zero
    memory: FloatArray | None  #: (..., n_memory); None before the first reading
    deviation: FloatArray  #: (...,), last deviation returned
    outside: BoolArray  #: (..., n_inputs), inputs beyond the trained range


class RunOutputs(NamedTuple):
    """Answers of a model to readings, one after another; further axes are a batch of independent runs."""

    state: State  #: after the last reading
    deviation: FloatArray  #: (n_readings, ...) [unit]
    outside: BoolArray  #: (n_readings, ..., n_inputs), inputs beyond the trained range
    change: FloatArray  #: (n_readings, ..., n_inputs), minus the reference, clipped to the trained range
    far: FloatArray  #: (n_readings, ...), distance from the training data; 0 if nothing depends on it
    outputs: FloatArray  #: (n_readings, ..., n_outputs), deviation at `change`, spread, further expressions
