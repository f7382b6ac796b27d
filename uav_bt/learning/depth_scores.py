"""Scores of whole depth maps.

The measures are the usual ones (Eigen et al., arXiv 1406.2283): relative error after median
scaling, and errors in metres with the ground's scale. They are computed separately for obstacles
and ground within reach, which a drone could hit.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from math import nan

import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import ValueRangeError
from uav_bt.lab.classes import GROUND, OBSTACLE, OUTSIDE
from uav_bt.types.arrays import Floats32

_MIN_RANGE_M, _MAX_RANGE_M = 0.3, 5.0  # the paper's range of distances
_MIN_GROUND_PX = 50  # pixels; with fewer an image gives no scale

DepthSample = tuple[Floats32, Floats32, NDArray[np.uint8], Floats32]
"""Maps of an image, (H, W): depth as predicted, in any unit, and true; exact roles; depth of the
ground plane, NaN above the horizon. Depths are along the optical axis."""


@dataclass(frozen=True)
class DepthScore:
    """Means over images. "Relative": after scaling by the image's median."""

    images: int
    abs_rel: float  # relative, of all pixels but the background's within reach
    delta_1: float  # relative, share of those within a quarter of the truth
    obstacle_abs_rel: float  # relative, of obstacles within reach
    ground_abs_rel: float  # relative, of the ground within reach
    obstacle_error_m: float  # with the ground's scale, mean of obstacles within reach
    obstacle_median_m: float  # with the ground's scale, mean over images of the median error
    ground_error_m: float  # with the ground's scale, of the ground
    metric_error_m: float  # as it is, taken for metres: obstacles and ground; of metric networks


def score_depth(samples: Iterable[DepthSample]) -> DepthScore:
    """Score predictions; a score that an image does not have (of obstacles, say) is left out."""
    table = np.array([_scores(*sample) for sample in samples], dtype=np.float64)
    if not len(table):
        raise ValueRangeError("there are no images to score depth on")
    counts, sums = np.isfinite(table).sum(axis=0), np.nansum(table, axis=0)
    means = [float(s / c) if c else nan for s, c in zip(sums, counts, strict=True)]
    return DepthScore(len(table), *means)


def _scores(
    depth: Floats32, truth_m: Floats32, roles: NDArray[np.uint8], ground_m: Floats32
) -> tuple[float, ...]:
    """Return the fields of `DepthScore` for one image; NaN where there are no such pixels."""
    predicted, truth = depth.astype(np.float64), truth_m.astype(np.float64)
    if not (np.isfinite(predicted).all() and (predicted > 0.0).all()):
        raise ValueRangeError("a predicted depth must be positive and finite everywhere")
    near = (truth >= _MIN_RANGE_M) & (truth <= _MAX_RANGE_M)
    things = near & (roles != OUTSIDE)
    obstacle, ground = near & (roles == OBSTACLE), near & (roles == GROUND)
    if not things.any():
        return (nan,) * 8
    scaled = predicted * np.median(truth[things] / predicted[things])
    relative = np.abs(scaled - truth) / truth
    ratio = np.maximum(scaled / truth, truth / scaled)
    metric = np.full_like(truth, nan)
    seen = ground & np.isfinite(ground_m)
    if np.count_nonzero(seen) >= _MIN_GROUND_PX:
        metric = predicted * np.median(ground_m[seen] / predicted[seen])
    error_m = np.abs(metric - truth)
    return (
        _mean(relative[things]),
        _mean((ratio < 1.25)[things]),
        _mean(relative[obstacle]),
        _mean(relative[ground]),
        _mean(error_m[obstacle]),
        float(np.median(error_m[obstacle])) if obstacle.any() else nan,
        _mean(error_m[ground]),
        _mean(np.abs(predicted - truth)[obstacle | ground]),
    )


def _mean(values: NDArray[np.generic]) -> float:
    return float(values.mean()) if values.size else nan
