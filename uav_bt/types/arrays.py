"""Types of NumPy arrays. Shapes and units are given where an array is used."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Floats32 = NDArray[np.float32]
Flags = NDArray[np.bool_]
Indices = NDArray[np.intp]
Image = NDArray[np.uint8]
Ids = NDArray[np.uint8]  # of classes or roles
