"""Types of numpy arrays by the type of their elements."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
# positions and row numbers
IntArray = NDArray[np.intp]
