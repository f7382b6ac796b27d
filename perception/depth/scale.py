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
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import cv2
import numpy as np
from filterpy.kalman import KalmanFilter
from numpy.typing import NDArray

from perception.depth.confidence import Confidence
from perception.depth.evidence import GroundMeasures, evidence, scale_confidence
from uav_bt.errors import ShapeError, ValueRangeError
from uav_bt.types.arrays import Flags, Floats32


@dataclass(frozen=True, kw_only=True)
class Scale:
    """Conversion of relative depth to metres: ``factor * relative + shift_m``."""

    factor: float  # metres per unit of relative depth, positive
    shift_m: float = 0.0
    confidence: float = 1.0  # 0 to 1
    why: Confidence | None = None  # that confidence with its measures

    def apply(self, relative: Floats32) -> Floats32:
        """Return metres, (H, W) float32, of relative depth."""
        return np.asarray(np.float32(self.factor) * relative + np.float32(self.shift_m))


@dataclass(frozen=True, kw_only=True)
class ScaleConfig:
    """How the ground is sampled, and how much of it is needed."""

    points: int = 50  # ground pixels per frame; the paper's compromise of time and noise
    # Distance to the ground's border, where mask and depth are least accurate: the paper's 10 of
    # 256 rows, as a share of the map's height.
    margin_share: float = 10.0 / 256.0
    min_points: int = 20  # with fewer inner ground pixels a frame gives no scale
    max_range_m: float = 6.0  # of ground pixels; beyond the lab one row spans metres

    def __post_init__(self) -> None:
        if self.points < 1 or not 1 <= self.min_points <= self.points:
            raise ValueRangeError(
                "a scale needs at least one point, and cannot ask for more than it samples: got "
                f"points = {self.points}, min_points = {self.min_points}"
            )


@dataclass(frozen=True, kw_only=True)
class GroundSample:
    """Ground pixels with both depths."""

    pixels: NDArray[np.intp]  # (N, 2) column, row
    known_m: Floats32  # (N,) along the optical axis, from the ground plane
    predicted: Floats32  # (N,) along the optical axis, in the network's unit
    # Usable ground over all pixels whose rays meet the plane of the ground within range.
    share: float = 1.0

    def __len__(self) -> int:
        return len(self.known_m)

    @cached_property
    def measures(self) -> GroundMeasures:
        """Median ratio of known to predicted depth, and measures of its quality."""
        return GroundMeasures.of(self.known_m, self.predicted, self.share)


def sample_ground(
    relative: Floats32,
    is_ground: Flags,
    ground_m: Floats32,
    generator: np.random.Generator,
    config: ScaleConfig | None = None,
) -> GroundSample | None:
    """Sample ground pixels away from the ground's border.

    Args:
        relative: (H, W) relative depth along the optical axis.
        is_ground: (H, W) whether a pixel shows the ground.
        ground_m: (H, W) depth of the ground plane, metres; NaN where a ray does not meet it.
        generator: samples the pixels, without replacement.
        config: number of pixels and distance from the border.

    Returns:
        The sample, or None if too little ground is in view.

    Raises:
        ShapeError: the sizes differ.
    """
    config = config or ScaleConfig()
    if relative.shape != is_ground.shape:
        expected = f"{is_ground.shape[0]}x{is_ground.shape[1]}, as the class map"
        raise ShapeError("relative depth", expected=expected, actual=relative.shape)
    if ground_m.shape != is_ground.shape:
        expected = f"{is_ground.shape[0]}x{is_ground.shape[1]}, as the class map"
        raise ShapeError("depth of the ground", expected=expected, actual=ground_m.shape)
    reach = max(1, round(config.margin_share * is_ground.shape[0]))
    # The image's edge is not a border of the ground.
    padded = cv2.copyMakeBorder(
        is_ground.astype(np.uint8), reach, reach, reach, reach, cv2.BORDER_REPLICATE
    )
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    inner = cv2.erode(padded, kernel)[reach:-reach, reach:-reach]
    with np.errstate(invalid="ignore"):
        near = ground_m <= config.max_range_m
        usable = (inner > 0) & near & (relative > 0.0)
    places = np.flatnonzero(usable)
    if places.size < config.min_points:
        return None
    chosen = generator.choice(places, size=min(config.points, places.size), replace=False)
    rows, columns = np.divmod(chosen, is_ground.shape[1])
    return GroundSample(
        pixels=np.stack([columns, rows], axis=-1),
        known_m=ground_m[rows, columns],
        predicted=relative[rows, columns].astype(np.float32),
        share=places.size / int(np.count_nonzero(near)),
    )


# --- estimators -----------------------------------------------------------------------------------


class ScaleEstimator(Protocol):
    """Estimates the scale of each frame from its ground."""

    def update(
        self, sample: GroundSample | None, captured_s: float, height_m: float | None = None
    ) -> Scale | None:
        """Process a frame's ground and return the scale, or None.

        Args:
            sample: the ground; None: too little of it.
            captured_s: time of the frame.
            height_m: height of the camera above the ground, if the depth is in such heights.
        """
        ...

    def restart(self) -> None:
        """Forget the scale of earlier frames; the next one shows another place."""
        ...


class AdaptiveScale:
    """The paper's adaptive scale: each frame's median ratio, smoothed over time."""

    def __init__(self) -> None:
        self._filter = ScaleFilter()
        self._measured = 0.0  # confidence of the last frame that entered the filter

    def restart(self) -> None:
        """Forget the scale of earlier frames."""
        self._filter.restart()

    def update(
        self, sample: GroundSample | None, captured_s: float, height_m: float | None = None
    ) -> Scale | None:
        """Return the smoothed scale.

        Without ground in view the last scale is used until it is too uncertain.
        """
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
            why = Confidence(value=min(0.5, self._measured) * certainty, reason=carried)
        return Scale(factor=math.exp(log_factor), confidence=why.value or 0.0, why=why)


@dataclass(frozen=True, kw_only=True)
class ScaleFilterConfig:
    """Noise model, relative to the scale (0.01 is one percent)."""

    wander_std: float = 0.05  # per square root of a second: the network's unit varies with content
    floor_std: float = 0.01  # of a measurement: errors of height and pitch affect all points alike
    gate: float = 10.8  # squared innovation over its variance: chi-square, 1 dof, 99.9 %
    rejections_to_restart: int = 5  # after this number of outliers in a row the filter restarts
    lost_std: float = 0.15  # above this the scale is lost: an error of 0.15 m per metre

    def __post_init__(self) -> None:
        stds = (self.wander_std, self.floor_std, self.gate, self.lost_std)
        if not all(math.isfinite(value) and value > 0.0 for value in stds):
            raise ValueRangeError(
                f"the scale filter needs positive standard deviations, got {self}"
            )


class ScaleFilter:
    """A Kalman filter over the logarithm of the scale."""

    def __init__(self, config: ScaleFilterConfig | None = None) -> None:
        self._config = config or ScaleFilterConfig()
        self._filter: KalmanFilter | None = None
        self._time_s = -math.inf
        self._rejected = 0

    def restart(self) -> None:
        """Forget all measurements."""
        self._filter, self._time_s, self._rejected = None, -math.inf, 0

    def update(self, log_scale: float, std: float, captured_s: float) -> bool:
        """Update the filter with a measurement.

        Args:
            log_scale: natural logarithm of the measured scale.
            std: its standard deviation, from the scatter of its points.
            captured_s: its time; an older time than the newest does not turn time back.

        Returns:
            False if the measurement was rejected as an outlier.

        Raises:
            ValueRangeError: a number is not finite.
        """
        if not all(map(math.isfinite, (log_scale, std, captured_s))):
            raise ValueRangeError(
                f"a scale must be finite, got log {log_scale} +- {std} at {captured_s} s"
            )
        noise = std**2 + self._config.floor_std**2
        self._predict(captured_s)
        if self._filter is None or self._rejected >= self._config.rejections_to_restart:
            self._start(log_scale, noise, captured_s)
        elif _surprise(self._filter, log_scale, noise) > self._config.gate:
            self._rejected += 1
            return False
        else:
            self._filter.update(np.array([[log_scale]]), R=noise)
        self._rejected = 0
        return True

    def at(self, time_s: float) -> tuple[float, float] | None:
        """Return the logarithm of the scale and its certainty, 0 to 1, at a time.

        Returns:
            None before the first measurement, and when the scale has become too uncertain.
        """
        self._predict(time_s)
        if self._filter is None:
            return None
        std = math.sqrt(self._filter.P[0, 0])
        if std > self._config.lost_std:
            return None
        return float(self._filter.x[0, 0]), 1.0 - std / self._config.lost_std

    def _predict(self, time_s: float) -> None:
        if self._filter is not None and time_s > self._time_s:
            self._filter.predict(Q=self._config.wander_std**2 * (time_s - self._time_s))
            self._time_s = time_s

    def _start(self, log_scale: float, noise: float, time_s: float) -> None:
        kalman = KalmanFilter(dim_x=1, dim_z=1)
        kalman.x = np.array([[log_scale]])
        kalman.P = np.array([[noise]])
        kalman.H = kalman.F = np.eye(1)
        self._filter, self._time_s = kalman, time_s


def _surprise(kalman: KalmanFilter, log_scale: float, noise: float) -> float:
    innovation = log_scale - float(kalman.x[0, 0])
    return innovation**2 / (float(kalman.P[0, 0]) + noise)
