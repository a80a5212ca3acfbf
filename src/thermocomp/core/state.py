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
