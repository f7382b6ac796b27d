"""Methods of metric depth to compare, and their depth maps of images."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final, Literal

import cv2
import numpy as np
from numpy.typing import NDArray

from behaviours.perceive.depth import NETWORK_AHEAD_M
from perception.camera.ground_plane import CameraView, ground_depth, view_of
from perception.depth.metric import LEAST_CONFIDENCE, MAX_DEPTH_M, MetricDepthMaker
from perception.depth.scale import GroundSample, Scale
from uav_bt.learning.depth_tables.images import MAP_SIZE_PX, Masks, SampleImage
from uav_bt.types import ClassMap, DepthMap, Frame

# --- the paper's constant scales ------------------------------------------------------------------


class CollectedScale:
    """The two constant scales of the paper, from the medians of all frames until now.

    Args:
        method: ``constant`` uses the median ratio of known to predicted depth; ``least_squares``
            solves ``scale * predicted + shift = known`` (equation 1).
    """

    def __init__(self, method: Literal["constant", "least_squares"]) -> None:
        self._method = method
        self._known: list[float] = []
        self._predicted: list[float] = []

    def __call__(
        self,
        sample: GroundSample | None,
        captured_s: float,
        height_m: float | None = None,  # noqa: ARG002  (the protocol's)
    ) -> Scale | None:
        """Add a frame and return the scale of all frames; None before the first sample."""
        del captured_s  # a constant has no age
        if sample is not None:
            self._known.append(float(np.median(sample.known_m)))
            self._predicted.append(float(np.median(sample.predicted)))
        if not self._known:
            return None
        known, predicted = np.array(self._known), np.array(self._predicted)
        # Similar frames cannot separate scale from shift; the plain ratio is used instead.
        if self._method == "least_squares" and predicted.std() > 1e-3 * predicted.mean():
            factor, shift_m = (float(part) for part in np.polyfit(predicted, known, 1))
            return Scale(factor=factor, shift_m=shift_m) if factor > 0.0 else None
        return Scale(factor=float(np.median(known / predicted)))


# --- the lowest pixel -----------------------------------------------------------------------------


def lowest_pixel_depth(class_map: ClassMap, view: CameraView) -> NDArray[np.float32]:
    """Give each connected object the depth of the ground at its lowest pixel.

    A box and its roof are one object. The depth of the background is unknown.

    Returns:
        (H, W) metres along the optical axis; NaN where unknown.
    """
    ground = ground_depth(view)
    depth = np.where(class_map.is_ground, ground, np.float32(np.nan))
    for thing in _things(class_map):
        rows, columns = np.nonzero(thing)
        lowest = int(rows.max())
        depth[thing] = np.median(ground[lowest, columns[rows == lowest]])
    return depth


def _things(class_map: ClassMap) -> Iterator[NDArray[np.bool_]]:
    """Yield the connected parts of each object with its top, and of the landing mark."""
    ids, classes = class_map.ids, class_map.classes
    sides = [*classes.standing, *([] if classes.mark_sides is None else [classes.mark_sides])]
    for needed in sides:
        top = classes.top_of[needed]
        mask = np.isin(ids, [needed, top] if top else [needed])
        count, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=4)
        for label in range(1, count):
            part = labels == label
            # Two boxes may have the same roof; it belongs to the box with a side below it.
            if np.any(ids[part] == needed):
                yield part


# --- methods --------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class Method:
    """One method of metric depth."""

    name: str
    source: str | None  # source of `MetricDepthMaker`; None: the lowest-pixel baseline
    # Constant scale of all images, which are processed twice; None: the adaptive scale.
    collects: Literal["constant", "least_squares"] | None = None
    # The network is used for images with an unmeasured obstacle that may be nearer than this, m.
    ahead_m: float = MAX_DEPTH_M
    flat: bool = False  # True: a constant depth of one instead of the network
    least_confidence: float = 0.0  # of a scale that is used; the paper's methods use all

    @property
    def needs_network(self) -> bool:
        """Whether the method uses a network's relative depth."""
        return self.source in ("network", "fused") and not self.flat


METHODS: Final = (
    Method(name="constant", source="network", collects="constant"),
    Method(name="least_squares", source="network", collects="least_squares"),
    Method(name="adaptive", source="network"),
    Method(name="fused", source="fused", least_confidence=LEAST_CONFIDENCE),
    Method(
        name="flown",
        source="fused",
        ahead_m=NETWORK_AHEAD_M,
        least_confidence=LEAST_CONFIDENCE,
    ),
    Method(name="contact", source="contact"),
    Method(name="lowest_pixel", source=None),
    # Baseline: edges have about the right length at any depth near the right distance.
    Method(name="flat", source="network", flat=True),
)


@dataclass(frozen=True, kw_only=True)
class Error:
    """Error of the telemetry in addition to that of the sensors."""

    height_m: float = 0.0
    pitch_rad: float = 0.0

    def on(self, frame: Frame) -> Frame:
        """Return the frame with the error."""
        return replace(
            frame,
            height_above_ground_m=frame.height_above_ground_m + self.height_m,
            gimbal_pitch_rad=max(-math.pi / 2, frame.gimbal_pitch_rad + self.pitch_rad),
        )


def methods_for(images: Sequence[SampleImage]) -> tuple[Method, ...]:
    """Return the methods whose inputs are available."""
    network = all(image.relative is not None for image in images)
    return tuple(method for method in METHODS if network or not method.needs_network)


def metric_maps(
    method: Method,
    images: Sequence[SampleImage],
    masks: Masks,
    *,
    error: Error | None = None,
    seed: int = 0,
) -> list[DepthMap]:
    """Return a method's metric depth of each image, at map size; all NaN without depth.

    Args:
        method: one of `METHODS`.
        images: images in the order of their capture.
        masks: source of the masks.
        error: additional error of the telemetry; None: only that of the sensors.
        seed: random seed of the ground samples.
    """
    wrong = error or Error()
    frames = [wrong.on(image.frame) for image in images]
    if method.source is None:
        return [
            _lowest_pixel(frame, image, image.masks[masks])
            for frame, image in zip(frames, images, strict=True)
        ]
    maker = MetricDepthMaker(
        _Estimated(images, flat=method.flat),
        source=method.source,
        scale=None if method.collects is None else CollectedScale(method.collects),
        generator=np.random.default_rng(seed),
        network_ahead_m=method.ahead_m,
        least_confidence=method.least_confidence,
    )

    def all_maps() -> list[DepthMap]:
        made = []
        for frame, image in zip(frames, images, strict=True):
            metric = maker.make(frame, image.masks[masks], image.video)
            made.append(metric.depth or _nothing(frame))
        return made

    if method.collects is not None:
        all_maps()
    return all_maps()


def _lowest_pixel(frame: Frame, image: SampleImage, class_map: ClassMap) -> DepthMap:
    depth = lowest_pixel_depth(class_map, view_of(frame, image.camera, MAP_SIZE_PX))
    return DepthMap(depth=depth, metric=True, captured_s=frame.captured_s)


class _Estimated:
    """The depth that a network gave for images, or a constant one."""

    def __init__(self, images: Sequence[SampleImage], *, flat: bool) -> None:
        self._depths = {image.frame.index: image.relative for image in images}
        self._flat = flat

    def estimate(self, frame: Frame) -> DepthMap:
        """Return the relative depth of a frame."""
        depth = None if self._flat else self._depths[frame.index]
        ones: NDArray[np.float32] = np.ones(MAP_SIZE_PX[::-1], dtype=np.float32)
        return depth or DepthMap(depth=ones, metric=False, captured_s=frame.captured_s)


def _nothing(frame: Frame) -> DepthMap:
    nowhere: NDArray[np.float32] = np.full(MAP_SIZE_PX[::-1], np.nan, dtype=np.float32)
    return DepthMap(depth=nowhere, metric=True, captured_s=frame.captured_s, confidence=0.0)
