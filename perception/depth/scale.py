"""From relative depth to metres: the paper's adaptive scale (equations 4 to 9).

A network trained without ground truth gives depth in an unknown unit. The ground is a plane at a
known distance (`perception.camera.ground_plane`), so each ground pixel gives the unit in metres.
The scale of a frame is the median ratio of 50 random ground pixels. A Kalman filter that rejects
outliers smooths it over time. The filter's state is the logarithm of the scale, because the errors
are relative: a network that underestimates depth by a tenth does so at all ranges.

Both depths of a ratio are along the optical axis. The paper compares network depth with Euclidean
range, which is wrong by 1/cos of the angle to the axis, up to a fifth in the corners of our image.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import cv2
import numpy as np
from filterpy.kalman import KalmanFilter

from perception.depth.confidence import Confidence, GroundMeasures, evidence, scale_confidence
from uav_bt.types.arrays import Flags, Floats32

_POINTS: Final = 50  # ground pixels per frame; the paper's compromise of time and noise
_LEAST_POINTS: Final = 20  # with fewer inner ground pixels a frame gives no scale
# Distance to the ground's border, where mask and depth are least accurate: the paper's 10 of 256
# rows, as a share of the map's height.
_MARGIN: Final = 10.0 / 256.0
_MAX_RANGE_M: Final = 6.0  # of ground pixels; beyond the lab one row spans metres

# The filter's noise, relative to the scale (0.01 is one percent).
_WANDER_STD: Final = 0.05  # per square root of a second: the network's unit varies with content
_FLOOR_STD: Final = 0.01  # of a measurement: errors of height and pitch affect all points alike
_GATE: Final = 10.8  # squared innovation over its variance: chi-square, 1 dof, 99.9 %
_REJECTIONS: Final = 5  # after this number of outliers in a row the filter restarts
_LOST_STD: Final = 0.15  # above this the scale is lost: an error of 0.15 m per metre

_SURE: Final = Confidence(1.0)


@dataclass(frozen=True, kw_only=True)
class Scale:
    """Conversion of relative depth to metres: ``factor * relative + shift_m``."""

    factor: float  # metres per unit of relative depth, positive
    shift_m: float = 0.0
    confidence: Confidence = _SURE


@dataclass(frozen=True, kw_only=True)
class GroundSample:
    """Depths of N ground pixels along the optical axis."""

    known_m: Floats32  # (N,) of the ground plane
    predicted: Floats32  # (N,) by the network, in its unit
    # Usable ground over all pixels whose rays meet the plane of the ground within range.
    share: float = 1.0

    @cached_property
    def measures(self) -> GroundMeasures:
        """Median ratio of known to predicted depth, and measures of its quality."""
        return GroundMeasures.of(self.known_m, self.predicted, self.share)


def resized(depth: Floats32, shape: tuple[int, ...]) -> Floats32:
    """Return depth at another size, (H, W)."""
    if depth.shape == shape:
        return depth
    return np.asarray(cv2.resize(depth, shape[::-1]), dtype=np.float32)


def sample_ground(
    relative: Floats32,
    is_ground: Flags,
    ground_m: Floats32,
    generator: np.random.Generator,
    max_range_m: float = _MAX_RANGE_M,
) -> GroundSample | None:
    """Sample ground pixels away from the ground's border, without replacement.

    Args:
        relative: (H, W) relative depth along the optical axis.
        is_ground: (H, W) whether a pixel shows the ground.
        ground_m: (H, W) depth of the ground plane; NaN where a ray does not meet it.
        generator: samples the pixels.
        max_range_m: largest depth of a pixel.

    Returns:
        The sample, or None if too little ground is in view.
    """
    reach = max(1, round(_MARGIN * is_ground.shape[0]))
    # The image's edge is not a border of the ground.
    padded = cv2.copyMakeBorder(
        is_ground.astype(np.uint8), reach, reach, reach, reach, cv2.BORDER_REPLICATE
    )
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    inner = cv2.erode(padded, kernel)[reach:-reach, reach:-reach]
    with np.errstate(invalid="ignore"):
        near = ground_m <= max_range_m
        places = np.flatnonzero((inner > 0) & near & (relative > 0.0))
    if places.size < _LEAST_POINTS:
        return None
    chosen = generator.choice(places, size=min(_POINTS, places.size), replace=False)
    return GroundSample(
        known_m=ground_m.ravel()[chosen],
        predicted=relative.ravel()[chosen].astype(np.float32),
        share=places.size / int(np.count_nonzero(near)),
    )


ScaleEstimator = Callable[[GroundSample | None, float, float | None], Scale | None]
"""Returns the scale after a frame, from its ground, None with too little, its capture time, and the
height of the camera above the ground, m, if the depth is in such heights."""


class AdaptiveScale:
    """The paper's adaptive scale: each frame's median ratio, smoothed over time."""

    def __init__(self) -> None:
        self._filter = ScaleFilter()
        self._measured = 0.0  # confidence of the last frame that entered the filter

    def __call__(
        self, sample: GroundSample | None, captured_s: float, height_m: float | None = None
    ) -> Scale | None:
        """Return the smoothed scale; without ground the last one, until it is too uncertain."""
        why, carried = None, "no ground in this frame: the scale is that of earlier frames"
        if sample is not None:
            measures, before = sample.measures, self._filter.at(captured_s)
            if self._filter.update(measures.log_scale, measures.std, captured_s):
                innovation = None if before is None else measures.log_scale - before[0]
                why = scale_confidence(evidence(measures, innovation, height_m))
                self._measured = why.value or 0.0
            carried = "the scale is that of earlier frames, with which this one disagrees"
        state = self._filter.at(captured_s)
        if state is None:
            return None
        log_factor, certainty = state
        if why is None:  # the confidence follows from the filter, and is lower
            why = Confidence(min(0.5, self._measured) * certainty, carried)
        return Scale(factor=math.exp(log_factor), confidence=why)


class ScaleFilter:
    """A Kalman filter over the logarithm of the scale."""

    def __init__(self) -> None:
        self._filter: KalmanFilter | None = None
        self._time_s = -math.inf
        self._rejected = 0

    def update(self, log_scale: float, std: float, captured_s: float) -> bool:
        """Update the filter with a measurement; False if it was rejected as an outlier."""
        noise = std**2 + _FLOOR_STD**2
        self._predict(captured_s)
        kalman = self._filter
        if kalman is None or self._rejected >= _REJECTIONS:
            kalman = self._filter = KalmanFilter(dim_x=1, dim_z=1)
            kalman.x, kalman.P = np.array([[log_scale]]), np.array([[noise]])
            kalman.H = kalman.F = np.eye(1)
            self._time_s = max(self._time_s, captured_s)
        else:
            innovation = log_scale - float(kalman.x[0, 0])
            if innovation**2 / (float(kalman.P[0, 0]) + noise) > _GATE:
                self._rejected += 1
                return False
            kalman.update(np.array([[log_scale]]), R=noise)
        self._rejected = 0
        return True

    def at(self, time_s: float) -> tuple[float, float] | None:
        """Return the logarithm of the scale at a time, and its certainty, 0 to 1.

        None before the first measurement, and when the scale has become too uncertain.
        """
        self._predict(time_s)
        if self._filter is None:
            return None
        std = math.sqrt(self._filter.P[0, 0])
        return None if std > _LOST_STD else (float(self._filter.x[0, 0]), 1.0 - std / _LOST_STD)

    def _predict(self, time_s: float) -> None:
        if self._filter is not None and time_s > self._time_s:
            self._filter.predict(Q=_WANDER_STD**2 * (time_s - self._time_s))
            self._time_s = time_s
