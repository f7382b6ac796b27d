"""The whole of perception without a tree: a frame in; masks, metres, corridor and helipad out.

For videos, benchmarks and evaluations. In a mission the perception leaves do the same work, one
each, so that a tree file shows what it flies with.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.camera.ground_plane import view_of
from perception.camera.undistortion import Undistorter
from perception.depth.metric import MetricDepth, MetricDepthMaker
from perception.depth.scale import Scale
from perception.landing.detector import HelipadDetection, HelipadDetector, locate
from perception.landing.tracker import HelipadTracker
from perception.obstacles.corridor import CorridorBuilder, CorridorConfig
from uav_bt.classes import CARPET
from uav_bt.errors import ValueRangeError
from uav_bt.protocols import DepthEstimator, Segmenter
from uav_bt.types import (
    PAD_HEIGHT_M,
    CameraModel,
    ClassMap,
    Corridor,
    DepthMap,
    DroneState,
    Frame,
    HelipadFix,
)

__all__ = ["STAGES", "Perceived", "Pipeline", "PipelineConfig"]

STAGES: Final = ("segmentation", "relative_depth", "metric_depth", "corridor", "helipad")
_EVERY: Final = 8  # pixels of two frames compared, to tell whether the picture is frozen


@dataclass(frozen=True, kw_only=True)
class PipelineConfig:
    """How the stages work; the defaults are those of the leaves."""

    source: str = "fused"  # of metric depth, where there is a network; footing without one
    corridor: CorridorConfig = field(default_factory=CorridorConfig)
    pad_height_m: float = PAD_HEIGHT_M  # top of the helipad above the carpet
    moving_mps: float = 0.2  # faster than this two pictures cannot be the same
    carried_s: float = 12.0  # a helipad that was not seen for longer is lost

    def __post_init__(self) -> None:
        numbers = (self.pad_height_m, self.moving_mps, self.carried_s)
        if not all(math.isfinite(value) and value > 0.0 for value in numbers):
            raise ValueRangeError(
                f"pad height, moving speed and carried time must be positive, got {numbers}"
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class Perceived:
    """What one frame shows."""

    frame: Frame  # undistorted
    class_map: ClassMap
    relative: DepthMap | None  # None without a network, and of a frozen picture
    depth: DepthMap | None  # metric; None where nothing is known
    refusal: str  # why there is no metric depth, or less than asked for; empty when all is well
    scale: Scale | None  # of the network's depth; None where none went in
    corridor: Corridor | None  # None without metric depth
    intruding: NDArray[np.bool_] | None  # (H, W), pixels inside the corridor
    detection: HelipadDetection | None  # in this frame
    helipad: HelipadFix | None
    stage_s: Mapping[str, float]  # wall time by stage; a stage that did not run is not in it


class Pipeline:
    """Perceives one frame after another.

    Args:
        segmenter: frame in, class map out.
        network: frame in, relative depth out; None perceives depth by footing alone.
        camera: intrinsics at the frames' size; with distortion where the frames are distorted.
        generator: draws the carpet's pixels for the scale.
        config: how the stages work.
        timer: the wall clock that computing is measured with, seconds.

    Raises:
        UnknownNameError: the config names no source that exists.
    """

    def __init__(
        self,
        segmenter: Segmenter,
        network: DepthEstimator | None,
        camera: CameraModel,
        *,
        generator: np.random.Generator,
        config: PipelineConfig | None = None,
        timer: Callable[[], float] = time.perf_counter,
    ) -> None:
        self._config = config or PipelineConfig()
        self._segmenter, self._network = segmenter, network
        self._undistorter = Undistorter(camera)
        self._maker = MetricDepthMaker(
            source="footing" if network is None else self._config.source,
            generator=generator,
        )
        self._corridors = CorridorBuilder(self._config.corridor)
        self._detector, self._tracker = HelipadDetector(), HelipadTracker()
        self._state: DroneState | None = None
        self._last_picture: NDArray[np.uint8] | None = None
        self._timer = timer

    @property
    def camera(self) -> CameraModel:
        """The camera of the undistorted frames."""
        return self._undistorter.camera

    def perceive(self, frame: Frame, states: Sequence[DroneState] = ()) -> Perceived:
        """Return what a frame shows.

        Args:
            frame: the next one, of the camera's size.
            states: the drone's telemetry since the frame before, up to this one's capture. They
                carry the helipad through frames that miss it; without any it is told only when
                it is seen.

        Raises:
            ShapeError: the frame has another size than the camera.
        """
        spent: dict[str, float] = {}
        frame = replace(frame, image=self._undistorter.picture(frame.image))
        for state in states:
            self._tracker.predict(state)
            self._state = state
        with self._timed(spent, "segmentation"):
            class_map = self._segmenter.segment(frame)
        relative, metric = self._metric(frame, class_map, spent)
        corridor = intruding = None
        if metric.depth is not None:
            with self._timed(spent, "corridor"):
                corridor = self._corridor(frame, class_map, metric.depth)
            intruding = self._intruding(frame, class_map, metric.depth)
        with self._timed(spent, "helipad"):
            detection = self._detector.detect(class_map)
            helipad = self._helipad(frame, class_map, detection)
        return Perceived(
            frame=frame,
            class_map=class_map,
            relative=relative,
            depth=metric.depth,
            refusal=metric.refusal,
            scale=metric.scale,
            corridor=corridor,
            intruding=intruding,
            detection=detection,
            helipad=helipad,
            stage_s=spent,
        )

    @contextmanager
    def _timed(self, spent: dict[str, float], stage: str) -> Iterator[None]:
        begin_s = self._timer()
        yield
        spent[stage] = self._timer() - begin_s

    # --- depth ------------------------------------------------------------------------------------

    def _metric(
        self, frame: Frame, class_map: ClassMap, spent: dict[str, float]
    ) -> tuple[DepthMap | None, MetricDepth]:
        if self._frozen(frame):
            return None, MetricDepth(depth=None, refusal="the picture is frozen")
        relative = None
        if self._network is not None:
            with self._timed(spent, "relative_depth"):
                relative = self._network.estimate(frame)
        with self._timed(spent, "metric_depth"):
            metric = self._maker.make(frame, class_map, self.camera, relative)
        if metric.depth is not None and not np.isfinite(metric.depth.depth).any():
            # Footing knows nothing here: a map of nothing would read as a free way.
            return relative, MetricDepth(
                depth=None, refusal=metric.refusal or "nothing in view stands on carpet"
            )
        return relative, metric

    def _frozen(self, frame: Frame) -> bool:
        """Return whether a moving drone sent the same picture again."""
        before, self._last_picture = self._last_picture, frame.image[::_EVERY, ::_EVERY].copy()
        if before is None or self._state is None:
            return False
        velocity = self._state.velocity
        speed_mps = math.hypot(velocity.forward_mps, velocity.right_mps, velocity.down_mps)
        return speed_mps > self._config.moving_mps and np.array_equal(before, self._last_picture)

    def _corridor(self, frame: Frame, class_map: ClassMap, depth: DepthMap) -> Corridor:
        height_px, width_px = depth.depth.shape
        return self._corridors.build(
            depth,
            view_of(frame, self.camera, (width_px, height_px)),
            velocity=None if self._state is None else self._state.velocity,
            things=class_map.ids > CARPET,
        )

    def _intruding(self, frame: Frame, class_map: ClassMap, depth: DepthMap) -> NDArray[np.bool_]:
        height_px, width_px = depth.depth.shape
        view = view_of(frame, self.camera, (width_px, height_px))
        return self._corridors.intruding(depth, view, things=class_map.ids > CARPET)

    # --- helipad ----------------------------------------------------------------------------------

    def _helipad(
        self, frame: Frame, class_map: ClassMap, detection: HelipadDetection | None
    ) -> HelipadFix | None:
        place = None if detection is None else self._place(frame, class_map, detection)
        if self._state is None:
            if detection is None or place is None:
                return None
            return HelipadFix(
                captured_s=frame.captured_s,
                forward_m=place[0],
                right_m=place[1],
                detected=True,
                confidence=detection.score,
            )
        seen = (
            detection is not None
            and place is not None
            and self._tracker.update(
                *place, captured_s=frame.captured_s, confidence=detection.score
            )
        )
        fix = self._tracker.fix(detected=seen)
        lost = fix is None or frame.captured_s - fix.captured_s > self._config.carried_s
        return None if lost else fix

    def _place(
        self, frame: Frame, class_map: ClassMap, detection: HelipadDetection
    ) -> tuple[float, float] | None:
        if not math.isfinite(frame.height_above_carpet_m + frame.gimbal_pitch_rad):
            return None
        height_px, width_px = class_map.ids.shape
        return locate(
            detection,
            self.camera.resized(width_px, height_px),
            frame.gimbal_pitch_rad,
            frame.height_above_carpet_m - self._config.pad_height_m,
        )
