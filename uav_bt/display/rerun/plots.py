"""Tree graph and plots in Rerun: heading error, height, free distance, tick time.

Unknown values leave a gap.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import rerun as rr

from uav_bt.display.canvas import ACCENT, ALARM, INK, Colour
from uav_bt.display.rerun.setting import FREE_DISTANCE, HEADING, HEIGHT, TICK_TIME, TREE, TreeNode
from uav_bt.mission.tick import TickRecord
from uav_bt.tree.status import FAILURE, IDLE, RUNNING, SUCCESS, Status
from uav_bt.types import Corridor, MarkFix, MoveBy, NearObstacles, wrap_angle

_BLUE: Final[Colour] = (94, 205, 255)


@dataclass(frozen=True, kw_only=True)
class _Series:
    name: str
    colour: Colour


_SERIES: Final = {
    f"{HEADING}/turn": _Series(name="of the turn", colour=ACCENT),
    f"{HEADING}/mark": _Series(name="to the mark", colour=_BLUE),
    f"{HEIGHT}/telemetry": _Series(name="telemetry", colour=ACCENT),
    f"{HEIGHT}/true": _Series(name="true", colour=_BLUE),
    f"{FREE_DISTANCE}/ahead": _Series(name="ahead", colour=ACCENT),
    f"{FREE_DISTANCE}/intrusion": _Series(name="intrusion", colour=ALARM),
    f"{FREE_DISTANCE}/remembered": _Series(name="remembered", colour=_BLUE),
    f"{FREE_DISTANCE}/clearance": _Series(name="true clearance", colour=INK),
    f"{TICK_TIME}/compute": _Series(name="tree and networks", colour=ACCENT),
}


class TurnLeft:
    """Heading error of a `MoveBy`: the remaining turn."""

    def __init__(self) -> None:
        self._id: int | None = None
        self._target_rad = 0.0

    def after(self, record: TickRecord) -> float | None:
        """Return the remaining turn, clockwise positive; None without a turn."""
        movement, yaw_rad = record.command.movement, record.observation.state.attitude.yaw_rad
        if not isinstance(movement, MoveBy) or movement.yaw_rad == 0.0:
            self._id = None
            return None
        if movement.id != self._id:
            self._id = movement.id
            self._target_rad = yaw_rad + movement.yaw_rad
        return wrap_angle(self._target_rad - yaw_rad)


class FlightPlots:
    """Draws a point of each series at each tick.

    Args:
        stream: the recording.
    """

    def __init__(self, stream: rr.RecordingStream) -> None:
        self._stream = stream
        self._turn = TurnLeft()
        for entity, series in _SERIES.items():
            line = rr.SeriesLines(names=[series.name], colors=[series.colour], widths=[1.5])
            stream.log(entity, line, static=True)

    def show(
        self,
        record: TickRecord,
        *,
        corridor: Corridor | None,
        near: NearObstacles | None,
        fix: MarkFix | None,
    ) -> None:
        """Draw a tick."""
        turn_rad, truth = self._turn.after(record), record.truth
        free_m = None if corridor is None else corridor.free_distance_m
        intrusion_m = None if corridor is None else corridor.nearest_m
        near_m = None if near is None else near.nearest_m
        clearance_m = None if truth is None else truth.clearance_m
        height_m = record.observation.state.height_above_ground_m
        self._point(f"{HEADING}/turn", None if turn_rad is None else math.degrees(turn_rad))
        self._point(f"{HEADING}/mark", None if fix is None else math.degrees(fix.bearing_rad))
        self._point(f"{HEIGHT}/telemetry", height_m)
        self._point(f"{HEIGHT}/true", None if truth is None else truth.pose.z_m)
        self._point(f"{FREE_DISTANCE}/ahead", free_m)
        self._point(f"{FREE_DISTANCE}/intrusion", intrusion_m)
        self._point(f"{FREE_DISTANCE}/remembered", near_m)
        self._point(f"{FREE_DISTANCE}/clearance", clearance_m)
        self._point(f"{TICK_TIME}/compute", 1000.0 * record.compute_s)

    def _point(self, entity: str, value: float | None) -> None:
        shown = value if value is not None and math.isfinite(value) else math.nan
        self._stream.log(entity, rr.Scalars(shown))


STATUS_COLOURS: Final[Mapping[Status, Colour]] = {
    RUNNING: (255, 196, 0),
    SUCCESS: (80, 200, 120),
    FAILURE: (255, 92, 92),
    IDLE: (139, 146, 158),
}
_ROW_PX: Final = 30.0
_INDENT_PX: Final = 30.0
_LETTER_PX: Final = 7.0  # approximate width of a letter in Rerun


def places(nodes: Sequence[TreeNode]) -> list[tuple[float, float]]:
    """Return the centres of the nodes, px: one row each, indented by level, as in the tree file.

    A tree drawn level by level is several times wider than a pane, with unreadable labels.

    Args:
        nodes: nodes in the order of the file, parents first.
    """
    levels: dict[str, int] = {}
    found: list[tuple[float, float]] = []
    for row, node in enumerate(nodes):
        level = 0 if node.parent is None else levels[node.parent] + 1
        levels[node.path] = level
        left_px = _INDENT_PX * level
        found.append((left_px + _LETTER_PX * len(node.label) / 2.0, _ROW_PX * row))
    return found


class TreeGraph:
    """Draws the nodes of a tree when their statuses change.

    Args:
        stream: the recording.
        nodes: nodes of the tree, parents first.
    """

    def __init__(self, stream: rr.RecordingStream, nodes: Sequence[TreeNode]) -> None:
        self._stream = stream
        self._paths = [node.path for node in nodes]
        self._labels = [node.label for node in nodes]
        self._places = places(nodes)
        self._shown: list[Status] | None = None
        if nodes:
            edges = [(node.parent, node.path) for node in nodes if node.parent is not None]
            stream.log(TREE, rr.GraphEdges(edges, graph_type="directed"), static=True)

    def show(self, statuses: Mapping[str, Status]) -> None:
        """Draw the tree with the statuses of its nodes by path; missing nodes are idle."""
        now = [statuses.get(path, IDLE) for path in self._paths]
        if now == self._shown or not now:
            return
        self._shown = now
        self._stream.log(
            TREE,
            rr.GraphNodes(
                self._paths,
                labels=self._labels,
                positions=self._places,
                colors=[STATUS_COLOURS[status] for status in now],
            ),
        )
