"""A flight viewed while it is flown: what `app.fly` calls, with Rerun behind it.

with saved_view(Path("flight.rrd"), title="tour") as view:
    app.fly("explore_and_land_segmentation", listeners=view, tree_listeners=view.show_tree)
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from behaviours.perceive.depth import BuildCorridor
from uav_bt.app.film import corridor_marker, lab_map_of
from uav_bt.board import METRIC_DEPTH
from uav_bt.board.blackboard import Blackboard
from uav_bt.board.context import MissionContext
from uav_bt.classes import CLASS_COLOURS, CLASS_NAMES
from uav_bt.display.lab_map import LabMap
from uav_bt.display.rerun import sinks
from uav_bt.display.rerun.background import BackgroundFollower, Statuses
from uav_bt.display.rerun.setting import CorridorSize, ViewSetting, tree_nodes
from uav_bt.errors import MissionError
from uav_bt.mission.runner import TickListener
from uav_bt.protocols import Drone
from uav_bt.tree import MissionTree, Status
from uav_bt.types import CameraModel

if TYPE_CHECKING:
    import rerun as rr


__all__ = ["ViewListeners", "corridor_size", "live_view", "saved_view", "setting_of"]


class ViewListeners:
    """What `app.fly` takes as `listeners`, with a Rerun recording behind it.

    Args:
        stream: where to draw.
        title: the recording's name.
        viewer: the process that shows it, told by a thread of its own; None for a file.
    """

    def __init__(
        self, stream: rr.RecordingStream, title: str, viewer: sinks.Viewer | None = None
    ) -> None:
        self._stream = stream
        self._title = title
        self._viewer = viewer
        self._drone: Drone | None = None
        self._follower: BackgroundFollower | None = None

    def __call__(self, drone: Drone, context: MissionContext) -> Sequence[TickListener]:
        """Take note of a connected drone; drawing begins with its tree."""
        del context
        self._drone = drone
        return []

    def show_tree(self, tree: MissionTree, context: MissionContext) -> Sequence[TickListener]:
        """What `app.fly` takes as `tree_listeners`: begin to draw.

        Raises:
            MissionError: the drone is not known yet.
        """
        from uav_bt.display.rerun.flight_view import FlightView  # noqa: PLC0415 - needs Rerun
        from uav_bt.display.rerun.layout import layout  # noqa: PLC0415

        if self._drone is None:
            raise MissionError("a view needs the drone first: give it to `app.fly` as `listeners`")
        setting = setting_of(
            tree, self._drone.camera, lab_map=lab_map_of(self._drone), title=self._title
        )
        nodes = tuple(tree.nodes())

        def statuses() -> Mapping[str, Status]:
            return {node.path: node.node_status for node in nodes}

        def drawn(board: Blackboard, standing: Statuses) -> FlightView:
            return FlightView(self._stream, setting, board, standing)

        self._stream.send_blueprint(layout(setting))
        if self._viewer is None:
            return [drawn(context.board, statuses)]
        self._follower = BackgroundFollower(drawn, context.board, statuses)
        return [self._follower]

    def finish(self) -> None:
        """Draw what still waits; safe to call twice."""
        if self._follower is not None:
            self._follower.close()

    def wait(self) -> None:
        """Return when the viewer has been closed; at once for a file."""
        self.finish()
        if self._viewer is not None:
            self._viewer.wait()


def setting_of(
    tree: MissionTree, camera: CameraModel, *, lab_map: LabMap | None, title: str = ""
) -> ViewSetting:
    """Return what a view shows of a mission that does not change while it is flown.

    Args:
        tree: the mission.
        camera: intrinsics at the frames' size.
        lab_map: what stands in the lab; None where nobody knows.
        title: the recording's name.
    """
    return ViewSetting(
        camera=camera,
        class_names=CLASS_NAMES,
        class_colours=CLASS_COLOURS,
        title=title,
        lab_map=lab_map,
        tree=tree_nodes(tree),
        makes_depth=any(METRIC_DEPTH in leaf.writes for leaf in tree.leaves()),
        corridor=corridor_size(tree),
        intruding=corridor_marker(tree, camera),
    )


def corridor_size(tree: MissionTree) -> CorridorSize | None:
    """Return the corridor that a tree asks for; None where it does not build one, ours."""
    leaves = [leaf for leaf in tree.leaves() if isinstance(leaf, BuildCorridor)]
    if len(leaves) != 1:
        return None
    told = leaves[0].port_value
    return CorridorSize(side_m=told("side_m"), front_m=told("front_m"), up_down_m=told("up_down_m"))


@contextmanager
def saved_view(path: Path, *, title: str = "") -> Iterator[ViewListeners]:
    """Write the view of the flight that is flown inside.

    Args:
        path: the rrd file; it appears, whole, at the end.
        title: the recording's name.

    Raises:
        FileError: the file cannot be written.
        MissingDependencyError: Rerun is not installed.
    """
    with sinks.saved(path) as stream:
        yield ViewListeners(stream, title)


@contextmanager
def live_view(
    *, web: bool = False, title: str = "", told: Callable[[str], None] = lambda _url: None
) -> Iterator[ViewListeners]:
    """Show the flight that is flown inside.

    A window stays open when all is over; a browser's view ends here, so `wait` for it before.

    Args:
        web: for a browser on this machine instead of a window.
        title: the recording's name.
        told: is told the address of a browser's view, before anything flies.

    Raises:
        InputError: there is no display.
        MissingDependencyError: Rerun is not installed.
    """
    if not web:
        sinks.need_display(
            "--view web shows it in a browser, --record FILE.mcap keeps it for `uav-bt view`"
        )
    viewer = sinks.Viewer(web=web)
    try:
        if viewer.url is not None:
            told(viewer.url)
        listeners = ViewListeners(viewer.stream, title, viewer)
        try:
            yield listeners
        finally:
            listeners.finish()
    finally:
        viewer.close(end=web)
