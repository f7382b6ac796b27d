"""The straight edges of a carpet, from points that were seen on them.

Every pair of some points is tried, as RANSAC would try random ones: with so few points that is as
fast, and the same points always give the same lines. scikit-learn's RANSAC fits y over x and so
misses edges along y, and no line fit of OpenCV or SciPy knows that a carpet lies on one side only.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class EdgeConfig:
    """What counts as a straight edge."""

    max_edges: int = 4  # sides of a carpet
    # Of so many points, or up to twice as many, each pair is a candidate: enough to meet both ends
    # of every side, and few enough for a tick.
    tried_points: int = 24
    min_span_m: float = 0.6  # between a candidate's two points; shorter, it turns with their noise
    on_line_m: float = 0.08  # a point this near lies on the line; the memory errs by so much
    min_points: int = 10  # on a line; fewer may be a corner's or specks
    min_share_inside: float = 0.9  # of the other points; a carpet is convex


def straight_edges(edges_m: Floats, config: EdgeConfig | None = None) -> list[tuple[Floats, float]]:
    """Return the lines that edge points lie on, as outward normal and distance from the origin.

    Args:
        edges_m: (N, 2) points where the carpet ends, metres, the drone, inside, at the origin.
        config: what counts as an edge.

    Returns:
        Up to four of a unit vector (2,) and metres along it, most points first.
    """
    config = config or EdgeConfig()
    lines: list[tuple[Floats, float]] = []
    left = edges_m
    while len(lines) < config.max_edges and len(left) >= config.min_points:
        line = _best_line(left, edges_m, config)
        if line is None:
            break
        lines.append(line)
        normal, range_m = line
        left = left[np.abs(left @ normal - range_m) > config.on_line_m]
    return lines


def _best_line(
    points_m: Floats, edges_m: Floats, config: EdgeConfig
) -> tuple[Floats, float] | None:
    tried = points_m[:: max(1, len(points_m) // config.tried_points)]
    first, second = np.array(list(combinations(range(len(tried)), 2))).T
    along = tried[second] - tried[first]
    span_m = np.hypot(*along.T)
    long = span_m >= config.min_span_m
    if not long.any():
        return None
    first, along, span_m = first[long], along[long], span_m[long]
    normals = np.column_stack([-along[:, 1], along[:, 0]]) / span_m[:, None]
    ranges_m = np.einsum("ij,ij->i", normals, tried[first])
    normals = np.where(ranges_m[:, None] < 0.0, -normals, normals)
    ranges_m = np.abs(ranges_m)
    on_line = np.abs(points_m @ normals.T - ranges_m) <= config.on_line_m
    within = (edges_m @ normals.T <= ranges_m + 2.0 * config.on_line_m).mean(axis=0)
    counts = np.where(within >= config.min_share_inside, on_line.sum(axis=0), 0)
    best = int(counts.argmax())
    if counts[best] < config.min_points:
        return None
    return normals[best], float(ranges_m[best])
