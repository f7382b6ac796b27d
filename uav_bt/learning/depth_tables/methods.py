"""The ways to metric depth that are compared, and their maps of a list of pictures."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.camera.ground_plane import view_of
from perception.depth.evaluation.lowest_pixel import lowest_pixel_depth
from perception.depth.metric import MetricDepthMaker
from uav_bt.learning.depth_tables.images import MAP_SIZE_PX, Masks, Picture
from uav_bt.types import ClassMap, DepthMap, Frame

__all__ = ["METHODS", "Error", "Method", "methods_for", "metric_maps"]


@dataclass(frozen=True, kw_only=True)
class Method:
    """One way to metric depth."""

    name: str
    source: str | None  # of `MetricDepthMaker`; None for the lowest-pixel baseline
    scale: str = "adaptive"
    collects: bool = False  # its scale is that of all pictures: they are shown to it twice
    flat: bool = False  # in the network's place, a depth of one everywhere

    @property
    def needs_network(self) -> bool:
        """Whether it makes something of a network's relative depth."""
        return self.source in ("network", "fused") and not self.flat


METHODS: Final = (
    Method(name="constant", source="network", scale="constant", collects=True),
    Method(name="least_squares", source="network", scale="least_squares", collects=True),
    Method(name="adaptive", source="network"),
    Method(name="fused", source="fused"),
    Method(name="footing", source="footing"),
    Method(name="lowest_pixel", source=None),
    # What the questions give away: edges look as long as they are at about the right distance.
    Method(name="flat", source="network", flat=True),
)


@dataclass(frozen=True, kw_only=True)
class Error:
    """What is wrong with the telemetry on top of the sensors' own error."""

    height_m: float = 0.0
    pitch_rad: float = 0.0

    def on(self, frame: Frame) -> Frame:
        """Return the frame with the error."""
        return replace(
            frame,
            height_above_carpet_m=frame.height_above_carpet_m + self.height_m,
            gimbal_pitch_rad=max(-math.pi / 2, frame.gimbal_pitch_rad + self.pitch_rad),
        )


def methods_for(pictures: Sequence[Picture]) -> tuple[Method, ...]:
    """Return the methods that have what they need."""
    network = all(picture.relative is not None for picture in pictures)
    return tuple(method for method in METHODS if network or not method.needs_network)


def metric_maps(
    method: Method,
    pictures: Sequence[Picture],
    masks: Masks,
    *,
    error: Error | None = None,
    seed: int = 0,
) -> list[DepthMap]:
    """Return a method's metric depth of every picture, at map size; all NaN where it has none.

    Args:
        method: the way.
        pictures: in order of their capture.
        masks: whose.
        error: of the telemetry; None for none but the sensors'.
        seed: of the carpet's sampling.
    """
    wrong = error or Error()
    frames = [wrong.on(picture.frame) for picture in pictures]
    if method.source is None:
        return [
            _lowest_pixel(frame, picture, picture.masks[masks])
            for frame, picture in zip(frames, pictures, strict=True)
        ]
    maker = MetricDepthMaker(
        source=method.source,
        scale=method.scale,
        generator=np.random.default_rng(seed),
    )

    def all_maps() -> list[DepthMap]:
        made = []
        for frame, picture in zip(frames, pictures, strict=True):
            relative = _flat(frame) if method.flat else picture.relative
            metric = maker.make(frame, picture.masks[masks], picture.video, relative)
            made.append(metric.depth or _nothing(frame))
        return made

    if method.collects:
        all_maps()
    return all_maps()


def _lowest_pixel(frame: Frame, picture: Picture, class_map: ClassMap) -> DepthMap:
    depth = lowest_pixel_depth(class_map.ids, view_of(frame, picture.camera, MAP_SIZE_PX))
    return DepthMap(depth=depth, metric=True, captured_s=frame.captured_s)


def _flat(frame: Frame) -> DepthMap:
    ones: NDArray[np.float32] = np.ones(MAP_SIZE_PX[::-1], dtype=np.float32)
    return DepthMap(depth=ones, metric=False, captured_s=frame.captured_s)


def _nothing(frame: Frame) -> DepthMap:
    nowhere: NDArray[np.float32] = np.full(MAP_SIZE_PX[::-1], np.nan, dtype=np.float32)
    return DepthMap(depth=nowhere, metric=True, captured_s=frame.captured_s, confidence=0.0)
