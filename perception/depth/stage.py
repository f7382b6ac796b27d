"""Depth estimation frame by frame, shared by the mission's leaf and by perception on videos."""

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
from uav_bt.types.dead_reckoning import MotionEstimate

Timed = Callable[[str], AbstractContextManager[object]]


@dataclass(frozen=True, kw_only=True)
class DepthStageConfig:
    """Which frames are refused before any computation."""

    moving_mps: float = 0.2  # above this speed two equal images mean a frozen video
    compared_px: int = 8  # step in rows and columns between compared pixels
    aspect_slack: float = 0.01  # relative; 640x360 and 854x480 are both 16:9, others are cropped

    def __post_init__(self) -> None:
        if not (self.moving_mps > 0.0 and self.compared_px >= 1 and self.aspect_slack >= 0.0):
            raise ValueRangeError(f"speed and spacing must be positive, got {self}")


class DepthStage:
    """Relative and metric depth, frame by frame.

    Args:
        network: frame in, relative depth out; None for depth by ground contact alone.
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
        motion: MotionEstimate | None = None,
        timed: Timed = nullcontext,
    ) -> MetricDepth:
        """Return the depth of a new frame, at the class map's size.

        Args:
            frame: its telemetry gives the ground plane.
            class_map: class map of that frame.
            camera: intrinsics at any size of the frame's aspect ratio.
            state: the newest telemetry, if there is any.
            near: obstacles near the drone, from the body's centre at the pose of `motion`.
            motion: the drone's pose now and at this frame. Without it, or with one of another
                frame, no remembered obstacle is used.
            timed: measures the time of a stage, `relative_depth` or `metric_depth`, by its name.
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
            same = motion is not None and motion.seen.time_s == frame.captured_s
            if near is not None and motion is not None and same:
                remembered = remembered_bases(near, motion.pose, motion.seen, frame, camera)
            metric = self._maker.make(frame, class_map, camera, relative, remembered)
        return replace(metric, relative=relative)

    def _frozen(self, frame: Frame, state: DroneState | None) -> str:
        """Return a refusal if a moving drone sent the same image again."""
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
        """Return a message if frame and camera differ in aspect ratio; otherwise empty."""
        height_px, width_px = frame.image.shape[:2]
        stretch = (width_px * camera.height_px) / (height_px * camera.width_px)
        if abs(stretch - 1.0) <= self._config.aspect_slack:
            return ""
        return (
            f"the frame is {width_px}x{height_px}, its camera "
            f"{camera.width_px}x{camera.height_px}: another aspect"
        )
