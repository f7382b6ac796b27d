"""Confidence intervals of proportions."""

from __future__ import annotations

import math
from typing import Final

from uav_bt.errors import ValueRangeError

__all__ = ["wilson"]

_Z_95: Final = 1.959963984540054  # the normal distribution's 97.5 % quantile


def wilson(successes: int, trials: int, z: float = _Z_95) -> tuple[float, float]:
    """Return the Wilson score interval of a proportion, 95 % by default.

    E. B. Wilson, Probable inference, the law of succession, and statistical inference, JASA 22
    (1927). Unlike the textbook interval it says something sensible of 0 and of 100 %.

    Args:
        successes: how often it went well.
        trials: how often it was tried, at least once.
        z: quantile of the normal distribution.

    Returns:
        Lower and upper end, 0 to 1.

    Raises:
        ValueRangeError: there are no trials, or more successes than trials.
    """
    if not 0 <= successes <= trials or trials == 0:
        raise ValueRangeError(
            f"an interval needs 0 <= successes <= trials and a trial, got {successes} of {trials}"
        )
    share, weight = successes / trials, z * z / trials
    middle = (share + weight / 2) / (1 + weight)
    half = z / (1 + weight) * math.sqrt(share * (1 - share) / trials + weight / (4 * trials))
    return max(0.0, middle - half), min(1.0, middle + half)
