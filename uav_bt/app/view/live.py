"""Live view of a flight in Rerun, as listeners of `app.fly`.

with saved_view(Path("flight.rrd"), title="tour") as view:
    app.fly("explore_and_land_segmentation", listeners=[view])
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import closing, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from uav_bt.app.assembly import Flight, Listeners
from uav_bt.app.film import facts_of_flight
from uav_bt.display.rerun import sinks
from uav_bt.mission.tick import TickListener
from uav_bt.protocols import Drone

if TYPE_CHECKING:
    import rerun as rr

    from uav_bt.display.rerun.flight_view import FlightView


class LiveView:
    """Draws a flight for a viewer, in a thread; one of the `listeners` of `app.fly`."""

    def __init__(self, viewer: sinks.Viewer) -> None:
        self._viewer = viewer
        self._drawing: sinks.Background | None = None

    def __call__(self, flight: Flight[Drone]) -> Sequence[TickListener]:
        """Begin to draw the flight of a connected drone."""
        self._drawing = sinks.Background(_view(self._viewer.stream, flight))
        return [self._drawing]

    def close(self) -> None:
        """Draw the ticks that still wait; safe to call twice."""
        if self._drawing is not None:
            self._drawing.close()

    def wait(self) -> None:
        """Return when the viewer has been closed."""
        self.close()
        self._viewer.process.wait()


def _view(stream: rr.RecordingStream, flight: Flight[Drone], title: str = "") -> FlightView:
    from uav_bt.display.rerun.flight_view import FlightView  # noqa: PLC0415  (needs Rerun)

    nodes, facts = tuple(flight.mission.nodes()), facts_of_flight(flight, title)
    return FlightView(
        stream, facts, flight.context.board, lambda: {node.path: node.node_status for node in nodes}
    )


@contextmanager
def saved_view(path: str | Path, *, title: str = "") -> Iterator[Listeners]:
    """Write the view of the flight that is flown inside to an rrd file, which appears at the end.

    FileError if it cannot be written. `title` is the recording's name; default: the mission, the
    scene and the seed.
    """
    with sinks.saved(Path(path)) as stream:
        yield lambda flight: [_view(stream, flight, title)]


@contextmanager
def live_view(
    *, web: bool = False, on_url: Callable[[str], None] = lambda _url: None
) -> Iterator[LiveView]:
    """Show the flight that is flown inside; InputError without a display.

    A window stays open when all is over; a browser's view ends here, so `wait` for it before.
    `on_url` gets the address of a browser's view before anything flies.
    """
    instead = "--view web shows it in a browser, --record FILE.mcap keeps it for `uav-bt view`"
    with sinks.shown(web=web, instead=instead) as viewer:
        if viewer.url is not None:
            on_url(viewer.url)
        with closing(LiveView(viewer)) as view:
            yield view
