"""Films and the status line of a flight, with the values of its lab.

`app.fly(tree, video="flight.mp4")` films; with options of the film, or beside another one:

with film.flight_video(Path("flight.mp4"), speed=2.0) as video:
    report = app.fly("survey_and_land", listeners=[video])
    video.conclude(report)
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from behaviours.perceive.depth import BuildCorridor
from perception.camera.ground_plane import view_of
from sim_bridge.twin.placed import PlacedObject
from sim_bridge.twin.scene import Scene
from uav_bt.app.assembly import Flight, Listeners
from uav_bt.board import METRIC_DEPTH, SITE_MAP
from uav_bt.board.blackboard import Blackboard
from uav_bt.display.canvas import Colour
from uav_bt.display.lab_map import LabMap, MapItem, MapMover
from uav_bt.display.phrases import describe_flight, lands_on_mark
from uav_bt.display.status import LiveStatus
from uav_bt.display.video.depth_panes import Intruding
from uav_bt.display.video.video import FlightVideo, FlightVideoConfig, Panes
from uav_bt.lab.classes import LabClasses
from uav_bt.lab.shipped import default_mark
from uav_bt.mission.flight_report import FlightReport
from uav_bt.mission.judge import Outcome
from uav_bt.mission.tick import TickListener
from uav_bt.protocols import Drone
from uav_bt.tree import MissionTree
from uav_bt.types import CameraModel, ClassMap, DepthMap, Frame, Pose2D

if TYPE_CHECKING:
    from perception.depth.corridor import CorridorConfig


def map_of_scene(scene: Scene) -> LabMap:
    """Return the map of a scene of the twin, boxes in the colours of their class."""
    classes, pad, start = scene.classes, scene.helipad, scene.take_off
    x_m, y_m = scene.start_m
    return LabMap(
        ground_size_m=scene.ground.size_m,
        boxes=(
            *(
                _item(classes, scene.class_of(box), box.position_m, box.yaw_deg, box.size_m)
                for box in scene.boxes
            ),
            *(_placed(classes, item) for item in scene.placed),
        ),
        mark=None
        if pad is None
        else _item(classes, scene.mark_class, pad.position_m, pad.yaw_deg, pad.size_m),
        movers=tuple(
            MapMover(
                item=_item(
                    classes, scene.class_of(mover), mover.path_m[0], mover.yaw_deg, mover.size_m
                ),
                path_m=(*mover.path_m, mover.path_m[0]) if mover.loop else mover.path_m,
                round=mover.shape == "cylinder",
            )
            for mover in scene.movers
        ),
        take_off=None
        if start.random
        else Pose2D(x_m=x_m, y_m=y_m, yaw_rad=math.radians(start.yaw_deg)),
        ground=scene.ground_plan if scene.placed or scene.ground_plan.outline_m else None,
    )


def _placed(classes: LabClasses, item: PlacedObject) -> MapItem:
    spec, shape = item.spec, item.shape
    whole = _item(classes, shape.class_id, spec.position_m, spec.yaw_deg, shape.kind.size_m)
    return replace(whole, round=shape.round, parts=item.standing.parts)


def _item(
    classes: LabClasses,
    class_id: int,
    position_m: tuple[float, float],
    yaw_deg: float,
    size_m: tuple[float, float, float],
) -> MapItem:
    red, green, blue = (int(value) for value in classes.colours[class_id])
    colour: Colour = (red, green, blue)
    return MapItem(
        x_m=position_m[0],
        y_m=position_m[1],
        size_m=size_m,
        yaw_rad=math.radians(yaw_deg),
        colour=colour,
        name=classes.names[class_id],
    )


def lab_map_of(drone: Drone) -> LabMap | None:
    """Return the map of a drone's lab; None where it is unknown."""
    return map_of_scene(drone.scene) if isinstance(drone.scene, Scene) else None


def title_of(flight: Flight[Drone]) -> str:
    """Return a flight's mission, scene and seed in a line."""
    options = flight.options
    return describe_flight(
        flight.mission.origin,
        scene=flight.scene_name,
        drone=options.drone_name,
        seed=options.seed,
    )


class VideoListeners:
    """Films a flight; one of the `listeners` of `app.fly`.

    Args:
        video: where frames are drawn.
        title: a line above the map; the mission, the scene and the seed when empty.
    """

    def __init__(self, video: FlightVideo, title: str = "") -> None:
        self._video = video
        self._title = title
        self._mark = default_mark()  # of a flight that has not begun

    def __call__(self, flight: Flight[Drone]) -> Sequence[TickListener]:
        """Begin the video of a connected drone's flight."""
        drone, self._mark = flight.drone, flight.context.mark
        self._video.begin(
            panes_of(
                flight.context.board,
                drone.camera,
                flight.mission,
                lab_map=lab_map_of(drone),
                title=self._title or title_of(flight),
                limit_s=flight.judge_config.limit_s,
            )
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
        """Show how the flight ended and finish the file.

        Raises:
            FileError: it could not be written to the end; nothing is left behind.
        """
        # A video that failed while it was drawn has no place for an end.
        if FlightVideo.__name__ not in report.lost_outputs:
            self.conclude(report)
        self._video.close()


def panes_of(
    board: Blackboard,
    camera: CameraModel,
    tree: MissionTree | None,
    *,
    lab_map: LabMap | None,
    title: str,
    limit_s: float | None,
) -> Panes:
    """Return the drawing of a flight's video.

    Args:
        board: Board of the mission in the drawn tick.
        camera: intrinsics at the frames' size.
        tree: the mission; None where some of its nodes are not installed.
        lab_map: Map of the lab. None: unknown.
        title: a line above the map.
        limit_s: when the flight is ended at the latest, from the take-off command.
    """
    panes = Panes(board, camera, lab_map=lab_map, title=title, limit_s=limit_s)
    if tree is not None and makes_depth(tree):
        panes.show_depth(corridor_marker(tree, camera))
    return panes


def makes_depth(tree: MissionTree) -> bool:
    """Return whether a leaf of a tree writes metric depth."""
    return any(METRIC_DEPTH in leaf.writes for leaf in tree.leaves())


def makes_map(tree: MissionTree) -> bool:
    """Return whether a leaf of a tree keeps the site map."""
    return any(SITE_MAP in leaf.writes for leaf in tree.leaves())


def _corridor_leaf(tree: MissionTree) -> BuildCorridor | None:
    leaves = [leaf for leaf in tree.leaves() if isinstance(leaf, BuildCorridor)]
    return leaves[0] if len(leaves) == 1 else None


def corridor_of(tree: MissionTree) -> CorridorConfig | None:
    """Return the corridor that a tree asks for; None where it does not build exactly one."""
    leaf = _corridor_leaf(tree)
    return None if leaf is None else leaf.config()


def corridor_marker(tree: MissionTree, camera: CameraModel) -> Intruding | None:
    """Return a function that marks the pixels inside a tree's corridor.

    Args:
        tree: the mission.
        camera: intrinsics at the frames' size.

    Returns:
        None where the tree does not build one corridor, with a leaf of ours.
    """
    from perception.depth.corridor import CorridorBuilder  # noqa: PLC0415  (Numba is heavy)

    leaf = _corridor_leaf(tree)
    if leaf is None:
        return None
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
    with FlightVideo(Path(path), config=FlightVideoConfig(speed=speed)) as video:
        yield VideoListeners(video, title)


@contextmanager
def live_status(console: Console | None = None) -> Iterator[Listeners]:
    """Show the flight that is flown inside in one line that keeps up with it.

    Args:
        console: where to write; default: the standard error stream.
    """
    with ExitStack() as open_lines:

        def make(flight: Flight[Drone]) -> Sequence[TickListener]:
            return [open_lines.enter_context(LiveStatus(flight.context.board, console=console))]

        yield make
