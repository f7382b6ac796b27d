"""All perception of a frame without a tree: class map, depth, corridor and mark.

In a mission each perception leaf does one of these steps.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from perception.camera.camera_file import Undistorter
from perception.camera.ground_plane import view_of
from perception.depth.confidence import Confidence
from perception.depth.corridor import CorridorBuilder
from perception.depth.metric import MetricDepth, MetricDepthMaker
from perception.depth.scale import Scale
from perception.marks.tracker import MarkTracker
from uav_bt.display.video.panes import Seen
from uav_bt.errors import AnswerError
from uav_bt.lab.shipped import default_mark
from uav_bt.landing_marks import MarkView
from uav_bt.plugins import make_mark_finder
from uav_bt.protocols import DepthEstimator, Segmenter
from uav_bt.types import CameraModel, DroneState, Frame

STAGES: Final = ("segmentation", "relative_depth", "metric_depth", "corridor", "mark")

_CARRIED_S: Final = 12.0  # a mark that was not seen for longer is lost, as in the leaves


@dataclass(frozen=True, kw_only=True, eq=False)
class Perceived(Seen):
    """Perception of one undistorted frame."""

    scale: Scale | None  # of the network's depth; None where none went in
    confidences: Mapping[str, Confidence]  # of `ground`, `scale` and `depth`
    stage_s: Mapping[str, float]  # wall time by stage; a stage that did not run is not in it


@dataclass(eq=False)
class Pipeline:
    """Perceives one frame after another.

    Attributes:
        segmenter: frame in, class map out.
        network: frame in, relative depth out; None perceives depth by ground contact alone.
        camera: intrinsics at the frames' size; with distortion where the frames are distorted. Then
            that of the undistorted frames.
        timer: the wall clock that computing is measured with, seconds.
    """

    segmenter: Segmenter
    network: DepthEstimator | None
    camera: CameraModel
    timer: Callable[[], float] = time.perf_counter

    def __post_init__(self) -> None:
        self._undistorter = Undistorter(self.camera)
        self.camera = self._undistorter.camera
        self._corridors = CorridorBuilder()
        self._finder = make_mark_finder(default_mark())
        self.restart()

    def restart(self) -> None:
        """Forget all earlier frames, so that images are perceived alike in any order."""
        source = "contact" if self.network is None else "fused"
        rng = np.random.default_rng(0)  # draws the ground's pixels for the scale
        self._depth = MetricDepthMaker(self.network, source=source, generator=rng, timer=self.timer)
        self._track = MarkTracker()
        self._state: DroneState | None = None

    def perceive(self, frame: Frame, states: Sequence[DroneState] = ()) -> Perceived:
        """Return the perception of the next frame, of the camera's size.

        `states`: the drone's telemetry since the frame before. It carries the mark through frames
        that miss it.
        """
        spent: dict[str, float] = {}
        frame = replace(frame, image=self._undistorter.undistort(frame.image))
        for state in states:
            self._track.predict(state)
            self._state = state
        with self._timed(spent, "segmentation"):
            class_map = self.segmenter.segment(frame)
        try:
            metric = self._depth.make(
                frame, class_map, self.camera, state=self._state, spent=spent.__setitem__
            )
        except AnswerError as error:
            metric = MetricDepth.refused(str(error))
        depth, corridor, intruding = metric.depth, None, None
        if depth is not None:
            height_px, width_px = depth.depth.shape
            with self._timed(spent, "corridor"):
                view = view_of(frame, self.camera, (width_px, height_px))
                things = class_map.is_above_ground
                velocity = None if self._state is None else self._state.velocity
                corridor = self._corridors.build(depth, view, velocity=velocity, things=things)
            intruding = self._corridors.intruding(depth, view, things=things)
        with self._timed(spent, "mark"):
            seen = MarkView(frame=frame, camera=self.camera, class_map=class_map)
            self._track.see(self._finder.find(seen), frame.captured_s)
            fix = self._track.fix()
            if fix and frame.captured_s - fix.captured_s > _CARRIED_S:
                fix = None
        return Perceived(
            frame=frame,
            class_map=class_map,
            depth=depth,
            refusal=metric.refusal,
            scale=metric.scale,
            confidences=metric.confidences,
            corridor=corridor,
            intruding=intruding,
            mark=fix,
            stage_s=spent,
        )

    @contextmanager
    def _timed(self, spent: dict[str, float], stage: str) -> Iterator[None]:
        begin_s = self.timer()
        yield
        spent[stage] = self.timer() - begin_s
