"""The check that arrays share when they become part of a value."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import ShapeError


def check_shape(name: str, array: NDArray[np.generic], ndim: int, last: int | None = None) -> None:
    """Raise ShapeError unless the array has so many dimensions, and so many channels."""
    if array.ndim != ndim or (last is not None and array.shape[-1] != last):
        dims = "x".join(["H", "W"][:ndim] + ([str(last)] if last else []))
        raise ShapeError(name, expected=dims, actual=array.shape)
