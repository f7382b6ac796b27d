"""Numbers and horizontal vectors within bounds."""

from __future__ import annotations

import math


def clamp(value: float, limit: float) -> float:
    """Return a value bounded to [-limit, limit]."""
    return max(-limit, min(limit, value))


def limit_length(x: float, y: float, limit: float) -> tuple[float, float]:
    """Return a horizontal vector shortened to a length; its direction stays."""
    length = math.hypot(x, y)
    if length <= limit:
        return x, y
    share = limit / length
    return x * share, y * share
