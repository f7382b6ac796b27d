"""The straight edges of a carpet, from points that were seen on them."""

from __future__ import annotations

from itertools import combinations

import numpy as np
from numpy.typing import NDArray

__all__ = ["straight_edges"]

Floats = NDArray[np.float64]
_MOST = 4  # sides of a carpet
_TRIED = 24  # points, or up to twice as many, of which each pair is a candidate
_LEAST_SPAN_M = 0.6
_ON_LINE_M = 0.08
_LEAST_POINTS = 10
_LEAST_SHARE_INSIDE = 0.9  # of the other points; a carpet is convex


def straight_edges(edges_m: Floats) -> list[tuple[Floats, float]]:
    """Return the lines that edge points lie on, as outward normal and distance from the origin.

    Args:
        edges_m: (N, 2) points where the carpet ends, metres, the drone, inside, at the origin.

    Returns:
        Up to four of a unit vector (2,) and metres along it, most points first.
    """
    lines: list[tuple[Floats, float]] = []
    left = edges_m
    while len(lines) < _MOST and len(left) >= _LEAST_POINTS:
        line = _best_line(left, edges_m)
        if line is None:
            break
        lines.append(line)
        normal, range_m = line
        left = left[np.abs(left @ normal - range_m) > _ON_LINE_M]
    return lines


def _best_line(points_m: Floats, edges_m: Floats) -> tuple[Floats, float] | None:
    tried = points_m[:: max(1, len(points_m) // _TRIED)]
    first, second = np.array(list(combinations(range(len(tried)), 2))).T
    along = tried[second] - tried[first]
    span_m = np.hypot(*along.T)
    long = span_m >= _LEAST_SPAN_M
    if not long.any():
        return None
    first, along, span_m = first[long], along[long], span_m[long]
    normals = np.column_stack([-along[:, 1], along[:, 0]]) / span_m[:, None]
    ranges_m = np.einsum("ij,ij->i", normals, tried[first])
    normals = np.where(ranges_m[:, None] < 0.0, -normals, normals)
    ranges_m = np.abs(ranges_m)
    on_line = np.abs(points_m @ normals.T - ranges_m) <= _ON_LINE_M
    within = (edges_m @ normals.T <= ranges_m + 2.0 * _ON_LINE_M).mean(axis=0)
    counts = np.where(within >= _LEAST_SHARE_INSIDE, on_line.sum(axis=0), 0)
    best = int(counts.argmax())
    if counts[best] < _LEAST_POINTS:
        return None
    return normals[best], float(ranges_m[best])
