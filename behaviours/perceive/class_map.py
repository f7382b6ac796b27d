"""Perception leaves for the class map and the landing mark; they tick before the others."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Final, Self

from behaviours.ports import StageTimer
from perception.networks.weights_file import segmentation_file
from uav_bt.board import CAMERA, CLASS_MAP, FRAME, MARK, ODOMETRY, RELATIVE_DEPTH, SITE_MAP, STATE
from uav_bt.board.context import MissionContext
from uav_bt.errors import AnswerError, FileError
from uav_bt.files import did_you_mean_file
from uav_bt.landing_marks import MarkSighting, MarkView
from uav_bt.plugins import make_mark_finder
from uav_bt.protocols import DepthBeside, Segmenter
from uav_bt.tree import Leaf, Port, Status
from uav_bt.types import ClassMap, Frame, Pose2D
from uav_bt.types.site_map import SiteMap

_MODEL: Final = "'unet', 'any' (any room, by roles), 'teacher', or an ONNX file"
_SPOT: Final = "spot"  # registered name of the take-off spot as a landing mark
_MARK: Final = "place: the mark of the scene, the site or the lab. spot: the take-off spot"
_CLASSES: Final = "class-mapping file of a foreign ONNX network"


def _mapping_file(classes: str) -> None:
    if classes and not Path(classes).is_file():
        hint = did_you_mean_file(Path(classes))
        raise FileError(classes, f"there is no such class-mapping file{hint}")


class Segment(Leaf):
    """Segment each new frame into the classes of the lab; SUCCESS always.

    A network with a second head writes the relative depth of the frame, too. A frame for which the
    network gives NaN has no class map. The age of the class map on the board shows staleness.
    """

    answers = (Status.SUCCESS,)
    ports = (
        Port("model", str, default="unet", doc=_MODEL, look_up=segmentation_file, at_setup=True),
        Port("classes", str, default="", doc=_CLASSES, look_up=_mapping_file, at_setup=True),
    )
    reads = (FRAME,)
    writes = (CLASS_MAP, RELATIVE_DEPTH)
    _network: Segmenter
    _segmenter: Segmenter  # the network, or the same with further classes as ground

    def on_setup(self, mission: MissionContext) -> None:
        """Load the network; raises WeightsError or FileError when it cannot be loaded."""
        self._network = self._segmenter = mission.segmenter or self._load(mission)
        if mission.ground:
            from perception.networks.mapping import CountedAsGround  # noqa: PLC0415 - late, as below

            self._segmenter = CountedAsGround(self._network, mission.classes, mission.ground)
        self._timer = StageTimer(mission, "segmentation")
        self._last_index = -1

    def on_inherit(self, former: Self) -> None:
        """Keep the network that the former leaf has decided for."""
        ports = ("model", "classes")
        if all(self.port_value(port) == former.port_value(port) for port in ports):
            self._network, self._segmenter = former._network, former._segmenter

    def update(self) -> Status:
        """Segment the frame if it is a new one."""
        frame = self.read(FRAME).value
        if frame is None or frame.index == self._last_index:
            return Status.SUCCESS
        self._last_index = frame.index
        try:
            with self._timer:
                class_map = self._segmenter.segment(frame)
        except AnswerError as error:
            self.mission.warn_once(f"no class map: {error}", self.path)
            return Status.SUCCESS
        self.write(CLASS_MAP, class_map, captured_s=frame.captured_s)
        network = self._network
        depth = network.relative_depth if isinstance(network, DepthBeside) else None
        if depth is not None:
            self.write(RELATIVE_DEPTH, depth, captured_s=depth.captured_s)
        return Status.SUCCESS

    def _load(self, mission: MissionContext) -> Segmenter:
        # Late: an inference runtime takes seconds to import; `uav-bt check` must answer at once.
        from perception.networks.mapping import read_mapping  # noqa: PLC0415
        from perception.segmentation import runtime  # noqa: PLC0415

        classes = self.port_value("classes")
        path = segmentation_file(self.port_value("model"))
        if path is None:
            return runtime.shipped_teacher(mission.classes)
        mapping = read_mapping(Path(classes), mission.classes) if classes else None
        threads = mission.inference_threads
        return runtime.load_segmenter(path, mission.classes, mapping, threads=threads)


class FindMark(Leaf):
    """Find the landing mark in each new view and track it through misses; SUCCESS always.

    Kind, size and height of the mark are those of the lab, the site or the scene. With
    `mark="spot"` it is the take-off spot, recognised by the texture of the ground. For that the
    camera looks straight down after the take-off, before the drone flies away.
    """

    answers = (Status.SUCCESS,)
    ports = (
        Port("mark", str, default="place", choices=("place", _SPOT), doc=_MARK, at_setup=True),
    )
    reads = (STATE, FRAME, CLASS_MAP, CAMERA, ODOMETRY, SITE_MAP)
    writes = (MARK,)

    def on_setup(self, mission: MissionContext) -> None:
        """Make the finder of the mark; raises InputError if the mark's options are wrong."""
        from perception.marks.region import RegionFinder  # noqa: PLC0415  (OpenCV is heavy)
        from perception.marks.tracker import MarkTracker  # noqa: PLC0415  (filterpy is heavy)

        mark, at_spot = mission.mark, self.port_value("mark") == _SPOT
        if at_spot:
            mark = replace(mark, kind=_SPOT, height_m=0.0, options={})
        self._finder, self._track = make_mark_finder(mark), MarkTracker()
        if isinstance(self._finder, RegionFinder):
            self._finder.top_id(mission.classes)  # refuses an unknown class before the take-off
        # A drone without images sees the mark of the scene, and no texture.
        self._sight = mission.sight if self._finder.uses_images and not at_spot else None
        self._timer = StageTimer(mission, "mark")
        self._last_s, self._map_restarts = -1.0, 0
        self._take_off: Pose2D | None = None  # in the frame of the track

    def on_inherit(self, former: Self) -> None:
        """Keep the track of the same mark, and the state of its finder."""
        if self.port_value("mark") == former.port_value("mark"):
            self._finder, self._track, self._last_s = former._finder, former._track, former._last_s
        self._map_restarts, self._take_off = former._map_restarts, former._take_off

    def update(self) -> Status:
        """Move the track with the drone, and search a new view for the mark."""
        state = self.read(STATE).value
        if state is None:
            return Status.SUCCESS
        site_map, motion = self.read(SITE_MAP).value, self.read(ODOMETRY).value
        if site_map is not None and site_map.restarts > self._map_restarts:
            self._map_restarts = site_map.restarts
            self._track.forget()  # the track is relative to the drone's pose before the restart
        self._note_take_off(site_map)
        # The mark is fixed to the ground, so it is moved by the motion over the ground, not by
        # telemetry's.
        over_ground = state if motion is None else motion.over_ground(state)
        self._track.predict(over_ground, self.clock.now())
        if self._take_off is None:
            self._take_off = self._track.pose_at(math.inf)
        frame, class_map = self.read(FRAME).value, self.read(CLASS_MAP).value
        view = frame if self._finder.uses_images else class_map
        if view is None:
            self._track.see(None, self._last_s)
        elif view.captured_s != self._last_s:
            self._last_s = view.captured_s
            with self._timer:
                self._track.see(self._sighting(frame, class_map), self._last_s)
        fix = self._track.fix()
        if fix is not None:
            self.write(MARK, fix, captured_s=fix.captured_s)
        return Status.SUCCESS

    def _note_take_off(self, site_map: SiteMap | None) -> None:
        """Take the take-off pose of the map, as the track still is, into the track's frame."""
        here = self._track.pose_at(math.inf)
        if site_map is not None and here is not None:
            self._take_off = here.pose_to_world(site_map.pose.pose_to_body(site_map.start))

    def _sighting(self, frame: Frame | None, class_map: ClassMap | None) -> MarkSighting | None:
        """Return the mark in the newest view; a class map of another frame shows none."""
        camera = self.read(CAMERA).value
        if frame is None or camera is None or frame.captured_s != self._last_s:
            return None
        if self._sight is not None:
            return self._sight.mark(frame)
        pose, off = self._track.pose_at(self._last_s), self._take_off
        take_off = None if pose is None or off is None else pose.pose_to_body(off)
        view = MarkView(frame=frame, camera=camera, class_map=class_map, take_off=take_off)
        return self._finder.find(view)
