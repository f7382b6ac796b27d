"""What a list of estimates beside the truth comes to, as the paper tells it."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import ShapeError, ValueRangeError

__all__ = ["ErrorSummary", "summarise_errors"]


@dataclass(frozen=True, kw_only=True)
class ErrorSummary:
    """Of absolute errors, metres; NaN where too few estimates have such a figure."""

    asked: int  # estimates that were asked for
    answered: int  # those that were given; all figures below are about them
    mean_m: float
    median_m: float
    rmse_m: float
    std_m: float  # of the absolute error, as in the paper: rmse^2 = mean^2 + std^2
    p95_m: float
    max_m: float
    bias_m: float  # mean of estimate less truth: what the sign of the errors has in common
    correlation: float  # Pearson's, of estimates with the truth

    @property
    def coverage(self) -> float:
        """Share of the asked that was answered, NaN when nothing was asked."""
        return self.answered / self.asked if self.asked else math.nan


def summarise_errors(
    estimated_m: NDArray[np.floating], truth_m: NDArray[np.floating]
) -> ErrorSummary:
    """Summarise estimates of lengths.

    Args:
        estimated_m: (N,) metres; NaN where there is no estimate.
        truth_m: (N,) metres.

    Raises:
        ShapeError: the two are no lists of equal length.
        ValueRangeError: a truth is not finite, or an estimate is infinite.
    """
    if estimated_m.ndim != 1 or truth_m.shape != estimated_m.shape:
        expected = f"{truth_m.size}, as many as truths"
        raise ShapeError("estimates", expected=expected, actual=estimated_m.shape)
    if not np.isfinite(truth_m).all() or np.isinf(estimated_m).any():
        raise ValueRangeError("truths must be finite and estimates finite or NaN")
    known = np.isfinite(estimated_m)
    estimated, truth = estimated_m[known].astype(np.float64), truth_m[known].astype(np.float64)
    if not estimated.size:
        figures = dict.fromkeys(_FIGURES, math.nan)
        return ErrorSummary(asked=truth_m.size, answered=0, **figures)
    error = np.abs(estimated - truth)
    return ErrorSummary(
        asked=truth_m.size,
        answered=estimated.size,
        mean_m=float(error.mean()),
        median_m=float(np.median(error)),
        rmse_m=math.sqrt(float(np.mean(error**2))),
        std_m=float(error.std()),
        p95_m=float(np.percentile(error, 95.0)),
        max_m=float(error.max()),
        bias_m=float(np.mean(estimated - truth)),
        correlation=_correlation(estimated, truth),
    )


_FIGURES = (
    *("mean_m", "median_m", "rmse_m", "std_m", "p95_m", "max_m", "bias_m"),
    "correlation",
)


def _correlation(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    a, b = first - first.mean(), second - second.mean()
    size = math.sqrt(float(a @ a) * float(b @ b))
    return float(a @ b) / size if size > 0.0 else math.nan
