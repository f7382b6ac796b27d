"""View of a flight in Rerun: one function draws a tick, of a live flight or of a record.

The world has z up and yaw counter-clockwise. The body's telemetry has z down and yaw clockwise.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Final

import cv2
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from uav_bt.board.blackboard import Blackboard
from uav_bt.display.canvas import ACCENT, ALARM, INK, Colour, resized, tag
from uav_bt.display.flown_path import FlownPath, Shown
from uav_bt.display.lab_drawing import GROUND_COLOUR
from uav_bt.display.lab_map import LabMap, MapItem, phase_colours
from uav_bt.display.map_pane import MapPane
from uav_bt.display.phrases import describe_corridor, describe_movement
from uav_bt.display.rerun.layout import TIMELINE, ViewSetting
from uav_bt.display.video.panes import draw_frame
from uav_bt.display.video.perception_panes import FARTHEST_M, intruding_pixels
from uav_bt.lab.classes import OUTSIDE
from uav_bt.mission.tick import TickRecord
from uav_bt.record.images import encode_image
from uav_bt.tree.status import FAILURE, IDLE, RUNNING, SUCCESS, Status
from uav_bt.types import CameraModel, Pose, projection, rotate
from uav_bt.types.arrays import Floats, Image
from uav_bt.types.dead_reckoning import PoseHistory

SIGNS: Final[Mapping[Status, str]] = {RUNNING: "▶", SUCCESS: "✔", FAILURE: "✘", IDLE: "·"}
_FREE: Final[Colour] = (120, 170, 255)
_SHOWN_M: Final = 0.35  # distance of the image from the lens in the 3D view
_NO_IMAGE_M: Final = 1e-3  # the same for depth: so small that its frustum is invisible
_KEPT_S: Final = 2.0  # history of poses; older frames are not drawn
_IMAGE_PX: Final = 640  # least width of the camera's image
_MAP_PX: Final = (640, 520)
_MAP_S: Final = 0.5  # time between images of the site map, which changes with every view

Moment = tuple[Shown, Mapping[str, Status]]  # a tick, and the statuses of the nodes by path


class FlightView:
    """Draws a flight into an open Rerun recording; a tick listener.

    `board` and `statuses` (of the nodes, by path) are those after each tick. The timeline begins
    at a mission time, by default that of the first tick.
    """

    def __init__(
        self,
        stream: rr.RecordingStream,
        setting: ViewSetting,
        board: Blackboard,
        statuses: Callable[[], Mapping[str, Status]],
        *,
        start_s: float | None = None,
    ) -> None:
        # Only mission time: a record must give the same drawing at any date.
        stream.set_log_time_enabled(False)
        stream.set_log_tick_enabled(False)
        self._stream = stream
        self._setting = setting
        self._camera = _shown_camera(setting.camera)
        self._board = board
        self._statuses = statuses
        self._start_s = start_s
        self._flown = FlownPath()
        self._poses = PoseHistory[Pose](_KEPT_S)
        self._map = MapPane(setting.lab_map, setting.camera, _MAP_PX)
        self._map_s = -math.inf  # time of the last image of the site map
        self._last: dict[str, object] = {}  # what was drawn last, by entity; None: nothing
        if setting.title:
            stream.send_recording_name(setting.title)
        for entity, thing in _constants(setting):
            stream.log(entity, thing, static=True)

    def on_tick(self, record: TickRecord) -> None:
        """Draw a tick."""
        self.draw(self.take(record))

    def take(self, record: TickRecord) -> Moment:
        """Return what is to be drawn of a tick; it does not change any more."""
        return Shown.of(record, self._flown, self._board), dict(self._statuses())

    def draw(self, moment: Moment) -> None:
        """Draw a moment; each is later than the one before."""
        shown, statuses = moment
        record = shown.record
        if self._start_s is None:
            self._start_s = record.time_s
        self._stream.set_time(TIMELINE, duration=record.time_s - self._start_s)
        before, pose = self._flown.pose, self._flown.add(record)
        self._poses.add(record.time_s, pose)
        self._stream.log("world/drone", _placed(pose))
        for mover in self._flown.movers:
            self._stream.log(f"world/lab/{mover.name}", _placed(mover.pose))
        if before is not None:
            ends = [[one.x_m, one.y_m, one.z_m] for one in (before, pose)]
            colour = phase_colours(self._flown.phases)[record.phase]
            piece = rr.LineStrips3D([ends], colors=[colour], radii=0.012)
            self._stream.log("world/path", piece)
        self._draw_frame(shown)
        self._draw_perceived(shown)
        self._draw_map(shown, pose)
        self._draw_tree(statuses)
        self._draw_words(record)
        for curve, value in _curves(shown).items():
            known = math.nan if value is None or math.isinf(value) else value  # a gap
            self._stream.log(f"plots/{curve}", rr.Scalars(known))

    def _is_new(self, entity: str, value: object) -> bool:
        """Return whether an entity is to be drawn for a value; None clears what is there."""
        if value == self._last.get(entity):
            return False
        self._last[entity] = value
        if value is None:
            self._stream.log(entity, rr.Clear(recursive=False))
        return value is not None

    def _draw_frame(self, shown: Shown) -> None:
        """Draw a new image, with what is known of it, at the pose of its capture."""
        frame, camera = shown.frame, self._camera
        if frame is None or not self._is_new("world/camera/image", frame.index):
            return
        size_px = (camera.width_px, camera.height_px)
        image = draw_frame(frame, shown.fix.value, camera, size_px)
        if shown.class_map is not None:
            for class_ in np.unique(shown.class_map.ids).tolist():
                if class_ != OUTSIDE:
                    mask = shown.class_map.ids == class_
                    _outline(image, mask, self._setting.classes.colours[class_].tolist())
        inside = intruding_pixels(self._setting.intruding, shown)
        if inside is not None and shown.corridor is not None:
            _outline(image, inside, ALARM)
            tag(image, describe_corridor(shown.corridor), (10, 10), colour=ALARM)
        self._stream.log("world/camera/image", _jpeg(image))
        pose = self._poses.at(frame.captured_s)
        if pose is not None:
            lens = rr.Transform3D(
                translation=[*pose.to_world(camera.forward_offset_m, 0.0), pose.z_m],
                mat3x3=camera_axes(pose.yaw_rad, frame.gimbal_pitch_rad),
            )
            self._stream.log("world/camera", lens)
            self._stream.log("world/depth", lens)

    def _draw_perceived(self, shown: Shown) -> None:
        """Draw new masks, depth and corridors; the last at the pose of its frame's capture."""
        class_map, depth, corridor = shown.class_map, shown.depth.value, shown.corridor
        time_s = None if class_map is None else class_map.captured_s
        if self._is_new("mask/ids", time_s) and class_map is not None:
            self._stream.log("mask/ids", rr.SegmentationImage(class_map.ids))
        time_s = None if depth is None else depth.captured_s
        if self._is_new("world/depth/metres", time_s) and depth is not None:
            height_px, width_px = depth.depth.shape
            if self._is_new("world/depth", (width_px, height_px)):
                lens = self._setting.camera.resized(width_px, height_px)
                self._stream.log("world/depth", _pinhole(lens, _NO_IMAGE_M))
            # Half precision resolves 2 mm at 4 m and halves the size.
            metres = np.where(np.isfinite(depth.depth), depth.depth, np.nan).astype(np.float16)
            look: dict[str, Any] = {"colormap": "turbo", "depth_range": [0.0, FARTHEST_M]}
            self._stream.log("world/depth/metres", rr.DepthImage(metres, meter=1.0, **look))
        size_m = self._setting.corridor_m
        time_s = None if corridor is None or size_m is None else corridor.captured_s
        pose = None if time_s is None else self._poses.at(time_s)
        if self._is_new("world/corridor", time_s) and corridor and size_m and pose:
            side_m, front_m, up_m = size_m
            box = rr.Boxes3D(
                centers=[[front_m / 2.0, 0.0, 0.0]],
                half_sizes=[[front_m / 2.0, side_m, up_m]],
                colors=[_FREE if corridor.nearest_side is None else ALARM],
                labels=[describe_corridor(corridor)],
            )
            self._stream.log("world/corridor", _placed(pose), box)

    def _draw_map(self, shown: Shown, pose: Pose) -> None:
        """Draw the obstacles and edges near the drone, the estimated mark, and the site map."""
        record, site_map, fix = shown.record, shown.site_map, shown.fix.value
        near = None if site_map is None else site_map.near
        there = near is not None and len(near.points_m) + len(near.edges_m) > 0
        if self._is_new("world/obstacles", record.time_s if there else None) and near is not None:
            places_m = _on_ground(pose, np.vstack([near.points_m, near.edges_m]))
            colours = [ALARM] * len(near.points_m) + [INK] * len(near.edges_m)
            self._stream.log("world/obstacles", rr.Points3D(places_m, colors=colours, radii=0.03))
        if self._is_new("world/mark_fix", None if fix is None else (fix, pose)) and fix is not None:
            at = _on_ground(pose, np.array([[fix.forward_m, fix.right_m]]))
            colours, radius_m = [ACCENT if fix.detected else INK], max(fix.std_m, 0.05)
            mark = rr.Points3D(at, colors=colours, radii=radius_m, labels=["mark"])
            self._stream.log("world/mark_fix", mark)
        if self._setting.makes_map:
            drawn = self._map.draw(shown)  # it needs every tick
            if site_map is not None and record.time_s - self._map_s >= _MAP_S - 1e-6:
                self._map_s = record.time_s
                self._stream.log("site_map", _jpeg(drawn))

    def _draw_tree(self, statuses: Mapping[str, Status]) -> None:
        """Draw the tree as in its file when a status changes; missing nodes are idle."""
        lines = [
            f"{'    ' * level}{SIGNS[statuses.get(path, IDLE)]} {label}"
            for path, label, level in self._setting.tree
        ]
        if lines and self._is_new("tree", lines):
            self._stream.log("tree", rr.TextDocument("\n".join(lines)))

    def _draw_words(self, record: TickRecord) -> None:
        """Log phase, active leaf and command when they change."""
        leaf = record.active[-1] if record.active else "idle"
        why = f" ({record.feedback})" if record.feedback else ""
        act = describe_movement(record.command.movement)
        override = "" if record.override is None else f" [{record.override.value}]"
        words = f"{record.phase or '-'}: {leaf}{why}: {act}{override}"
        if self._is_new("words", words):
            log = rr.TextLog(words, level="WARN" if override else "INFO")
            self._stream.log("words", log)


def _constants(setting: ViewSetting) -> Iterator[tuple[str, Any]]:
    """Yield the entities that stay, with what is drawn there."""
    yield "world", rr.ViewCoordinates.RIGHT_HAND_Z_UP
    half = [size_m / 2.0 for size_m in setting.airframe.body_size_m]
    yield "world/drone/hull", rr.Boxes3D(half_sizes=[half], colors=[INK], fill_mode="solid")
    nose: dict[str, Any] = {"origins": [[half[0], 0.0, 0.0]], "vectors": [[0.15, 0.0, 0.0]]}
    yield "world/drone/nose", rr.Arrows3D(**nose, colors=[ACCENT], radii=0.012)
    yield "world/camera", _pinhole(_shown_camera(setting.camera), _SHOWN_M)
    classes = zip(setting.classes.names, setting.classes.colours.tolist(), strict=True)
    infos = [(place, name, tuple(colour)) for place, (name, colour) in enumerate(classes)]
    yield "mask", rr.AnnotationContext(infos)
    if setting.lab_map is not None:
        yield from _lab(setting.lab_map)


def _lab(lab: LabMap) -> Iterator[tuple[str, Any]]:
    """Yield ground, boxes, mark and movers of a lab."""
    wide, deep = lab.ground_size_m
    slab: dict[str, Any] = {
        "centers": [[0.0, 0.0, -0.005]],
        "half_sizes": [[wide / 2.0, deep / 2.0, 0.005]],
    }
    yield "world/lab/ground", rr.Boxes3D(**slab, colors=[GROUND_COLOUR], fill_mode="solid")
    solids = [solid for item in (*lab.boxes, lab.mark) if item for solid in _solids(item)]
    if solids:
        centres, halves, turns, colours = zip(*solids, strict=True)
        axes = [rr.RotationAxisAngle(axis=[0.0, 0.0, 1.0], radians=turn) for turn in turns]
        shape: dict[str, Any] = {"centers": centres, "half_sizes": halves, "rotations": axes}
        yield "world/lab/things", rr.Boxes3D(**shape, colors=colours, fill_mode="solid")
        frame: dict[str, Any] = {"radii": 0.004, "fill_mode": "majorwireframe"}
        yield "world/lab/edges", rr.Boxes3D(**shape, colors=[INK], **frame)
    for number, mover in enumerate(lab.movers, start=1):
        size_m, colour = mover.item.size_m, [mover.item.colour]
        half = [side / 2.0 for side in size_m]
        round_: dict[str, Any] = {"lengths": [size_m[2]], "radii": [half[0]]}
        yield (
            f"world/lab/mover-{number}",
            rr.Cylinders3D(**round_, colors=colour)
            if mover.item.round
            else rr.Boxes3D(half_sizes=[half], colors=colour),
        )


def _solids(item: MapItem) -> Iterator[tuple[list[float], list[float], float, Colour]]:
    """Yield centre, half size, yaw and colour of the boxes that an object consists of."""
    for part in item.parts:
        outline, half_m = part.footprint, (part.top_m - part.base_m) / 2.0
        centre = [outline.x_m, outline.y_m, part.base_m + half_m]
        half = [outline.half_x_m, outline.half_y_m, half_m]
        yield centre, half, item.yaw_rad, item.colour
    if not item.parts:
        half = [side / 2.0 for side in item.size_m]
        yield [item.x_m, item.y_m, half[2]], half, item.yaw_rad, item.colour


def _shown_camera(camera: CameraModel) -> CameraModel:
    """Return a camera with room in its image for text."""
    scale = max(1, round(_IMAGE_PX / camera.width_px))
    return camera.resized(scale * camera.width_px, scale * camera.height_px)


def _pinhole(camera: CameraModel, image_m: float) -> rr.Pinhole:
    return rr.Pinhole(
        focal_length=[camera.fx_px, camera.fy_px],
        # Rerun measures from the corner of a pixel, OpenCV from its centre.
        principal_point=[camera.cx_px + 0.5, camera.cy_px + 0.5],
        resolution=[camera.width_px, camera.height_px],
        camera_xyz=rr.ViewCoordinates.RDF,
        image_plane_distance=image_m,
    )


def camera_axes(yaw_rad: float, pitch_rad: float) -> Floats:
    """Return the camera's axes (x right, y down, z forward) in the world, the columns of (3, 3)."""
    forward, right = rotate(1.0, 0.0, yaw_rad), rotate(0.0, -1.0, yaw_rad)
    level = np.array([[*forward, 0.0], [*right, 0.0], [0.0, 0.0, -1.0]]).T
    return np.asarray(level @ projection.camera_axes(pitch_rad))


def _placed(pose: Pose) -> rr.Transform3D:
    turn = rr.RotationAxisAngle(axis=[0.0, 0.0, 1.0], radians=pose.yaw_rad)
    return rr.Transform3D(translation=[pose.x_m, pose.y_m, pose.z_m], rotation=turn)


def _on_ground(pose: Pose, points_m: Floats) -> Floats:
    """Return points on the ground, given forward and right of the body, as world points (N, 3)."""
    return np.column_stack([pose.points_to_world(points_m * (1.0, -1.0)), np.zeros(len(points_m))])


def _outline(image: Image, mask: NDArray[np.bool_], colour: Sequence[int]) -> None:
    """Draw the outline of a mask of any size on an image."""
    whole = resized(mask.view(np.uint8), (image.shape[1], image.shape[0]))
    found, _ = cv2.findContours(whole, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    cv2.drawContours(image, found, -1, tuple(colour), 2)


def _jpeg(image: Image) -> rr.EncodedImage:
    return rr.EncodedImage(contents=encode_image(image, "high")[0], media_type="image/jpeg")


def _curves(shown: Shown) -> dict[str, float | None]:
    """Return the newest value of each curve."""
    record, fix, corridor = shown.record, shown.fix.value, shown.corridor
    state, truth = record.observation.state, record.truth
    near = None if shown.site_map is None else shown.site_map.near
    return {
        "heading/telemetry": math.degrees(state.attitude.yaw_rad),
        "heading/mark": None if fix is None else math.degrees(fix.bearing_rad),
        "height/telemetry": state.height_above_ground_m,
        "height/true": None if truth is None else truth.pose.z_m,
        "free_distance/ahead": None if corridor is None else corridor.free_distance_m,
        "free_distance/intrusion": None if corridor is None else corridor.nearest_m,
        "free_distance/remembered": None if near is None else near.nearest_m,
        "free_distance/clearance": None if truth is None else truth.clearance_m,
        "tick_time/compute": 1000.0 * record.compute_s,
    }
