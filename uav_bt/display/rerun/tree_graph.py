"""The tree as a graph: a row for each node, children indented, coloured by status."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import rerun as rr

from uav_bt.display.canvas import Colour
from uav_bt.display.rerun.entities import TREE
from uav_bt.display.rerun.setting import TreeNode
from uav_bt.tree.status import FAILURE, IDLE, RUNNING, SUCCESS, Status

STATUS_COLOURS: Final[Mapping[Status, Colour]] = {
    RUNNING: (255, 196, 0),
    SUCCESS: (80, 200, 120),
    FAILURE: (255, 92, 92),
    IDLE: (139, 146, 158),
}
_ROW_PX: Final = 30.0
_INDENT_PX: Final = 30.0
_LETTER_PX: Final = 7.0  # of Rerun's type, roughly


def places(nodes: Sequence[TreeNode]) -> list[tuple[float, float]]:
    """Return where the nodes' middles lie, px: a row each, indented by level, as in the tree file.

    A tree drawn level by level is several times wider than a pane: its labels could not be read.

    Args:
        nodes: in the order of the file, parents first.
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
    """Draws a tree's nodes when their statuses change.

    Args:
        stream: where to.
        nodes: of the tree, parents first.
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
        """Draw the tree with its nodes' statuses by path; a node that is not named stands idle."""
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
