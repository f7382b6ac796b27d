"""Films and the status line of a flight, with the values of its lab."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from behaviours.perceive.depth import BuildCorridor
from perception.camera.ground_plane import view_of
from sim_bridge.twin.objects import PlacedObject
from sim_bridge.twin.scene import Scene
from uav_bt.app.assembly import Flight, Listeners
from uav_bt.board import METRIC_DEPTH, SITE_MAP
from uav_bt.display.lab_map import LabMap, MapItem
from uav_bt.display.phrases import describe_flight, lands_on_mark
from uav_bt.display.shown import FlightFacts, Intruding
from uav_bt.display.status import LiveStatus
from uav_bt.display.video.video import FlightVideo
from uav_bt.display.video.video_file import VideoFile
from uav_bt.lab.obj_file import pieces
from uav_bt.lab.room import ON_WALL
from uav_bt.mission.flight_report import FlightReport
from uav_bt.plugins import make_mark_finder
from uav_bt.protocols import Drone
from uav_bt.tree import MissionTree
from uav_bt.types import CameraModel, ClassMap, DepthMap, Frame, LandingMark
from uav_bt.types.ground import Footprint


def map_of_scene(scene: Scene) -> LabMap:
    """Return the map of a scene of the twin, boxes in the colours of their class."""
    classes, pad = scene.classes, scene.helipad

    def item(class_id: int, outline: Footprint, height_m: float, **more: Any) -> MapItem:
        red, green, blue = classes.colours[class_id].tolist()
        known = {"colour": (red, green, blue), "name": classes.names[class_id]}
        return MapItem(**vars(outline), height_m=height_m, **known | more)

    movers = []
    for mover in scene.movers:
        class_id, outline = scene.shape_of(mover).class_id, mover.footprint(*mover.path_m[0])
        path_m = (*mover.path_m, mover.path_m[0]) if mover.loop else mover.path_m
        movers.append(item(class_id, outline, mover.size_m[2], path_m=path_m))
    mark = None
    if pad is not None:
        top = make_mark_finder(pad.mark).picture()
        mark = item(scene.mark_class, pad.footprint, pad.size_m[2], picture=top)
    return LabMap(
        ground=scene.ground,
        boxes=tuple(
            item(
                one.shape.class_id,
                one.footprint,
                one.standing.height_m,
                parts=one.standing.parts,
                pieces_m=tuple(_outlines_m(one)),
                **({"name": one.spec.kind} if one.shape.kind.shape in ON_WALL else {}),
            )
            for one in scene.placed
        ),
        mark=mark,
        movers=tuple(movers),
        take_off=scene.take_off_pose,
    )


def _outlines_m(placed: PlacedObject) -> Iterator[list[tuple[float, float]]]:
    """Yield the outline of each piece of a mesh, where it stands; nothing for other shapes."""
    for piece in [] if placed.shape.mesh is None else pieces(placed.shape.mesh):
        hull = cv2.convexHull(piece[..., :2].reshape(-1, 2).astype(np.float32))[:, 0]
        yield [placed.pose.to_world(x_m, y_m) for x_m, y_m in hull.tolist()]


def facts_of_flight(flight: Flight[Drone], title: str = "") -> FlightFacts:
    """Return the facts of a connected flight; default title: mission, scene and seed."""
    drone, options, mission = flight.drone, flight.options, flight.mission
    name, seed = options.drone_name, options.seed
    usual = describe_flight(mission.origin, scene=flight.scene_name, drone=name, seed=seed)
    return facts_of(
        mission,
        drone.camera,
        classes=flight.held.classes,
        title=title or usual,
        lab_map=map_of_scene(drone.scene) if isinstance(drone.scene, Scene) else None,
        nodes=tuple((node.path, node.name) for node in mission.nodes()),
        limit_s=flight.held.judge.limit_s,
    )


def facts_of(mission: MissionTree | None, camera: CameraModel, **known: Any) -> FlightFacts:
    """Return facts with those of a mission; None: it is unknown."""
    leaves = () if mission is None else tuple(mission.leaves())
    written = {key for leaf in leaves for key in leaf.writes}
    builders = [leaf for leaf in leaves if isinstance(leaf, BuildCorridor)]
    return FlightFacts(
        camera=camera,
        makes_map=SITE_MAP in written,
        makes_depth=METRIC_DEPTH in written,
        intruding=_marker(builders[0], camera) if len(builders) == 1 else None,
        **known,
    )


def _marker(leaf: BuildCorridor, camera: CameraModel) -> Intruding:
    """Return a function that marks the pixels inside a leaf's corridor."""
    from perception.depth.corridor import CorridorBuilder  # noqa: PLC0415  (Numba is heavy)

    builder, background = CorridorBuilder(leaf.config()), bool(leaf.port_value("background"))

    def intruding(frame: Frame, class_map: ClassMap, depth: DepthMap) -> NDArray[np.bool_]:
        height_px, width_px = depth.depth.shape
        things = ~class_map.is_ground if background else class_map.is_above_ground
        view = view_of(frame, camera, (width_px, height_px))
        return builder.intruding(depth, view, things=things)

    return intruding


def end_film(
    report: FlightReport, *, film: FlightVideo, file: VideoFile, mark: LandingMark
) -> None:
    """Show how the flight ended for a moment, and finish the file."""
    lines, error_m = [report.reason], report.landing_error_m
    if report.duration_s is not None:
        lines.append(f"{report.duration_s:.0f} s, {report.total_distance_m or 0.0:.1f} m flown")
    if error_m is not None and lands_on_mark(report, mark):
        lines.append(f"{100 * error_m:.0f} cm from the mark's centre")
    film.conclude(report.outcome, lines)
    file.close()


@contextmanager
def live_status(console: Console | None = None) -> Iterator[Listeners]:
    """Show the flight that is flown inside in one line, on standard error."""
    with ExitStack() as lines:
        yield lambda flight: [
            lines.enter_context(closing(LiveStatus(flight.context.board, console=console)))
        ]
