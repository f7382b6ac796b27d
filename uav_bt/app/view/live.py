"""Live view of a flight in Rerun, as listeners of `app.fly`.

with saved_view(Path("flight.rrd"), title="tour") as view:
    app.fly("explore_and_land_segmentation", listeners=[view])
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from uav_bt.app.assembly import Flight
from uav_bt.app.film import (
    corridor_marker,
    corridor_of,
    lab_map_of,
    makes_depth,
    makes_map,
    title_of,
)
from uav_bt.board.blackboard import Blackboard
from uav_bt.display.lab_map import LabMap
from uav_bt.display.rerun import sinks
from uav_bt.display.rerun.setting import CorridorSize, TreeNode, ViewSetting, tree_nodes
from uav_bt.lab.classes import LabClasses
from uav_bt.mission.tick import TickListener
from uav_bt.protocols import Drone
from uav_bt.tree import MissionTree, Status
from uav_bt.types import Airframe, CameraModel

if TYPE_CHECKING:
    import rerun as rr

    from uav_bt.display.rerun.flight_view import BackgroundFollower, Statuses


class ViewListeners:
    """Draws a flight into a Rerun recording; one of the `listeners` of `app.fly`.

    Args:
        stream: where to draw.
        title: the recording's name; the mission, the scene and the seed when empty.
        viewer: Process that shows it, fed by a separate thread. None for a file.
    """

    def __init__(
        self, stream: rr.RecordingStream, title: str = "", viewer: sinks.Viewer | None = None
    ) -> None:
        self._stream = stream
        self._title = title
        self._viewer = viewer
        self._follower: BackgroundFollower | None = None

    def __call__(self, flight: Flight[Drone]) -> Sequence[TickListener]:
        """Begin to draw the flight of a connected drone."""
        from uav_bt.display.rerun.flight_view import (  # noqa: PLC0415  (needs Rerun)
            BackgroundFollower,
            FlightView,
        )
        from uav_bt.display.rerun.layout import layout  # noqa: PLC0415

        mission, board = flight.mission, flight.context.board
        setting = setting_of(
            mission,
            flight.drone.camera,
            classes=flight.classes,
            airframe=flight.drone.airframe,
            nodes=tree_nodes(mission),
            lab_map=lab_map_of(flight.drone),
            title=self._title or title_of(flight),
        )
        nodes = tuple(mission.nodes())

        def statuses() -> Mapping[str, Status]:
            return {node.path: node.node_status for node in nodes}

        def drawn(board: Blackboard, standing: Statuses) -> FlightView:
            return FlightView(self._stream, setting, board, standing)

        self._stream.send_blueprint(layout(setting))
        if self._viewer is None:
            return [drawn(board, statuses)]
        self._follower = BackgroundFollower(drawn, board, statuses)
        return [self._follower]

    def finish(self) -> None:
        """Draw the ticks that still wait; safe to call twice."""
        if self._follower is not None:
            self._follower.close()

    def wait(self) -> None:
        """Return when the viewer has been closed; at once for a file."""
        self.finish()
        if self._viewer is not None:
            self._viewer.wait()


def setting_of(
    tree: MissionTree | None,
    camera: CameraModel,
    *,
    classes: LabClasses,
    airframe: Airframe,
    nodes: Sequence[TreeNode],
    lab_map: LabMap | None,
    title: str = "",
) -> ViewSetting:
    """Return the parts of a view that do not change during a flight.

    Args:
        tree: the mission; None where some of its nodes are not installed.
        camera: intrinsics at the frames' size.
        classes: classes of the lab.
        airframe: size of the body.
        nodes: of the mission.
        lab_map: Map of the lab. None: unknown.
        title: the recording's name.
    """
    corridor = None if tree is None else corridor_of(tree)
    return ViewSetting(
        camera=camera,
        airframe=airframe,
        classes=classes,
        title=title,
        lab_map=lab_map,
        tree=tuple(nodes),
        makes_depth=tree is not None and makes_depth(tree),
        makes_map=tree is not None and makes_map(tree),
        corridor=None
        if corridor is None
        else CorridorSize(
            side_m=corridor.side_m, front_m=corridor.front_m, up_down_m=corridor.up_down_m
        ),
        intruding=None if tree is None else corridor_marker(tree, camera),
    )


@contextmanager
def saved_view(path: str | Path, *, title: str = "") -> Iterator[ViewListeners]:
    """Write the view of the flight that is flown inside.

    Args:
        path: the rrd file; it appears, whole, at the end.
        title: the recording's name; the mission, the scene and the seed when empty.

    Raises:
        FileError: the file cannot be written.
        MissingDependencyError: Rerun is not installed.
    """
    with sinks.saved(Path(path)) as stream:
        yield ViewListeners(stream, title)


@contextmanager
def live_view(
    *, web: bool = False, title: str = "", on_url: Callable[[str], None] = lambda _url: None
) -> Iterator[ViewListeners]:
    """Show the flight that is flown inside.

    A window stays open when all is over; a browser's view ends here, so `wait` for it before.

    Args:
        web: for a browser on this machine instead of a window.
        title: the recording's name; the mission, the scene and the seed when empty.
        on_url: called with the address of a browser's view, before anything flies.

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
            on_url(viewer.url)
        listeners = ViewListeners(viewer.stream, title, viewer)
        try:
            yield listeners
        finally:
            listeners.finish()
    finally:
        viewer.close(end=web)
