"""Live view of a flight in Rerun, as listeners of `app.fly`.

with saved_view(Path("flight.rrd"), title="tour") as view:
    app.fly("explore_and_land_segmentation", listeners=[view])
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uav_bt.app.assembly import Flight
from uav_bt.app.film import corridor_leaf, depth_of, lab_map_of, title_of
from uav_bt.board import SITE_MAP
from uav_bt.display.rerun import sinks
from uav_bt.mission.tick import TickListener
from uav_bt.protocols import Drone
from uav_bt.tree import MissionTree, Status
from uav_bt.types import CameraModel

if TYPE_CHECKING:
    import rerun as rr

    from uav_bt.display.rerun.layout import ViewSetting


class ViewListeners:
    """Draws a flight into a Rerun recording; one of the `listeners` of `app.fly`.

    A viewer is fed by a separate thread.
    """

    def __init__(
        self, stream: rr.RecordingStream, title: str = "", viewer: sinks.Viewer | None = None
    ) -> None:
        self._stream = stream
        self._title = title
        self._viewer = viewer
        self._background: sinks.Background[Any] | None = None

    def __call__(self, flight: Flight[Drone]) -> Sequence[TickListener]:
        """Begin to draw the flight of a connected drone."""
        from uav_bt.display.rerun.flight_view import FlightView  # noqa: PLC0415  (needs Rerun)
        from uav_bt.display.rerun.layout import layout  # noqa: PLC0415

        mission = flight.mission
        nodes = tuple(mission.nodes())
        levels: dict[str, int] = {}
        for node in nodes:  # parents first
            levels.update((child.path, levels.get(node.path, 0) + 1) for child in node.children)
        setting = setting_of(
            mission,
            flight.drone.camera,
            classes=flight.held.classes,
            airframe=flight.drone.airframe,
            tree=tuple((node.path, node.name, levels.get(node.path, 0)) for node in nodes),
            lab_map=lab_map_of(flight.drone),
            title=self._title or title_of(flight),
        )

        def statuses() -> Mapping[str, Status]:
            return {node.path: node.node_status for node in nodes}

        self._stream.send_blueprint(layout(setting))
        view = FlightView(self._stream, setting, flight.context.board, statuses)
        if self._viewer is None:
            return [view]
        self._background = sinks.Background(view.take, view.draw)
        return [self._background]

    def finish(self) -> None:
        """Draw the ticks that still wait; safe to call twice."""
        if self._background is not None:
            self._background.close()

    def wait(self) -> None:
        """Return when the viewer has been closed; at once for a file."""
        self.finish()
        if self._viewer is not None:
            self._viewer.wait()


def setting_of(mission: MissionTree | None, camera: CameraModel, **facts: Any) -> ViewSetting:
    """Return a view's setting; the mission is None where some of its nodes are not installed."""
    from uav_bt.display.rerun.layout import ViewSetting  # noqa: PLC0415  (needs Rerun)

    leaf = corridor_leaf(mission)
    size = None if leaf is None else leaf.config()
    return ViewSetting(
        camera=camera,
        makes_map=mission is not None and any(SITE_MAP in one.writes for one in mission.leaves()),
        corridor_m=None if size is None else (size.side_m, size.front_m, size.up_down_m),
        **depth_of(mission, camera),
        **facts,
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
    *, web: bool = False, on_url: Callable[[str], None] = lambda _url: None
) -> Iterator[ViewListeners]:
    """Show the flight that is flown inside.

    A window stays open when all is over; a browser's view ends here, so `wait` for it before.
    `on_url` gets the address of a browser's view before anything flies.

    Raises:
        InputError: there is no display.
        MissingDependencyError: Rerun is not installed.
    """
    instead = "--view web shows it in a browser, --record FILE.mcap keeps it for `uav-bt view`"
    with sinks.shown(web=web, instead=instead) as viewer:
        if viewer.url is not None:
            on_url(viewer.url)
        listeners = ViewListeners(viewer.stream, viewer=viewer)
        try:
            yield listeners
        finally:
            listeners.finish()
