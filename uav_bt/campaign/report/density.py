"""Densities of numbers that cannot be negative, as the paper plots them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

__all__ = ["bandwidth", "density"]

Values = NDArray[np.float64]


def bandwidth(values: Sequence[float]) -> float:
    """Return Silverman's bandwidth of a Gaussian kernel density, in the values' unit.

    B. W. Silverman, Density estimation for statistics and data analysis (1986), equation 3.31.
    """
    array = np.asarray(values, dtype=np.float64)
    std = float(array.std(ddof=1)) if len(array) > 1 else 0.0
    upper, lower = np.percentile(array, [75, 25])
    spreads = [spread for spread in (std, float(upper - lower) / 1.34) if spread > 0.0]
    # Where most values are one and the same, the spread of the rest decides.
    return 0.9 * min(spreads) * len(array) ** -0.2 if spreads else 0.0


def density(values: Sequence[float], at: Values) -> Values:
    """Return the density of times or distances, which end at nought: what lies below is folded up.

    Args:
        values: at least two different ones, none negative.
        at: where to evaluate, (N,), none negative.

    Returns:
        (N,), integrates to one from nought upwards.
    """
    array = np.asarray(values, dtype=np.float64)
    width = bandwidth(values)
    total = np.zeros_like(at)
    for centre in (array, -array):
        total += np.exp(-0.5 * ((at[:, None] - centre[None]) / width) ** 2).sum(axis=1)
    return np.asarray(total / (len(array) * width * np.sqrt(2.0 * np.pi)))
