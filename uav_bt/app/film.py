"""Films and the status line of a flight, with the values of its lab.

`app.fly(tree, video="flight.mp4")` films; with options of the film, or beside another one:

with film.flight_video(Path("flight.mp4"), speed=2.0) as video:
    report = app.fly("survey_and_land", listeners=[video])
    video.conclude(report)
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing, contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from behaviours.perceive.depth import BuildCorridor
from perception.camera.ground_plane import view_of
from sim_bridge.twin.scene import Scene
from uav_bt.app.assembly import Flight, Listeners
from uav_bt.board import METRIC_DEPTH
from uav_bt.display.lab_map import LabMap, MapItem, MapMover
from uav_bt.display.phrases import describe_flight, lands_on_mark
from uav_bt.display.status import LiveStatus
from uav_bt.display.video.perception_panes import Intruding
from uav_bt.display.video.video import FlightVideo, Panes
from uav_bt.lab.shipped import default_mark
from uav_bt.mission.flight_report import FlightReport
from uav_bt.mission.judge import Outcome
from uav_bt.mission.tick import TickListener
from uav_bt.protocols import Drone
from uav_bt.tree import MissionTree
from uav_bt.types import CameraModel, ClassMap, DepthMap, Frame


def map_of_scene(scene: Scene) -> LabMap:
    """Return the map of a scene of the twin, boxes in the colours of their class."""
    classes, pad = scene.classes, scene.helipad

    def item(class_id: int, spec: Any, size_m: tuple[float, float, float], **more: Any) -> MapItem:
        red, green, blue = classes.colours[class_id].tolist()
        x_m, y_m = more.pop("at_m", None) or spec.position_m
        return MapItem(
            x_m=x_m,
            y_m=y_m,
            size_m=size_m,
            yaw_rad=math.radians(spec.yaw_deg),
            colour=(red, green, blue),
            name=classes.names[class_id],
            **more,
        )

    placed = [
        item(
            one.shape.class_id,
            one.spec,
            one.shape.kind.size_m,
            round=one.shape.round,
            parts=one.standing.parts,
        )
        for one in scene.placed
    ]
    movers = [
        MapMover(
            item=item(
                scene.class_of(mover),
                mover,
                mover.size_m,
                at_m=mover.path_m[0],
                round=mover.shape == "cylinder",
            ),
            path_m=(*mover.path_m, mover.path_m[0]) if mover.loop else mover.path_m,
        )
        for mover in scene.movers
    ]
    return LabMap(
        ground_size_m=scene.ground.size_m,
        boxes=(*(item(scene.class_of(box), box, box.size_m) for box in scene.boxes), *placed),
        mark=None if pad is None else item(scene.mark_class, pad, pad.size_m),
        movers=tuple(movers),
        take_off=scene.take_off_pose,
        ground=scene.ground_plan if scene.placed or scene.ground_plan.outline_m else None,
    )


def lab_map_of(drone: Drone) -> LabMap | None:
    """Return the map of a drone's lab; None where it is unknown."""
    return map_of_scene(drone.scene) if isinstance(drone.scene, Scene) else None


def title_of(flight: Flight[Drone]) -> str:
    """Return a flight's mission, scene and seed in a line."""
    drone, seed = flight.options.drone_name, flight.options.seed
    return describe_flight(flight.mission.origin, scene=flight.scene_name, drone=drone, seed=seed)


class VideoListeners:
    """Films a flight; one of the `listeners` of `app.fly`."""

    def __init__(self, video: FlightVideo, title: str = "") -> None:
        self._video = video
        self._title = title
        self._mark = default_mark()  # of a flight that has not begun

    def __call__(self, flight: Flight[Drone]) -> Sequence[TickListener]:
        """Begin the video of a connected drone's flight."""
        drone, self._mark = flight.drone, flight.context.mark
        self._video.panes = Panes(
            flight.context.board,
            drone.camera,
            lab_map=lab_map_of(drone),
            title=self._title or title_of(flight),
            limit_s=flight.held.judge.limit_s,
            **depth_of(flight.mission, drone.camera),
        )
        return [self._video]

    def conclude(self, report: FlightReport) -> None:
        """Show how the flight ended for a moment."""
        lines = [report.reason]
        if report.duration_s is not None:
            lines.append(f"{report.duration_s:.0f} s, {report.total_distance_m or 0.0:.1f} m flown")
        if report.landing_error_m is not None and lands_on_mark(report, self._mark):
            lines.append(f"{100 * report.landing_error_m:.0f} cm from the mark's centre")
        good = report.outcome == Outcome.SUCCESS.value
        self._video.conclude(report.outcome.replace("_", " "), lines, good=good)

    def finish(self, report: FlightReport) -> None:
        """Show how the flight ended and finish the file."""
        # A video that failed while it was drawn has no place for an end.
        if FlightVideo.__name__ not in report.lost_outputs:
            self.conclude(report)
        self._video.file.close()


def depth_of(tree: MissionTree | None, camera: CameraModel) -> dict[str, Any]:
    """Return whether a tree makes metric depth, and what marks the inside of its corridor.

    The tree is None where some of its nodes are not installed.
    """
    makes_depth = tree is not None and any(METRIC_DEPTH in leaf.writes for leaf in tree.leaves())
    return {"makes_depth": makes_depth, "intruding": corridor_marker(tree, camera)}


def corridor_leaf(tree: MissionTree | None) -> BuildCorridor | None:
    """Return the leaf of ours that builds the only corridor of a tree."""
    leaves = () if tree is None else tree.leaves()
    found = [leaf for leaf in leaves if isinstance(leaf, BuildCorridor)]
    return found[0] if len(found) == 1 else None


def corridor_marker(tree: MissionTree | None, camera: CameraModel) -> Intruding | None:
    """Return a function that marks the pixels inside a tree's corridor; None without one."""
    leaf = corridor_leaf(tree)
    if leaf is None:
        return None
    from perception.depth.corridor import CorridorBuilder  # noqa: PLC0415  (Numba is heavy)

    builder, background = CorridorBuilder(leaf.config()), bool(leaf.port_value("background"))

    def intruding(frame: Frame, class_map: ClassMap, depth: DepthMap) -> NDArray[np.bool_]:
        height_px, width_px = depth.depth.shape
        things = ~class_map.is_ground if background else class_map.is_above_ground
        return builder.intruding(
            depth, view_of(frame, camera, (width_px, height_px)), things=things
        )

    return intruding


@contextmanager
def flight_video(
    path: str | Path, *, speed: float = 1.0, title: str = ""
) -> Iterator[VideoListeners]:
    """Write the video of the flight that is flown inside.

    Args:
        path: the mp4 file; it appears, whole, at the end, also when the flight fails.
        speed: Speed of the video relative to the mission.
        title: a line above the map; the mission, the scene and the seed when empty.

    Raises:
        FileError: the file cannot be written; raised before anything flies.
        MissingDependencyError: no video encoder works here.
    """
    with FlightVideo(Path(path), speed=speed) as video:
        yield VideoListeners(video, title)


@contextmanager
def live_status(console: Console | None = None) -> Iterator[Listeners]:
    """Show the flight that is flown inside in one line; by default on the standard error stream."""
    with ExitStack() as open_lines:

        def make(flight: Flight[Drone]) -> Sequence[TickListener]:
            status = LiveStatus(flight.context.board, console=console)
            return [open_lines.enter_context(closing(status))]

        yield make
