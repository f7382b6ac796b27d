"""The second level's perception leaves: metric depth of each frame, and the corridor within it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from behaviours.perceive.class_map import StageTimer
from uav_bt.board import (
    CAMERA,
    CLASS_MAP,
    CORRIDOR,
    FRAME,
    METRIC_DEPTH,
    OBSTACLES,
    RELATIVE_DEPTH,
    STATE,
)
from uav_bt.board.context import MissionContext
from uav_bt.classes import CARPET
from uav_bt.protocols import DepthEstimator
from uav_bt.tree import Leaf, Port, Status
from uav_bt.types import CameraModel, DepthMap, DroneState, Frame

if TYPE_CHECKING:
    from perception.depth.contact.contacts import Remembered

__all__ = ["BuildCorridor", "EstimateDepth"]

_FOOTING = "footing"
_EVERY = 8  # pixels of two frames compared, to tell whether the picture is frozen
_MOVING_MPS = 0.2  # faster than this two pictures cannot be the same
_ASPECT_SLACK = 0.01  # 640x360 and 854x480 are both 16:9; more was cropped


class EstimateDepth(Leaf):
    """Metric depth of each new frame; SUCCESS always, staleness shows by age.

    A frame that gives no metric depth (black, frozen, too little carpet, no height) writes none,
    and the leaf's message says why. Where RememberObstacles ticks before it, boxes whose base has
    left the view are still known by where it was.
    """

    ports = (
        Port(
            *("model", str),
            default="depth",
            doc="'depth', 'depth-fp32', an ONNX file, or 'footing' (no network)",
        ),
        Port(
            "source",
            str,
            default="fused",
            doc="'network', or 'fused': by what things stand on where that is known",
        ),
    )
    reads = (STATE, FRAME, CLASS_MAP, CAMERA, OBSTACLES)
    writes = (RELATIVE_DEPTH, METRIC_DEPTH)

    def on_setup(self, mission: MissionContext) -> None:
        """Load the network; raises WeightsError, FileError or UnknownNameError when it cannot."""
        from perception.depth.metric import MetricDepthMaker  # noqa: PLC0415 - OpenCV is not light

        model = self.port_value("model")
        self._network = None if model == _FOOTING else self._load(model, mission)
        self._maker = MetricDepthMaker(
            source=_FOOTING if model == _FOOTING else self.port_value("source"),
            generator=mission.rng(self.path),
        )
        self._network_timer = StageTimer(mission, "relative_depth")
        self._timer = StageTimer(mission, "metric_depth")
        self._last_index = -1
        self._last_picture: NDArray[np.uint8] | None = None

    def update(self) -> Status:
        """Estimate the depth of the frame if it is a new one and has been segmented."""
        frame, camera = self.read(FRAME).value, self.read(CAMERA).value
        class_map, state = self.read(CLASS_MAP).value, self.read(STATE).value
        if frame is None or camera is None or class_map is None or frame.index == self._last_index:
            return Status.SUCCESS
        self._last_index = frame.index
        wrong = "the picture is frozen" if self._frozen(frame, state) else _misfit(frame, camera)
        if wrong:
            self.feedback_message = f"no depth: {wrong}"
            return Status.SUCCESS
        relative = self._relative(frame)
        with self._timer:
            remembered = self._remembered(frame, camera, state)
            metric = self._maker.make(frame, class_map, camera, relative, remembered)
        self.feedback_message = f"no depth: {metric.refusal}" if metric.refusal else ""
        if metric.depth is not None:
            self.write(METRIC_DEPTH, metric.depth, captured_s=frame.captured_s)
        return Status.SUCCESS

    def _relative(self, frame: Frame) -> DepthMap | None:
        if self._network is None:
            return None
        with self._network_timer:
            relative = self._network.estimate(frame)
        self.write(RELATIVE_DEPTH, relative, captured_s=frame.captured_s)
        return relative

    def _remembered(
        self, frame: Frame, camera: CameraModel, state: DroneState | None
    ) -> Remembered | None:
        from perception.depth.metric import remembered_bases  # noqa: PLC0415 - late

        obstacles = self.read(OBSTACLES).value
        if obstacles is None or state is None:
            return None
        return remembered_bases(obstacles, state, frame, camera)

    def _frozen(self, frame: Frame, state: DroneState | None) -> bool:
        """Return whether a moving drone sent the same picture again."""
        before, self._last_picture = self._last_picture, frame.image[::_EVERY, ::_EVERY].copy()
        if before is None or state is None:
            return False
        velocity = state.velocity
        speed_mps = math.hypot(velocity.forward_mps, velocity.right_mps, velocity.down_mps)
        return speed_mps > _MOVING_MPS and np.array_equal(before, self._last_picture)

    @staticmethod
    def _load(model: str, mission: MissionContext) -> DepthEstimator:
        # Late: an inference runtime takes seconds to import and `uav-bt check` must answer at once.
        from perception.depth.runtime import load_depth_estimator  # noqa: PLC0415

        network: DepthEstimator = load_depth_estimator(model, threads=mission.inference_threads)
        return network


def _misfit(frame: Frame, camera: CameraModel) -> str:
    """Return why a frame cannot be of a camera; empty when it can."""
    height_px, width_px = frame.image.shape[:2]
    stretch = (width_px * camera.height_px) / (height_px * camera.width_px)
    if abs(stretch - 1.0) <= _ASPECT_SLACK:
        return ""
    return (
        f"the frame is {width_px}x{height_px}, its camera {camera.width_px}x{camera.height_px}: "
        "another aspect"
    )


class BuildCorridor(Leaf):
    """Look for what is inside the safety corridor of each new metric depth; SUCCESS always."""

    ports = (
        Port("side_m", float, default=0.5, doc="left and right wall from the drone's centre, m"),
        Port("front_m", float, default=2.0, doc="front plane from the drone's centre, m"),
        Port("up_down_m", float, default=0.8, doc="upper and lower wall from its centre, m"),
        Port("focal_factor", float, default=1.0, doc="the paper's f, 0.8 to 1.2"),
        Port("background", bool, default=False, doc="count what is no box and no helipad, too"),
    )
    reads = (STATE, FRAME, CLASS_MAP, CAMERA, METRIC_DEPTH)
    writes = (CORRIDOR,)

    def on_setup(self, mission: MissionContext) -> None:
        """Raise the walls; raises ValueRangeError where they cannot stand."""
        from perception.obstacles.corridor import CorridorBuilder, CorridorConfig  # noqa: PLC0415 - late

        side_m, up_down_m = self.port_value("side_m"), self.port_value("up_down_m")
        self._builder = CorridorBuilder(
            CorridorConfig(
                left_m=side_m,
                right_m=side_m,
                front_m=self.port_value("front_m"),
                up_m=up_down_m,
                down_m=up_down_m,
                focal_factor=self.port_value("focal_factor"),
            )
        )
        self._timer = StageTimer(mission, "corridor")
        self._last_s = -math.inf

    def update(self) -> Status:
        """Build the corridor of a new metric depth."""
        from perception.camera.ground_plane import view_of  # noqa: PLC0415 - late

        frame, camera = self.read(FRAME).value, self.read(CAMERA).value
        class_map, state = self.read(CLASS_MAP).value, self.read(STATE).value
        depth = self.read(METRIC_DEPTH).value
        if frame is None or camera is None or class_map is None or depth is None:
            return Status.SUCCESS
        together = depth.captured_s == class_map.captured_s == frame.captured_s
        if not together or depth.captured_s == self._last_s:
            return Status.SUCCESS
        self._last_s = depth.captured_s
        height_px, width_px = depth.depth.shape
        ids = class_map.ids
        things = ids != CARPET if self.port_value("background") else ids > CARPET
        with self._timer:
            corridor = self._builder.build(
                depth,
                view_of(frame, camera, (width_px, height_px)),
                velocity=None if state is None else state.velocity,
                things=things,
            )
        self.write(CORRIDOR, corridor, captured_s=depth.captured_s)
        return Status.SUCCESS
