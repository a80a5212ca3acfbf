"""Arrays by their contents."""

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
#: positions and numbers of rows
IntArray = NDArray[np.intp]
