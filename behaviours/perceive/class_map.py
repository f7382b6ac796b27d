"""The perception leaves: they stand ahead of the mission and fill the board, one network each."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Self

from behaviours.stage_timer import StageTimer
from perception.networks.named import segmentation_file
from uav_bt.board import (
    CAMERA,
    CLASS_MAP,
    FRAME,
    HELIPAD,
    OBSTACLES,
    ODOMETRY,
    SITE_MAP,
    STATE,
)
from uav_bt.board.context import MissionContext
from uav_bt.errors import FileError
from uav_bt.protocols import Segmenter
from uav_bt.tree import Leaf, Port, Status
from uav_bt.types import PAD_HEIGHT_M, CameraModel, ClassMap, Frame

if TYPE_CHECKING:
    from perception.mapping.site_mapper import SiteMapperConfig


def _mapping_file(classes: str) -> None:
    if classes and not Path(classes).is_file():
        raise FileError(classes, "there is no such class-mapping file")


class Segment(Leaf):
    """Segment each new frame into the seventeen classes; SUCCESS always, staleness shows by age."""

    ports = (
        Port(
            *("model", str),
            default="unet",
            doc="'unet', 'unet-fp32', 'teacher', or an ONNX file",
            look_up=segmentation_file,
        ),
        Port(
            *("classes", str),
            default="",
            doc="class-mapping file of a foreign ONNX network",
            look_up=_mapping_file,
        ),
    )
    reads = (FRAME,)
    writes = (CLASS_MAP,)

    def on_setup(self, mission: MissionContext) -> None:
        """Load the network; raises WeightsError or FileError when it cannot be."""
        self._segmenter = mission.segmenter or self._load(mission.inference_threads)
        if mission.ground:
            from perception.segmentation.mapping import CountedAsCarpet  # noqa: PLC0415 - late, as below

            self._segmenter = CountedAsCarpet(self._segmenter, mission.ground)
        self._timer = StageTimer(mission, "segmentation")
        self._last_index = -1

    def update(self) -> Status:
        """Segment the frame if it is a new one."""
        frame = self.read(FRAME).value
        if frame is not None and frame.index != self._last_index:
            self._last_index = frame.index
            with self._timer:
                class_map = self._segmenter.segment(frame)
            self.write(CLASS_MAP, class_map, captured_s=frame.captured_s)
        return Status.SUCCESS

    def _load(self, threads: int) -> Segmenter:
        # Late: an inference runtime takes seconds to import and `uav-bt check` must answer at once.
        from perception.segmentation import runtime  # noqa: PLC0415
        from perception.segmentation.mapping import read_mapping  # noqa: PLC0415

        model, classes = self.port_value("model"), self.port_value("classes")
        path = segmentation_file(model)
        if path is None:
            return runtime.shipped_teacher()
        mapping = read_mapping(Path(classes)) if classes else None
        return runtime.OnnxSegmenter(path, mapping=mapping, threads=threads)


class FindHelipad(Leaf):
    """Find the helipad in each new class map and carry it through misses; SUCCESS always."""

    ports = (
        Port(
            *("pad_height_m", float),
            default=PAD_HEIGHT_M,
            least=0,
            most=2,
            doc="top of the helipad above the carpet, m",
        ),
    )
    reads = (STATE, FRAME, CLASS_MAP, CAMERA, ODOMETRY, SITE_MAP)
    writes = (HELIPAD,)

    def on_setup(self, mission: MissionContext) -> None:
        """Make the finder."""
        from perception.landing.tracker import HelipadFinder  # noqa: PLC0415  (OpenCV is heavy)

        self._finder = HelipadFinder(pad_height_m=self.port_value("pad_height_m"))
        self._timer = StageTimer(mission, "helipad")
        self._last_s, self._map_restarts = -1.0, 0

    def on_inherit(self, former: Self) -> None:
        """Keep the helipad's track, unless the pad is another now."""
        if self.port_value("pad_height_m") == former.port_value("pad_height_m"):
            self._finder, self._last_s = former._finder, former._last_s
            self._map_restarts = former._map_restarts

    def update(self) -> Status:
        """Follow the drone's motion, and take in a new class map."""
        state = self.read(STATE).value
        if state is None:
            return Status.SUCCESS
        site_map, motion = self.read(SITE_MAP).value, self.read(ODOMETRY).value
        if site_map is not None and site_map.restarts > self._map_restarts:
            self._map_restarts = site_map.restarts
            self._finder.forget()  # it was carried to where the drone no longer is
        # The pad stands still on the ground, whatever telemetry takes for the drone's motion.
        over_ground = state if motion is None else motion.over_ground(state)
        self._finder.predict(over_ground, self.clock.now())
        class_map = self.read(CLASS_MAP).value
        if class_map is None:
            self._finder.miss()
        elif class_map.captured_s != self._last_s:
            self._last_s = class_map.captured_s
            frame, camera = self.read(FRAME).value, self.read(CAMERA).value
            with self._timer:
                if frame is None or camera is None or frame.captured_s != self._last_s:
                    self._finder.miss()
                else:
                    self._finder.see(class_map, frame, camera)
        fix = self._finder.fix()
        if fix is not None:
            self.write(HELIPAD, fix, captured_s=fix.captured_s)
        return Status.SUCCESS


class RememberObstacles(Leaf):
    """Keep the map of the place, and where obstacles stand around the drone; SUCCESS always.

    What that takes, how the drone moves over the ground, it writes to the board, too. `FindHelipad`
    ahead of it puts the landing mark on the map.
    """

    mapping: ClassVar[SiteMapperConfig | None] = None  # how the map is kept; None: as it ships
    reads = (STATE, FRAME, CLASS_MAP, CAMERA, HELIPAD)
    writes = (OBSTACLES, ODOMETRY, SITE_MAP)

    def on_setup(self, mission: MissionContext) -> None:
        """Make the memory and the map."""
        from perception.mapping.site_mapper import SiteMapper  # noqa: PLC0415 - late, as above
        from perception.obstacles.memory import ObstacleMemory  # noqa: PLC0415 - late, as above

        self._memory, self._mapper = ObstacleMemory(), SiteMapper(self.mapping)
        self._timer = StageTimer(mission, "obstacles")
        self._map_timer = StageTimer(mission, "map")
        self._last_s = -1.0

    def on_inherit(self, former: Self) -> None:
        """Keep the memory and the map, and with them where the drone is on it."""
        self._memory, self._mapper = former._memory, former._mapper
        self._last_s = former._last_s

    def update(self) -> Status:
        """Follow the drone's motion, and take in a new class map."""
        state = self.read(STATE).value
        if state is None:
            return Status.SUCCESS
        self._memory.predict(state, self.clock.now())
        self._look()
        motion = self._memory.motion
        if motion is not None:
            self.write(ODOMETRY, motion, captured_s=motion.pose.time_s)
        return Status.SUCCESS

    def _look(self) -> None:
        frame, camera = self.read(FRAME).value, self.read(CAMERA).value
        class_map = self.read(CLASS_MAP).value
        if frame is None or camera is None or class_map is None:
            return
        if self._last_s != class_map.captured_s == frame.captured_s:
            self._last_s = class_map.captured_s
            height_px, width_px = class_map.ids.shape
            self._take_in(class_map, frame, camera.resized(width_px, height_px))
        points = self._memory.points()
        self.write(OBSTACLES, points, captured_s=points.captured_s)

    def _take_in(self, class_map: ClassMap, frame: Frame, camera: CameraModel) -> None:
        with self._timer:
            scan = self._memory.update(class_map, frame, camera)
        motion = self._memory.motion
        if motion is None:
            return
        with self._map_timer:
            restarts = self._mapper.restarts
            self._mapper.follow(motion)
            if scan is not None:
                self._mapper.see(scan, frame, camera)
                # What moves is remembered for as long as the map carries it, not as what stands.
                until_s = frame.captured_s + self._mapper.config.movers.life_s
                self._memory.forget_by(until_s, self._mapper.trails_m())
            fix = self.read(HELIPAD).value
            if fix is not None and fix.detected:
                self._mapper.see_mark(fix)
            site_map = self._mapper.map()
            if site_map.restarts > restarts:
                self._memory.forget()  # what was placed by the map that was given up
        self.write(SITE_MAP, site_map, captured_s=frame.captured_s)
