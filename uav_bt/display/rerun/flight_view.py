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
import rerun.blueprint as rrb
from numpy.typing import NDArray

from uav_bt.board.blackboard import Blackboard
from uav_bt.display.canvas import ACCENT, ALARM, BACKDROP, INK, Colour, resized, tag
from uav_bt.display.lab_map import GROUND_COLOUR, LabMap, MapItem
from uav_bt.display.map_pane import MapPane
from uav_bt.display.phrases import describe_corridor, describe_movement
from uav_bt.display.shown import FlightFacts, FlownPath, Shown, phase_colours
from uav_bt.display.video.panes import FARTHEST_M, draw_frame
from uav_bt.lab.classes import OUTSIDE
from uav_bt.mission.tick import TickRecord
from uav_bt.record.images import encode_image
from uav_bt.tree.status import FAILURE, IDLE, RUNNING, SUCCESS, Status
from uav_bt.types import Airframe, CameraModel, Pose, projection, rotate
from uav_bt.types.arrays import Floats, Image
from uav_bt.types.dead_reckoning import PoseHistory
from uav_bt.types.ground import Block

_SIGNS: Final[Mapping[Status, str]] = {RUNNING: "▶", SUCCESS: "✔", FAILURE: "✘", IDLE: "·"}
_SHOWN_M: Final = 0.35  # distance of the image from the lens in the 3D view
_NO_IMAGE_M: Final = 1e-3  # the same for depth: so small that its frustum is invisible
_KEPT_S: Final = 2.0  # history of poses; older frames are not drawn
_IMAGE_PX: Final = 640  # least width of the camera's image
_MAP_PX: Final = (640, 520)
_MAP_S: Final = 0.5  # time between images of the site map, which changes with every view
_TIMELINE: Final = "flight"  # seconds since the first tick
_PLOTS: Final = {
    "plots/heading": "Heading, deg",
    "plots/height": "Height, m",
    "plots/free_distance": "Free distance, m",
    "plots/tick_time": "Tick time, ms",
}
_EYE_M: Final = (-1.2, -6.0, 5.2)

Statuses = Mapping[str, Status]  # of the nodes, by path


class FlightView:
    """Draws a flight into an open Rerun recording; a tick listener.

    `board` and `statuses` are those after each tick.
    """

    def __init__(
        self,
        stream: rr.RecordingStream,
        facts: FlightFacts,
        board: Blackboard,
        statuses: Callable[[], Statuses],
    ) -> None:
        # Only mission time: a record must give the same drawing at any date.
        stream.set_log_time_enabled(False)
        stream.set_log_tick_enabled(False)
        self._stream = stream
        self._facts = facts
        self._camera = _shown_camera(facts.camera)
        self._board = board
        self._statuses = statuses
        self._start_s = facts.start_s
        self._flown = FlownPath()
        self._poses = PoseHistory[Pose](_KEPT_S)
        self._map = MapPane(facts, _MAP_PX)
        self._map_s = -math.inf  # time of the last image of the site map
        self._last: dict[str, object] = {}  # what was drawn last, by entity; None: nothing
        stream.send_blueprint(layout(facts))
        stream.send_recording_name(facts.title)
        for entity, thing in _constants(facts):
            stream.log(entity, thing, static=True)

    def on_tick(self, record: TickRecord) -> None:
        """Draw a tick."""
        self.draw(self.take(record))

    def take(self, record: TickRecord) -> tuple[Shown, Statuses]:
        """Return what is to be drawn of a tick; it does not change any more."""
        return Shown(record, self._flown, self._board), dict(self._statuses())

    def draw(self, moment: tuple[Shown, Statuses]) -> None:
        """Draw a moment; each is later than the one before."""
        shown, statuses = moment
        record = shown.record
        if self._start_s is None:
            self._start_s = record.time_s
        self._stream.set_time(_TIMELINE, duration=record.time_s - self._start_s)
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
        if self._facts.makes_map:
            drawn = self._map.draw(shown)  # it needs every tick
            if shown.site_map is not None and record.time_s - self._map_s >= _MAP_S - 1e-6:
                self._map_s = record.time_s
                self._stream.log("site_map", _jpeg(drawn))
        tree, words = self._tree(statuses), _words(record)
        if self._is_new("tree", tree):
            self._stream.log("tree", rr.TextDocument(tree))
        if self._is_new("words", words):
            level = "INFO" if record.override is None else "WARN"
            self._stream.log("words", rr.TextLog(words, level=level))
        for curve, value in _curves(shown).items():
            known = math.nan if value is None or math.isinf(value) else value  # a gap
            self._stream.log(f"plots/{curve}", rr.Scalars(known))

    def _is_new(self, entity: str, value: object) -> bool:
        """Return whether a value is to be drawn; None clears what is there."""
        if value == self._last.get(entity):
            return False
        self._last[entity] = value
        if value is None:
            self._stream.log(entity, rr.Clear(recursive=False))
        return value is not None

    def _draw_frame(self, shown: Shown) -> None:
        """Draw a new image, with what is known of it, at the pose of its capture."""
        frame, camera, class_map = shown.frame, self._camera, shown.class_map
        if frame is None or not self._is_new("world/camera/image", frame.index):
            return
        size_px = (camera.width_px, camera.height_px)
        image = draw_frame(frame, shown.fix.value, camera, size_px)
        if class_map is not None:
            for class_ in np.unique(class_map.ids[class_map.ids != OUTSIDE]).tolist():
                colour = class_map.classes.colours[class_].tolist()
                _outline(image, class_map.ids == class_, colour)
        inside = shown.intruding_pixels(self._facts)
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
        """Draw a new mask and new depth."""
        class_map, depth = shown.class_map, shown.depth.value
        time_s = None if class_map is None else class_map.captured_s
        if self._is_new("mask/ids", time_s) and class_map is not None:
            self._stream.log("mask/ids", rr.SegmentationImage(class_map.ids))
        time_s = None if depth is None else depth.captured_s
        if self._is_new("world/depth/metres", time_s) and depth is not None:
            height_px, width_px = depth.depth.shape
            lens = self._facts.camera.resized(width_px, height_px)
            self._stream.log("world/depth", _pinhole(lens, _NO_IMAGE_M))
            # Half precision resolves 2 mm at 4 m and halves the size.
            metres = np.where(np.isfinite(depth.depth), depth.depth, np.nan).astype(np.float16)
            look: dict[str, Any] = {"colormap": "turbo", "depth_range": [0.0, FARTHEST_M]}
            self._stream.log("world/depth/metres", rr.DepthImage(metres, meter=1.0, **look))

    def _tree(self, statuses: Statuses) -> str:
        """Return the tree as in its file with the statuses; missing nodes are idle."""
        return "\n".join(
            f"{'    ' * (path.count('/') - 1)}{_SIGNS[statuses.get(path, IDLE)]} {name}"
            for path, name in self._facts.nodes
        )


def layout(facts: FlightFacts) -> rrb.Blueprint:
    """Return the layout of a flight without panes that would stay empty."""
    left = [rrb.Spatial2DView(origin="mask", name="Mask")]
    if facts.makes_depth:
        left.append(rrb.Spatial2DView(origin="world/depth", name="Metric depth"))
    camera = rrb.Spatial2DView(origin="world/camera", name="Camera")
    # Each tick adds one piece of the path, so that the path is not stored at every tick.
    so_far = rrb.VisibleTimeRanges(
        timeline=_TIMELINE,
        start=rrb.TimeRangeBoundary.infinite(),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    tabs: list[rrb.View] = [
        rrb.Spatial3DView(
            origin="world",
            name=facts.title or "Lab",
            background=BACKDROP,
            overrides={"world/path": [so_far]},
            eye_controls=rrb.EyeControls3D(position=_EYE_M, look_target=[0.0, 0.0, 0.3]),
        )
    ]
    if facts.makes_map:
        tabs.append(rrb.Spatial2DView(origin="site_map", name="Site map"))
    tabs.append(rrb.TextLogView(origin="words", name="Words"))
    plots = [rrb.TimeSeriesView(origin=origin, name=name) for origin, name in _PLOTS.items()]
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(
                rrb.Vertical(camera, rrb.Horizontal(*left), row_shares=[3, 2]),
                rrb.Tabs(*tabs),
                rrb.TextDocumentView(origin="tree", name="Tree"),
                column_shares=[4, 5, 3],
            ),
            rrb.Horizontal(*plots),
            row_shares=[5, 2],
        ),
        rrb.TimePanel(state="collapsed", timeline=_TIMELINE),
        auto_views=False,
        collapse_panels=True,
    )


def _words(record: TickRecord) -> str:
    """Return phase, active leaf, command and override."""
    leaf = record.active[-1] if record.active else "idle"
    why = f" ({record.feedback})" if record.feedback else ""
    act = describe_movement(record.command.movement)
    override = "" if record.override is None else f" [{record.override.value}]"
    return f"{record.phase or '-'}: {leaf}{why}: {act}{override}"


def _constants(facts: FlightFacts) -> Iterator[tuple[str, Any]]:
    """Yield the entities that stay, with what is drawn there."""
    yield "world", rr.ViewCoordinates.RIGHT_HAND_Z_UP
    half = [size_m / 2.0 for size_m in Airframe().body_size_m]
    yield "world/drone/hull", rr.Boxes3D(half_sizes=[half], colors=[INK], fill_mode="solid")
    nose: dict[str, Any] = {"origins": [[half[0], 0.0, 0.0]], "vectors": [[0.15, 0.0, 0.0]]}
    yield "world/drone/nose", rr.Arrows3D(**nose, colors=[ACCENT], radii=0.012)
    yield "world/camera", _pinhole(_shown_camera(facts.camera), _SHOWN_M)
    classes = zip(facts.classes.names, facts.classes.colours.tolist(), strict=True)
    infos = [(place, name, tuple(colour)) for place, (name, colour) in enumerate(classes)]
    yield "mask", rr.AnnotationContext(infos)
    if facts.lab_map is not None:
        yield from _lab(facts.lab_map)


def _lab(lab: LabMap) -> Iterator[tuple[str, Any]]:
    """Yield ground, boxes, mark and movers of a lab."""
    wide_m, deep_m = lab.ground.size_m
    slab: dict[str, Any] = {
        "centers": [[0.0, 0.0, -0.005]],
        "half_sizes": [[wide_m / 2.0, deep_m / 2.0, 0.005]],
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
        half = [mover.half_x_m, mover.half_y_m, mover.height_m / 2.0]
        yield f"world/lab/mover-{number}", rr.Boxes3D(half_sizes=[half], colors=[mover.colour])


def _solids(item: MapItem) -> Iterator[tuple[list[float], list[float], float, Colour]]:
    """Yield centre, half size, yaw and colour of the boxes that an object consists of."""
    for part in item.parts or (Block(footprint=item, base_m=0.0, top_m=item.height_m),):
        outline, half_m = part.footprint, (part.top_m - part.base_m) / 2.0
        centre = [outline.x_m, outline.y_m, part.base_m + half_m]
        half = [outline.half_x_m, outline.half_y_m, half_m]
        yield centre, half, item.yaw_rad, item.colour


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
    """Return the camera's axes right, down and forward in the world, columns of (3, 3)."""
    forward, right = rotate(1.0, 0.0, yaw_rad), rotate(0.0, -1.0, yaw_rad)
    level = np.array([[*forward, 0.0], [*right, 0.0], [0.0, 0.0, -1.0]]).T
    return np.asarray(level @ projection.camera_axes(pitch_rad))


def _placed(pose: Pose) -> rr.Transform3D:
    turn = rr.RotationAxisAngle(axis=[0.0, 0.0, 1.0], radians=pose.yaw_rad)
    return rr.Transform3D(translation=[pose.x_m, pose.y_m, pose.z_m], rotation=turn)


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
