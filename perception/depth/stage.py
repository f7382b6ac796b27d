"""Depth estimation frame by frame, shared by the mission's leaf and by perception on videos."""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from functools import partial
from typing import Final

import numpy as np

from perception.depth.confidence import flow_measure
from perception.depth.metric import MetricDepth, MetricDepthMaker, remembered_bases
from uav_bt.protocols import DepthEstimator
from uav_bt.types import CameraModel, ClassMap, DepthMap, DroneState, Frame, NearObstacles
from uav_bt.types.arrays import Image
from uav_bt.types.dead_reckoning import MotionEstimate

_MOVING_MPS: Final = 0.2  # above this speed two equal images mean a frozen video
_COMPARED_PX: Final = 8  # step in rows and columns between compared pixels
_ASPECT_SLACK: Final = 0.01  # relative; 640x360 and 854x480 are both 16:9, others are cropped


class DepthStage:
    """Relative and metric depth, frame by frame.

    Args:
        network: frame in, relative depth out; None for depth by ground contact alone.
        maker: makes the metric depth.
        timer: wall clock of the stages' times, seconds.
    """

    def __init__(
        self,
        network: DepthEstimator | None,
        maker: MetricDepthMaker,
        timer: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._network, self._maker, self._timer = network, maker, timer
        self._last_image: Image | None = None

    def perceive(
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
        """Return the depth of a new frame, at the class map's size.

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
        refusal = self._frozen(frame, state) or _misfit(frame, camera)
        if refusal:
            return MetricDepth.refused(refusal)
        began_s, network_s = self._timer(), 0.0

        def relative(network: DepthEstimator) -> DepthMap:
            nonlocal network_s
            asked_s = self._timer()
            depth = network.estimate(frame)
            network_s = self._timer() - asked_s
            spent("relative_depth", network_s)
            return depth

        remembered = None
        if near is not None and motion is not None and motion.seen.time_s == frame.captured_s:
            remembered = remembered_bases(near, motion.pose, motion.seen, frame, camera)
        network = None if self._network is None else partial(relative, self._network)
        metric = self._maker.make(frame, class_map, camera, network, remembered)
        spent("metric_depth", self._timer() - began_s - network_s)
        if motion is None or motion.stretch is None:
            return metric
        return metric.limited("flow", flow_measure(motion.stretch))

    def _frozen(self, frame: Frame, state: DroneState | None) -> str:
        """Return a refusal if a moving drone sent the same image again."""
        before = self._last_image
        self._last_image = frame.image[::_COMPARED_PX, ::_COMPARED_PX].copy()
        if before is None or state is None:
            return ""
        velocity = state.velocity
        speed_mps = math.hypot(velocity.forward_mps, velocity.right_mps, velocity.down_mps)
        still = speed_mps > _MOVING_MPS and np.array_equal(before, self._last_image)
        return "the image is frozen" if still else ""


def _misfit(frame: Frame, camera: CameraModel) -> str:
    """Return a message if frame and camera differ in aspect ratio; otherwise empty."""
    height_px, width_px = frame.image.shape[:2]
    stretch = (width_px * camera.height_px) / (height_px * camera.width_px)
    if abs(stretch - 1.0) <= _ASPECT_SLACK:
        return ""
    size = f"{camera.width_px}x{camera.height_px}"
    return f"the frame is {width_px}x{height_px}, its camera {size}: another aspect"
