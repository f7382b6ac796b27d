"""The second level's perception leaves: metric depth of each frame, and the safety corridor."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Final

from behaviours.ports import StageTimer, number
from perception.camera.ground_plane import view_of
from perception.networks.weights_file import ANY, CONTACT, SHIPPED_DEPTHS, depth_file
from uav_bt.board import (
    CAMERA,
    CLASS_MAP,
    CORRIDOR,
    FRAME,
    METRIC_DEPTH,
    ODOMETRY,
    RELATIVE_DEPTH,
    SITE_MAP,
    STATE,
)
from uav_bt.board.context import MissionContext
from uav_bt.errors import AnswerError, ValueRangeError
from uav_bt.protocols import DepthEstimator
from uav_bt.tree import Leaf, Port, Status
from uav_bt.types import CameraModel, DepthMap, Frame

if TYPE_CHECKING:
    from perception.depth.corridor import CorridorConfig

# Obstacles beyond the front plane of the corridor, 2 m, stop no step. Chosen.
NETWORK_AHEAD_M: Final = 2.5
_FROM: Final = "from the drone's centre, m"
_MODEL: Final = "'depth' or 'any' (where `Segment` gives none), 'contact' (none), or an ONNX file"
_SOURCES: Final = ("fused", "network", "contact")
_SOURCE: Final = "'network', or 'fused': by ground contact where it is known"
_AHEAD: Final = "fused: run the network for unmeasured obstacles nearer than this, m; 20: always"
_LEAST: Final = "least confidence of the scale; below it depth is by ground contact alone"


class EstimateDepth(Leaf):
    """Estimate the metric depth of each new frame; SUCCESS always.

    Nothing is written for a frame without metric depth (black, frozen, too little ground, no
    height, a network's depth of zero or NaN), and the leaf's message gives the reason. If `MapSite`
    ticks before this leaf, the base of a box gives its range even after the base has left the view.
    """

    answers = (Status.SUCCESS,)
    ports = (
        Port("model", str, "depth", _MODEL, look_up=depth_file, at_setup=True),
        Port("source", str, "fused", _SOURCE, choices=_SOURCES, at_setup=True),
        number("network_ahead_m", NETWORK_AHEAD_M, 0, 20, _AHEAD, at_setup=True),
        number("least_confidence", 0.2, 0, 1, _LEAST, at_setup=True),
    )
    reads = (STATE, FRAME, CLASS_MAP, CAMERA, SITE_MAP, ODOMETRY, RELATIVE_DEPTH)
    writes = (RELATIVE_DEPTH, METRIC_DEPTH)

    def on_setup(self, mission: MissionContext) -> None:
        """Load the network; raises WeightsError or FileError when it cannot be loaded."""
        # Late: OpenCV and Numba are heavy.
        from perception.depth.metric import MetricDepthMaker  # noqa: PLC0415

        model = self.port_value("model")
        self._maker = MetricDepthMaker(
            None if model == CONTACT else mission.sight or self._load(model, mission),
            source=CONTACT if model == CONTACT else self.port_value("source"),
            generator=mission.rng(self.path),
            least_confidence=self.port_value("least_confidence"),
            network_ahead_m=self.port_value("network_ahead_m"),
            mark_height_m=mission.mark.height_m,
        )
        self._times_s = mission.stage_times_s
        self._last_index = -1

    def update(self) -> Status:
        """Estimate the depth of the frame if it is a new one and has been segmented."""
        frame, camera = self.read(FRAME).value, self.read(CAMERA).value
        class_map, site_map = self.read(CLASS_MAP).value, self.read(SITE_MAP).value
        if frame is None or camera is None or class_map is None or frame.index == self._last_index:
            return Status.SUCCESS
        self._last_index = frame.index
        try:
            metric = self._maker.make(
                frame,
                class_map,
                camera,
                state=self.read(STATE).value,
                near=None if site_map is None else site_map.near,
                motion=self.read(ODOMETRY).value,
                spent=lambda stage, spent_s: self._times_s.setdefault(stage, []).append(spent_s),
            )
        except AnswerError as error:
            self.feedback_message = f"no depth: {error}"
            self.mission.warn_once(self.feedback_message, self.path)
            return Status.SUCCESS
        self.feedback_message = f"no depth: {metric.refusal}" if metric.refusal else ""
        if metric.relative is not None:
            self.write(RELATIVE_DEPTH, metric.relative, captured_s=frame.captured_s)
        if metric.depth is not None:
            self.write(METRIC_DEPTH, metric.depth, captured_s=frame.captured_s)
        return Status.SUCCESS

    def _load(self, model: str, mission: MissionContext) -> DepthEstimator:
        # Late: an inference runtime takes seconds to import; `uav-bt check` must answer at once.
        from perception.depth.runtime import load_depth_estimator  # noqa: PLC0415

        network = load_depth_estimator(model, threads=mission.inference_threads)
        return _SegmentsDepth(self, network) if model in (SHIPPED_DEPTHS[0], ANY) else network


class _SegmentsDepth:
    """The depth that `Segment` wrote for a frame; of other frames that of a network."""

    def __init__(self, leaf: Leaf, network: DepthEstimator) -> None:
        self._leaf, self._network = leaf, network

    def estimate(self, frame: Frame) -> DepthMap:
        """Return the relative depth of a frame."""
        depth = self._leaf.read(RELATIVE_DEPTH).value
        if depth is not None and depth.captured_s == frame.captured_s:
            return depth
        return self._network.estimate(frame)


class BuildCorridor(Leaf):
    """Find the obstacles in the safety corridor of each new metric depth; SUCCESS always."""

    answers = (Status.SUCCESS,)
    ports = (
        number("side_m", 0.5, 0.05, 20, f"left and right wall {_FROM}", at_setup=True),
        number("front_m", 2.0, 0.05, 50, f"front plane {_FROM}", at_setup=True),
        number("up_down_m", 0.8, 0.05, 20, f"upper and lower wall {_FROM}", at_setup=True),
        number("focal_factor", 1.0, 0.5, 2, "the paper's f, 0.8 to 1.2", at_setup=True),
        Port("background", bool, default=False, doc="count the background, too"),
    )
    reads = (STATE, FRAME, CLASS_MAP, CAMERA, METRIC_DEPTH)
    writes = (CORRIDOR,)

    def config(self) -> CorridorConfig:
        """Return the configuration of the corridor from the ports."""
        from perception.depth.corridor import CorridorConfig  # noqa: PLC0415  (Numba is heavy)

        names = ("side_m", "front_m", "up_down_m", "focal_factor")
        return CorridorConfig(**{name: self.port_value(name) for name in names})

    def on_setup(self, mission: MissionContext) -> None:
        """Place the planes; raises ValueRangeError if the front plane is not ahead of the lens."""
        from perception.depth.corridor import CorridorBuilder  # noqa: PLC0415  (Numba is heavy)

        nose_m = mission.airframe.body_size_m[0] / 2
        config, camera = replace(self.config(), nose_m=nose_m), self.read(CAMERA).value
        lens_m = CameraModel.forward_offset_m if camera is None else camera.forward_offset_m
        least_m = lens_m + config.least_plane_m
        if not config.front_m > least_m:
            raise ValueRangeError(
                f"front_m must be more than {least_m:.2f} m from the drone's centre, just ahead of "
                f"the lens; got {config.front_m:g}"
            )
        self._builder = CorridorBuilder(config)
        self._timer = StageTimer(mission, "corridor")
        self._last_s = -math.inf

    def update(self) -> Status:
        """Build the corridor of a new metric depth."""
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
        beside = self.port_value("background")
        things = ~class_map.is_ground if beside else class_map.is_above_ground
        with self._timer:
            corridor = self._builder.build(
                depth,
                view_of(frame, camera, (width_px, height_px)),
                velocity=None if state is None else state.velocity,
                things=things,
            )
        self.write(CORRIDOR, corridor, captured_s=depth.captured_s)
        return Status.SUCCESS
