"""Depth of one frame after another, as a mission's leaf and a video of perception both make it."""

from __future__ import annotations

import math
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from perception.depth.metric import MetricDepth, MetricDepthMaker, remembered_bases
from uav_bt.errors import ValueRangeError
from uav_bt.protocols import DepthEstimator
from uav_bt.types import CameraModel, ClassMap, DroneState, Frame, NearObstacles

Timed = Callable[[str], AbstractContextManager[object]]


@dataclass(frozen=True, kw_only=True)
class DepthStageConfig:
    """Which frames are refused before anything is computed."""

    moving_mps: float = 0.2  # faster than this, two equal images mean that the video is frozen
    compared_px: int = 8  # every so many pixels of two images are compared
    aspect_slack: float = 0.01  # 640x360 and 854x480 are both 16:9; more was cropped

    def __post_init__(self) -> None:
        if not (self.moving_mps > 0.0 and self.compared_px >= 1 and self.aspect_slack >= 0.0):
            raise ValueRangeError(f"speed and spacing must be positive, got {self}")


class DepthStage:
    """Relative and metric depth, frame by frame.

    Args:
        network: frame in, relative depth out; None knows depth by ground contact alone.
        maker: makes the metric depth.
        config: which frames are refused.
    """

    def __init__(
        self,
        network: DepthEstimator | None,
        maker: MetricDepthMaker,
        config: DepthStageConfig | None = None,
    ) -> None:
        self._network, self._maker = network, maker
        self._config = config or DepthStageConfig()
        self._last_image: NDArray[np.uint8] | None = None

    def perceive(
        self,
        frame: Frame,
        class_map: ClassMap,
        camera: CameraModel,
        *,
        state: DroneState | None = None,
        near: NearObstacles | None = None,
        timed: Timed = nullcontext,
    ) -> MetricDepth:
        """Return the depth of a frame that was not seen before, at the class map's size.

        Args:
            frame: its telemetry gives the ground plane.
            class_map: of that frame.
            camera: intrinsics at any size of the frame's aspect.
            state: the newest telemetry, where there is any.
            near: obstacles near the drone, from the body's centre at the time of the state.
            timed: measures a stage, `relative_depth` or `metric_depth`, by its name.
        """
        refusal = self._frozen(frame, state) or self._misfit(frame, camera)
        if refusal:
            return MetricDepth(depth=None, refusal=refusal)
        relative = None
        if self._network is not None:
            with timed("relative_depth"):
                relative = self._network.estimate(frame)
        with timed("metric_depth"):
            remembered = None
            if near is not None and state is not None:
                remembered = remembered_bases(near, state, frame, camera)
            metric = self._maker.make(frame, class_map, camera, relative, remembered)
        return replace(metric, relative=relative)

    def _frozen(self, frame: Frame, state: DroneState | None) -> str:
        """Return a refusal where a moving drone sent the same image again."""
        every, before = self._config.compared_px, self._last_image
        self._last_image = frame.image[::every, ::every].copy()
        if before is None or state is None:
            return ""
        velocity = state.velocity
        speed_mps = math.hypot(velocity.forward_mps, velocity.right_mps, velocity.down_mps)
        if speed_mps > self._config.moving_mps and np.array_equal(before, self._last_image):
            return "the image is frozen"
        return ""

    def _misfit(self, frame: Frame, camera: CameraModel) -> str:
        """Return why a frame cannot be of a camera; empty when it can."""
        height_px, width_px = frame.image.shape[:2]
        stretch = (width_px * camera.height_px) / (height_px * camera.width_px)
        if abs(stretch - 1.0) <= self._config.aspect_slack:
            return ""
        return (
            f"the frame is {width_px}x{height_px}, its camera "
            f"{camera.width_px}x{camera.height_px}: another aspect"
        )
