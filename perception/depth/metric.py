"""Metric depth of a frame: a network's scaled relative depth, ground contact, or both."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from perception.camera.ground_plane import GroundPlane, view_of
from perception.depth.confidence import Confidence, Measure, flow_measure, ground_confidence
from perception.depth.contact.base import Remembered
from perception.depth.contact.depth import ContactDepth, ContactEstimation
from perception.depth.scale import AdaptiveScale, Scale, ScaleEstimator, resized, sample_ground
from uav_bt.errors import UnknownNameError
from uav_bt.protocols import DepthEstimator
from uav_bt.types import CameraModel, ClassMap, DepthMap, DroneState, Frame, NearObstacles, Pose2D
from uav_bt.types.arrays import Image
from uav_bt.types.dead_reckoning import MotionEstimate

SOURCES: Final = ("network", "contact", "fused")
LEAST_CONFIDENCE: Final = 0.2
"""Least confidence of a scale that is used. Of lower ones seven of ten or fewer are right."""
MAX_DEPTH_M: Final = 20.0
"""Larger than any lab; limits the depth of a network's sky."""

_BLACK: Final = 8.0  # a frame with a mean below this, of 255, is black
_CHECKED_PX: Final = 8  # step in rows and columns between the pixels of that mean
_MOVING_MPS: Final = 0.2  # above this speed two equal images mean a frozen video
_ASPECT_SLACK: Final = 0.01  # relative; 640x360 and 854x480 are both 16:9, others are cropped
_LEAST_HEIGHT_M: Final = 0.15  # a lower drone stands, its camera is too near to the ground
# `fused` depth needs the network if the farthest possible point of an obstacle of unknown depth is
# within these distances of the lens, to either side and below. On the validation scenes the
# corridor then misses 27 instead of 24 of the intruded images (`uav-bt net evaluate depth --scene
# val-a --scene val-b`, methods flown and fused).
_ASIDE_M: Final = 1.0
_BELOW_M: Final = 1.4
_STRAY_PX: Final = 4  # fewer pixels of unknown depth are noise of the class map
_NO_NETWORK: Final = Confidence(reason="the depth is by ground contact, without the network")


@dataclass(frozen=True, kw_only=True)
class MetricDepth:
    """Metric depth, or the reason for missing or partial depth."""

    depth: DepthMap | None
    # That the ground is seen as such, of the scale of the network's depth, and of the depth.
    confidences: Mapping[str, Confidence]  # `ground`, `scale` and `depth`
    refusal: str = ""  # for the status line and the records; depth by ground contact may remain
    scale: Scale | None = None  # of the network's depth; None if no network depth was used
    relative: DepthMap | None = None  # the network's relative depth, if the network ran here

    @classmethod
    def refused(cls, refusal: str, relative: DepthMap | None = None) -> MetricDepth:
        """Return no depth, for a reason."""
        none = dict.fromkeys(("ground", "scale", "depth"), Confidence(reason=refusal))
        return cls(depth=None, refusal=refusal, relative=relative, confidences=none)

    def limited(self, name: str, by: Measure) -> MetricDepth:
        """Return it with a further measure, which neither ground nor depth can exceed."""
        about = {key: self.confidences[key].limited(name, by) for key in ("ground", "depth")}
        depth = self.depth
        if depth is not None:
            depth = replace(depth, confidence=about["depth"].value or 0.0)
        return replace(self, depth=depth, confidences={**self.confidences, **about})


class MetricDepthMaker:
    """Makes metric depth frame by frame, from the class map, telemetry and a network.

    Args:
        network: frame in, relative depth out, at any size; None for depth by ground contact alone.
        source: ``network`` (relative depth times scale), ``contact`` (masks and geometry, NaN where
            these give no depth) or ``fused``: ``contact`` where it is known, otherwise the network,
            limited by the upper bound of ``contact``. In ``contact`` depth, the network then gives
            the height of a roof if the base of its box is out of sight.
        scale: estimator of the scale of the network's depth; None for `AdaptiveScale`.
        generator: samples the ground's pixels.
        least_confidence: of a scale that is used.
        network_ahead_m: ``fused`` runs the network if an obstacle of unknown depth may be nearer
            than this; `MAX_DEPTH_M` always runs it.
        mark_height_m: height of the landing mark's top above the ground.
        timer: wall clock of the stages' times, seconds.

    Raises:
        UnknownNameError: the source is unknown.
    """

    def __init__(
        self,
        network: DepthEstimator | None,
        *,
        source: str = "fused",
        scale: ScaleEstimator | None = None,
        generator: np.random.Generator,
        least_confidence: float = LEAST_CONFIDENCE,
        network_ahead_m: float = MAX_DEPTH_M,
        mark_height_m: float | None = None,
        timer: Callable[[], float] = time.perf_counter,
    ) -> None:
        if source not in SOURCES:
            raise UnknownNameError("depth source", source, SOURCES)
        self._network, self._source, self._generator = network, source, generator
        self._scale = AdaptiveScale() if scale is None else scale
        self._least_confidence, self._ahead_m = least_confidence, network_ahead_m
        self._mark_height_m, self._timer = mark_height_m, timer
        self._last_image: Image | None = None

    def make(
        self,
        frame: Frame,
        class_map: ClassMap,
        camera: CameraModel,
        *,
        state: DroneState | None = None,
        near: NearObstacles | None = None,
        motion: MotionEstimate | None = None,
        spent: Callable[[str, float], object] = lambda *_: None,
    ) -> MetricDepth:
        """Return the metric depth of a new frame, at the class map's size.

        Args:
            frame: its telemetry gives the ground plane.
            class_map: class map of that frame.
            camera: intrinsics at any size of the frame's aspect ratio.
            state: the newest telemetry, if there is any.
            near: obstacles near the drone, from the body's centre at the pose of `motion`.
            motion: the drone's pose now and at this frame. Without it, or with one of another
                frame, no remembered obstacle is used.
            spent: called with the name of a stage, `relative_depth` if the network ran and
                `metric_depth`, and its wall time in seconds.

        Raises:
            AnswerError: the network's output cannot be used.
        """
        refusal = self._frozen(frame, state) or _refusal(frame, class_map, camera)
        if refusal:
            return MetricDepth.refused(refusal)
        remembered = None
        if near is not None and motion is not None and motion.seen.time_s == frame.captured_s:
            remembered = remembered_bases(near, motion.pose, motion.seen, frame, camera)
        began_s, network_s = self._timer(), 0.0
        height_px, width_px = class_map.ids.shape
        ground = GroundPlane.of(view_of(frame, camera, (width_px, height_px)))
        contact, metric = None, None
        if self._source != "network":
            contact = ContactEstimation(class_map, ground, remembered, self._mark_height_m)
            known = contact.result()
            if self._source == "contact" or self._suffices(known, class_map, ground):
                metric = _without_scale(known, frame.captured_s, "", _NO_NETWORK)
        if metric is None:
            relative = None
            if self._network is not None:
                asked_s = self._timer()
                relative = self._network.estimate(frame)
                network_s = self._timer() - asked_s
                spent("relative_depth", network_s)
            metric = self._by_network(relative, class_map, ground, contact)
        spent("metric_depth", self._timer() - began_s - network_s)
        if motion is None or motion.stretch is None:
            return metric
        return metric.limited("flow", flow_measure(motion.stretch))

    def _frozen(self, frame: Frame, state: DroneState | None) -> str:
        """Return a refusal if a moving drone sent the same image again."""
        before, image = self._last_image, frame.image[::_CHECKED_PX, ::_CHECKED_PX].copy()
        self._last_image = image
        if before is None or state is None:
            return ""
        velocity = state.velocity
        speed_mps = math.hypot(velocity.forward_mps, velocity.right_mps, velocity.down_mps)
        still = speed_mps > _MOVING_MPS and np.array_equal(before, image)
        return "the image is frozen" if still else ""

    def _suffices(self, contact: ContactDepth, class_map: ClassMap, ground: GroundPlane) -> bool:
        """Return whether no obstacle of unknown depth may be near the path ahead."""
        if self._ahead_m >= MAX_DEPTH_M:
            return False
        unknown = ~np.isfinite(contact.depth) & class_map.is_above_ground
        forward_m, right_m, down_m = contact.at_most[unknown] * ground.rays[:, unknown]
        near = (forward_m < self._ahead_m) & (np.abs(right_m) < _ASIDE_M) & (down_m < _BELOW_M)
        return int(np.count_nonzero(near)) <= _STRAY_PX

    def _by_network(
        self,
        relative: DepthMap | None,
        class_map: ClassMap,
        ground: GroundPlane,
        contact: ContactEstimation | None,
    ) -> MetricDepth:
        """Return a network's depth, completed and bounded by contact if there is any."""
        if relative is None or relative.captured_s != class_map.captured_s:
            return MetricDepth.refused("no relative depth of this frame", relative)
        if not np.isfinite(relative.depth).all():
            return MetricDepth.refused("relative depth is not finite", relative)
        fitting = resized(relative.depth, class_map.ids.shape)
        sample = sample_ground(fitting, class_map.is_ground, ground.depth_m, self._generator)
        on_ground = Confidence(reason="too little ground")
        if sample is not None:
            on_ground = ground_confidence(sample.measures)
        height_m = ground.view.height_m if relative.in_heights else None
        scale = self._scale(sample, relative.captured_s, height_m)
        why = "too little ground" if sample is None else "the ground disagrees with itself"
        of_scale = Confidence(reason=why) if scale is None else scale.confidence
        sure, known = of_scale.value or 0.0, None
        if scale is None or sure < self._least_confidence:
            known = None if contact is None else contact.result()
            refusal = f"no scale: {of_scale.reason}"
            without = _without_scale(known, relative.captured_s, refusal, of_scale, on_ground)
            return replace(without, relative=relative)
        metres = np.float32(scale.factor) * fitting + np.float32(scale.shift_m)
        metres = np.clip(metres, 0.0, MAX_DEPTH_M)
        if contact is not None:
            contact.complete(metres)
            known = contact.result()
            metres = np.where(np.isfinite(known.depth), known.depth, metres)
            metres = np.minimum(metres, known.at_most)
        depth = DepthMap(
            depth=np.asarray(metres, dtype=np.float32),
            metric=True,
            captured_s=relative.captured_s,
            confidence=sure,
            at_most=None if known is None else known.at_most,
        )
        of_depth = Confidence(sure, of_scale.reason)
        confidences = {"ground": on_ground, "scale": of_scale, "depth": of_depth}
        return MetricDepth(depth=depth, scale=scale, relative=relative, confidences=confidences)


def _refusal(frame: Frame, class_map: ClassMap, camera: CameraModel) -> str:
    height_px, width_px = frame.image.shape[:2]
    stretch = (width_px * camera.height_px) / (height_px * camera.width_px)
    if abs(stretch - 1.0) > _ASPECT_SLACK:
        size = f"{camera.width_px}x{camera.height_px}"
        return f"the frame is {width_px}x{height_px}, its camera {size}: another aspect"
    height_m, pitch_rad = frame.height_above_ground_m, frame.gimbal_pitch_rad
    if not all(map(math.isfinite, (height_m, pitch_rad, frame.attitude.pitch_rad))):
        return "telemetry is not finite"
    lens_m = height_m + camera.forward_offset_m * math.sin(frame.attitude.pitch_rad)
    if height_m < _LEAST_HEIGHT_M or not lens_m > 0.0:
        return "no height above the ground"
    if frame.image[::_CHECKED_PX, ::_CHECKED_PX].mean() < _BLACK:
        return "the frame is black"
    if class_map.captured_s != frame.captured_s:
        return "the class map is of another frame"
    return ""


def remembered_bases(
    near: NearObstacles, now: Pose2D, then: Pose2D, frame: Frame, camera: CameraModel
) -> Remembered:
    """Return obstacles near the drone, from the lens at a frame's capture.

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


def _without_scale(
    contact: ContactDepth | None,
    captured_s: float,
    refusal: str,
    scale: Confidence,
    ground: Confidence | None = None,
) -> MetricDepth:
    """Return the depth by ground contact; None instead of an empty map, which would mean free."""
    confidences = {"ground": ground or Confidence(reason=scale.reason), "scale": scale}
    if contact is None or not np.isfinite(contact.depth).any():
        refusal = refusal or "nothing in view stands on ground"
        confidences["depth"] = Confidence(reason=refusal)
        return MetricDepth(depth=None, refusal=refusal, confidences=confidences)
    depth = DepthMap(
        depth=contact.depth,
        metric=True,
        captured_s=captured_s,
        confidence=contact.known_share,
        at_most=contact.at_most,
    )
    confidences["depth"] = Confidence(contact.known_share, refusal)
    return MetricDepth(depth=depth, refusal=refusal, confidences=confidences)
