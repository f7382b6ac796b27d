"""Metric depth of a frame: a network's scaled relative depth, ground contact, or both."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Final, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera.ground_plane import CameraView, GroundPlane, view_of
from perception.depth.confidence import Confidence, Confidences
from perception.depth.contact.contacts import Remembered
from perception.depth.contact.depth import ContactDepth, ContactDepthConfig, ContactEstimation
from perception.depth.evidence import ground_confidence
from perception.depth.scale import (
    AdaptiveScale,
    Scale,
    ScaleConfig,
    ScaleEstimator,
    sample_ground,
)
from uav_bt.errors import UnknownNameError
from uav_bt.types import (
    CameraModel,
    ClassMap,
    DepthMap,
    Frame,
    NearObstacles,
    Pose2D,
)

Source = Literal["network", "contact", "fused"]
SOURCES: Final[tuple[Source, ...]] = ("network", "contact", "fused")
LEAST_CONFIDENCE: Final = 0.2
"""Least confidence of a scale that is used. Of lower ones seven of ten or fewer are right."""
_NO_NETWORK: Final = "the depth is by ground contact, without the network"


@dataclass(frozen=True, kw_only=True)
class MetricDepthConfig:
    """Which frames are refused, and limits of the depth."""

    black_level: float = 8.0  # a frame with a mean below this, of 255, is black
    checked_px: int = 8  # step in rows and columns between the pixels of that mean
    min_height_m: float = 0.15  # a lower drone stands, and its camera is too near to the ground
    max_m: float = 20.0  # larger than any lab; limits the depth of a network's sky
    roll_rad: float = 0.0  # known roll of the image that the gimbal leaves, right side down
    least_confidence: float = LEAST_CONFIDENCE
    # `fused` depth needs the network if the farthest possible point of an obstacle of unknown depth
    # is within these distances of the lens: ahead, to either side, and below. `max_m` ahead always
    # runs it. On the validation scenes the corridor then misses 27 instead of 24 of the intruded
    # images (`uav-bt net evaluate depth --scene val-a --scene val-b`, methods flown and fused).
    network_ahead_m: float = 20.0
    network_aside_m: float = 1.0
    network_below_m: float = 1.4
    stray_px: int = 4  # fewer pixels of unknown depth are noise of the class map
    sampling: ScaleConfig = field(default_factory=ScaleConfig)
    contact: ContactDepthConfig = field(default_factory=ContactDepthConfig)


@dataclass(frozen=True, kw_only=True)
class MetricDepth:
    """Metric depth, or the reason for missing or partial depth."""

    depth: DepthMap | None
    refusal: str = ""  # for the status line and the records; depth by ground contact may remain
    scale: Scale | None = None  # of the network's depth; None if no network depth was used
    relative: DepthMap | None = None  # the network's relative depth, if the network ran here
    confidences: Confidences = field(default_factory=Confidences)

    @classmethod
    def refused(cls, refusal: str, relative: DepthMap | None = None) -> MetricDepth:
        """Return no depth, for a reason."""
        none = Confidences.none(refusal)
        return cls(depth=None, refusal=refusal, relative=relative, confidences=none)

    def limited(self, name: str, by: Confidence) -> MetricDepth:
        """Return it with a further measure, which the confidence of the depth cannot exceed."""
        confidences, depth = self.confidences.limited(name, by), self.depth
        if depth is not None:
            depth = replace(depth, confidence=confidences.depth.value or 0.0)
        return replace(self, depth=depth, confidences=confidences)


class MetricDepthMaker:
    """Makes metric depth from a frame's class map, telemetry and relative depth.

    Args:
        source: ``network`` (relative depth times scale), ``contact`` (masks and geometry, NaN where
            these give no depth) or ``fused``: ``contact`` where it is known, otherwise the network,
            limited by the upper bound of ``contact``. In ``contact`` depth, the network then gives
            the height of a roof if the base of its box is out of sight.
        scale: estimator of the scale of the network's depth; None for `AdaptiveScale`.
        generator: samples the ground's pixels.
        config: which frames are refused.

    Raises:
        UnknownNameError: the source is unknown.
    """

    def __init__(
        self,
        *,
        source: str = "fused",
        scale: ScaleEstimator | None = None,
        generator: np.random.Generator,
        config: MetricDepthConfig | None = None,
    ) -> None:
        if source not in SOURCES:
            raise UnknownNameError("depth source", source, SOURCES)
        self._source = source
        self._config = config or MetricDepthConfig()
        self._scale = AdaptiveScale() if scale is None else scale
        self._generator = generator

    def restart(self) -> None:
        """Forget the scale of earlier frames; the next one shows another place."""
        self._scale.restart()

    def make(
        self,
        frame: Frame,
        class_map: ClassMap,
        camera: CameraModel,
        relative: DepthMap | Callable[[], DepthMap] | None = None,
        remembered: Remembered | None = None,
    ) -> MetricDepth:
        """Return the metric depth of a frame, at the class map's size.

        Args:
            frame: its telemetry gives the ground plane.
            class_map: class map of that frame.
            camera: intrinsics, at any size.
            relative: the network's depth of that frame, at any size, or a function that returns
                it. The function is called if the depth is needed; ``contact`` never needs it.
            remembered: obstacles' bases seen earlier, for bases now out of view.
        """
        refusal = self._refusal(frame, class_map)
        if refusal:
            return MetricDepth.refused(refusal)
        height_px, width_px = class_map.ids.shape
        view = view_of(frame, camera, (width_px, height_px), roll_rad=self._config.roll_rad)
        if not view.height_m > 0.0:
            return MetricDepth.refused("no height above the ground")
        ground, captured_s = GroundPlane.of(view), frame.captured_s
        contact = None
        if self._source != "network":
            contact = ContactEstimation(class_map, ground, self._config.contact, remembered)
            measured = contact.result()
            if self._source == "contact" or self._suffices(measured, class_map, ground):
                return _contact_only(measured, captured_s, "", Confidence(reason=_NO_NETWORK))
        relative = relative() if callable(relative) else relative
        refusal = _relative_refusal(frame, relative)
        if refusal or relative is None:
            return MetricDepth.refused(refusal, relative)
        scale, of_scale, on_ground = self._scale_of(relative, class_map, ground)
        if scale is None:
            known = None if contact is None else contact.result()
            refusal = f"no scale: {of_scale.reason}"
            without = _contact_only(known, captured_s, refusal, of_scale, on_ground)
            return replace(without, relative=relative)
        metres = scale.apply(_resized(relative.depth, view))
        network_m = np.clip(metres, 0.0, self._config.max_m)
        if contact is not None:
            contact.complete(network_m)
        known = None if contact is None else contact.result()
        depth = _fused(scale, network_m, known, captured_s)
        confidences = Confidences(
            ground=on_ground,
            scale=of_scale,
            depth=Confidence(value=depth.confidence, reason=of_scale.reason),
        )
        return MetricDepth(depth=depth, scale=scale, relative=relative, confidences=confidences)

    def _suffices(self, contact: ContactDepth, class_map: ClassMap, ground: GroundPlane) -> bool:
        """Return whether no obstacle of unknown depth may be near the path ahead."""
        ahead_m, aside_m = self._config.network_ahead_m, self._config.network_aside_m
        if ahead_m >= self._config.max_m:
            return False
        unknown = ~np.isfinite(contact.depth) & class_map.is_above_ground
        forward_m, right_m, down_m = contact.at_most[unknown] * ground.rays[:, unknown]
        near = (forward_m < ahead_m) & (np.abs(right_m) < aside_m)
        near &= down_m < self._config.network_below_m
        return int(np.count_nonzero(near)) <= self._config.stray_px

    def _scale_of(
        self, relative: DepthMap, class_map: ClassMap, ground: GroundPlane
    ) -> tuple[Scale | None, Confidence, Confidence]:
        """Return the scale of a network's depth if it is trusted, its confidence, the ground's."""
        fitting, sampling = _resized(relative.depth, ground.view), self._config.sampling
        sample = sample_ground(
            fitting, class_map.is_ground, ground.depth_m, self._generator, sampling
        )
        on_ground = Confidence(reason="too little ground")
        if sample is not None:
            on_ground = ground_confidence(sample.measures)
        height_m = ground.view.height_m if relative.in_heights else None
        scale = self._scale.update(sample, class_map.captured_s, height_m)
        if scale is None:
            why = "too little ground" if sample is None else "the ground disagrees with itself"
            return None, Confidence(reason=why), on_ground
        confidence = scale.why or Confidence(value=scale.confidence)
        trusted = scale.confidence >= self._config.least_confidence
        return scale if trusted else None, confidence, on_ground

    def _refusal(self, frame: Frame, class_map: ClassMap) -> str:
        height_m, pitch_rad = frame.height_above_ground_m, frame.gimbal_pitch_rad
        finite = map(math.isfinite, (height_m, pitch_rad, frame.attitude.pitch_rad))
        if not all(finite):
            return "telemetry is not finite"
        if height_m < self._config.min_height_m:
            return "no height above the ground"
        every = self._config.checked_px
        if frame.image[::every, ::every].mean() < self._config.black_level:
            return "the frame is black"
        if class_map.captured_s != frame.captured_s:
            return "the class map is of another frame"
        return ""


def remembered_bases(
    near: NearObstacles, now: Pose2D, then: Pose2D, frame: Frame, camera: CameraModel
) -> Remembered:
    """Return remembered obstacles relative to the lens at a frame's capture.

    Args:
        near: obstacles from the body's centre at the pose `now`.
        now: dead-reckoned pose of the newest telemetry, which is newer than the frame.
        then: dead-reckoned pose at the frame's capture.
        frame: the frame.
        camera: gives the position of the lens.
    """
    then_m = then.points_to_body(now.points_to_world(near.points_m))
    lever_m = camera.forward_offset_m * math.cos(frame.attitude.pitch_rad)
    return Remembered.at(then_m - (lever_m, 0.0))


def _relative_refusal(frame: Frame, relative: DepthMap | None) -> str:
    if relative is None or relative.captured_s != frame.captured_s:
        return "no relative depth of this frame"
    return "" if np.isfinite(relative.depth).all() else "relative depth is not finite"


def _contact_only(
    contact: ContactDepth | None,
    captured_s: float,
    refusal: str,
    scale: Confidence,
    ground: Confidence | None = None,
) -> MetricDepth:
    """Return the depth by ground contact; None instead of an empty map, which would mean free."""
    confidences = Confidences(ground=ground or Confidence(reason=scale.reason), scale=scale)
    if contact is None or not np.isfinite(contact.depth).any():
        refusal = refusal or "nothing in view stands on ground"
        confidences = replace(confidences, depth=Confidence(reason=refusal))
        return MetricDepth(depth=None, refusal=refusal, confidences=confidences)
    known = DepthMap(
        depth=contact.depth,
        metric=True,
        captured_s=captured_s,
        confidence=contact.known_share,
        at_most=contact.at_most,
    )
    confidences = replace(confidences, depth=Confidence(value=known.confidence, reason=refusal))
    return MetricDepth(depth=known, refusal=refusal, confidences=confidences)


def _fused(
    scale: Scale,
    network_m: NDArray[np.float32],
    contact: ContactDepth | None,
    captured_s: float,
) -> DepthMap:
    metres = network_m
    if contact is not None:
        metres = np.where(np.isfinite(contact.depth), contact.depth, metres)
        metres = np.minimum(metres, contact.at_most)
    return DepthMap(
        depth=np.asarray(metres, dtype=np.float32),
        metric=True,
        captured_s=captured_s,
        confidence=scale.confidence,
        at_most=None if contact is None else contact.at_most,
    )


def _resized(depth: NDArray[np.float32], view: CameraView) -> NDArray[np.float32]:
    size = (view.camera.width_px, view.camera.height_px)
    if depth.shape[::-1] == size:
        return depth
    return np.asarray(cv2.resize(depth, size, interpolation=cv2.INTER_LINEAR), dtype=np.float32)
