"""Depth scores: scores of whole maps, and errors of lengths in metres.

The measures of maps are the usual ones (Eigen et al., arXiv 1406.2283): relative error after median
scaling, and errors in metres with the ground's scale. They are computed separately for obstacles
and ground within reach, which a drone could hit. `draw_points` samples points for comparing ranges,
like those measured with a tape.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera.ground_plane import ray_lengths
from uav_bt.errors import ShapeError, ValueRangeError
from uav_bt.lab.classes import GROUND, OBSTACLE, OUTSIDE
from uav_bt.types import CameraModel, ClassMap
from uav_bt.types.arrays import Floats32

_MIN_RANGE_M, _MAX_RANGE_M = 0.3, 5.0  # the paper's range of distances
_MIN_GROUND_PX = 50  # pixels; with fewer an image gives no scale


@dataclass(frozen=True, kw_only=True, eq=False)
class DepthSample:
    """One prediction beside the truth, all maps of one size."""

    predicted: NDArray[np.float32]  # (H, W) along the optical axis, any unit
    truth_m: NDArray[np.float32]  # (H, W)
    roles: NDArray[np.uint8]  # (H, W) exact roles
    ground_m: NDArray[np.float32]  # (H, W) depth of the ground plane, NaN above the horizon


@dataclass(frozen=True, kw_only=True)
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
    """Score predictions.

    Raises:
        ShapeError: maps of one sample differ in size.
        ValueRangeError: there is nothing to score, or a prediction is not positive and finite.
    """
    rows = [_score_one(sample) for sample in samples]
    if not rows:
        raise ValueRangeError("there are no images to score depth on")
    # For example, an image without obstacles has no error of obstacles.
    table = np.array(rows, dtype=np.float64)
    counts = np.isfinite(table).sum(axis=0)
    sums = np.nansum(table, axis=0)
    means = [float(s / c) if c else float("nan") for s, c in zip(sums, counts, strict=True)]
    return DepthScore(
        images=len(rows),
        abs_rel=means[0],
        delta_1=means[1],
        obstacle_abs_rel=means[2],
        ground_abs_rel=means[3],
        obstacle_error_m=means[4],
        obstacle_median_m=means[5],
        ground_error_m=means[6],
        metric_error_m=means[7],
    )


def _score_one(sample: DepthSample) -> tuple[float, ...]:
    predicted, truth = sample.predicted.astype(np.float64), sample.truth_m.astype(np.float64)
    for other in (truth, sample.roles, sample.ground_m):
        if other.shape != predicted.shape:
            expected = "x".join(map(str, predicted.shape))
            raise ShapeError("the maps of a sample", expected=expected, actual=other.shape)
    if not (np.isfinite(predicted).all() and (predicted > 0.0).all()):
        raise ValueRangeError("a predicted depth must be positive and finite everywhere")
    roles = sample.roles
    near = (truth >= _MIN_RANGE_M) & (truth <= _MAX_RANGE_M)
    things = near & (roles != OUTSIDE)
    obstacle, ground = near & (roles == OBSTACLE), near & (roles == GROUND)
    if not things.any():
        return (float("nan"),) * 8
    scaled = predicted * np.median(truth[things] / predicted[things])
    relative = np.abs(scaled - truth) / truth
    ratio = np.maximum(scaled / truth, truth / scaled)
    metric = np.full_like(truth, np.nan)
    seen = ground & np.isfinite(sample.ground_m)
    if np.count_nonzero(seen) >= _MIN_GROUND_PX:
        metric = predicted * np.median(sample.ground_m[seen] / predicted[seen])
    error_m = np.abs(metric - truth)
    return (
        _mean(relative[things]),
        _mean((ratio < 1.25)[things]),
        _mean(relative[obstacle]),
        _mean(relative[ground]),
        _mean(error_m[obstacle]),
        float(np.median(error_m[obstacle])) if obstacle.any() else float("nan"),
        _mean(error_m[ground]),
        _mean(np.abs(predicted - truth)[obstacle | ground]),
    )


def _mean(values: NDArray[np.generic]) -> float:
    return float(values.mean()) if values.size else float("nan")


# --- lengths --------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class ErrorSummary:
    """Of absolute errors, metres; NaN where too few estimates have such a figure."""

    total: int  # estimates that were wanted
    valid: int  # those that were given; all figures below are about them
    mean_m: float
    median_m: float
    rmse_m: float
    std_m: float  # of the absolute error, as in the paper: rmse^2 = mean^2 + std^2
    p95_m: float
    max_m: float
    bias_m: float  # mean of estimate less truth
    correlation: float  # Pearson's, of estimates with the truth

    @property
    def coverage(self) -> float:
        """Share of wanted estimates that were given; NaN when none was wanted."""
        return self.valid / self.total if self.total else math.nan


def summarise_errors(
    estimated_m: NDArray[np.floating], truth_m: NDArray[np.floating]
) -> ErrorSummary:
    """Summarise estimates of lengths.

    Args:
        estimated_m: (N,) metres; NaN without an estimate.
        truth_m: (N,) metres.

    Raises:
        ShapeError: the arrays are not one-dimensional and of equal length.
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
        return ErrorSummary(total=truth_m.size, valid=0, **figures)
    error = np.abs(estimated - truth)
    return ErrorSummary(
        total=truth_m.size,
        valid=estimated.size,
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
    "mean_m",
    "median_m",
    "rmse_m",
    "std_m",
    "p95_m",
    "max_m",
    "bias_m",
    "correlation",
)


def _correlation(first: NDArray[np.float64], second: NDArray[np.float64]) -> float:
    a, b = first - first.mean(), second - second.mean()
    size = math.sqrt(float(a @ a) * float(b @ b))
    return float(a @ b) / size if size > 0.0 else math.nan


@dataclass(frozen=True, kw_only=True)
class PointConfig:
    """Which points are sampled."""

    each: int = 40  # points per image on obstacles, and as many on the ground
    inset_px: int = 2  # distance from the border of a class, where the point is ambiguous
    min_range_m: float = 0.3  # along the ray; the paper's range of distances
    max_range_m: float = 5.0

    def __post_init__(self) -> None:
        if self.each < 1 or self.inset_px < 0 or not 0.0 <= self.min_range_m < self.max_range_m:
            raise ValueRangeError(
                "points need each >= 1, inset_px >= 0 and 0 <= min_range_m < max_range_m, got "
                f"{self.each}, {self.inset_px}, {self.min_range_m}, {self.max_range_m}"
            )


@dataclass(frozen=True, kw_only=True)
class MeasuredPoints:
    """N pixels with their true range and kind."""

    pixels: NDArray[np.intp]  # (N, 2) column, row
    range_m: NDArray[np.float64]  # (N,) true distance from the lens along the ray
    obstacle: NDArray[np.bool_]  # (N,) True for obstacles, False for ground

    def __len__(self) -> int:
        return len(self.range_m)


def draw_points(
    class_map: ClassMap,
    depth_m: Floats32,
    camera: CameraModel,
    generator: np.random.Generator,
    config: PointConfig | None = None,
) -> MeasuredPoints:
    """Sample points of one image, uniformly over its pixels.

    Args:
        class_map: exact class map.
        depth_m: (H, W) exact depth along the optical axis.
        camera: intrinsics at that size.
        generator: random generator of the points.
        config: which points are sampled.

    Raises:
        ShapeError: the sizes differ.
    """
    config, ids, roles = config or PointConfig(), class_map.ids, class_map.roles
    size = (camera.height_px, camera.width_px)
    for name, array in (("class map", ids), ("depth map", depth_m)):
        if array.shape != size:
            expected = f"{size[0]}x{size[1]}, as the camera"
            raise ShapeError(name, expected=expected, actual=array.shape)
    range_m = depth_m * ray_lengths(camera)
    square = np.ones((2 * config.inset_px + 1, 2 * config.inset_px + 1), dtype=np.uint8)
    inner = cv2.erode(ids, square) == cv2.dilate(ids, square)
    inner &= (range_m >= config.min_range_m) & (range_m <= config.max_range_m)
    chosen = []
    for role in (OBSTACLE, GROUND):
        places = np.flatnonzero(inner & (roles == role))
        chosen.append(generator.choice(places, size=min(config.each, places.size), replace=False))
    rows, columns = np.divmod(np.concatenate(chosen), ids.shape[1])
    return MeasuredPoints(
        pixels=np.stack([columns, rows], axis=1),
        range_m=range_m[rows, columns].astype(np.float64),
        obstacle=roles[rows, columns] == OBSTACLE,
    )


def ranges_at(
    depth_m: Floats32, points: MeasuredPoints, camera: CameraModel
) -> NDArray[np.float64]:
    """Return the points' ranges from a depth map, (N,) metres; NaN where unknown."""
    columns, rows = points.pixels.T
    return np.asarray((depth_m * ray_lengths(camera))[rows, columns], dtype=np.float64)
