"""The tree as a graph: a row for each leaf, parents left of their children, coloured by status."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import rerun as rr

from uav_bt.tree.status import FAILURE, IDLE, RUNNING, SUCCESS, Status
from uav_bt.view.canvas import Colour
from uav_bt.viewer.entities import TREE
from uav_bt.viewer.setting import TreeNode

__all__ = ["STATUS_COLOURS", "TreeGraph", "places"]

STATUS_COLOURS: Final[Mapping[Status, Colour]] = {
    RUNNING: (255, 196, 0),
    SUCCESS: (80, 200, 120),
    FAILURE: (255, 92, 92),
    IDLE: (139, 146, 158),
}
_ROW_PX: Final = 34.0
_GAP_PX: Final = 46.0  # between a parent's label and its children's
_LETTER_PX: Final = 7.0  # of Rerun's type, roughly


def places(nodes: Sequence[TreeNode]) -> list[tuple[float, float]]:
    """Return where the nodes' middles lie, px: levels from left to right, leaves from the top down.

    Args:
        nodes: in the order of the file, parents first.
    """
    children: dict[str, list[int]] = {node.path: [] for node in nodes}
    levels: list[int] = []
    index = {node.path: place for place, node in enumerate(nodes)}
    for place, node in enumerate(nodes):
        levels.append(0 if node.parent is None else levels[index[node.parent]] + 1)
        if node.parent is not None:
            children[node.parent].append(place)
    rows = [0.0] * len(nodes)
    next_row = sum(1 for node in nodes if not children[node.path])
    for place in reversed(range(len(nodes))):  # children first
        below = children[nodes[place].path]
        if below:
            rows[place] = (rows[below[0]] + rows[below[-1]]) / 2.0
        else:
            next_row -= 1
            rows[place] = float(next_row)
    columns = _columns(nodes, levels)
    return [(columns[level], _ROW_PX * row) for level, row in zip(levels, rows, strict=True)]


def _columns(nodes: Sequence[TreeNode], levels: Sequence[int]) -> list[float]:
    """Return where each level's middle lies, wide enough for its longest label."""
    widths = [0.0] * (max(levels, default=-1) + 1)
    for node, level in zip(nodes, levels, strict=True):
        widths[level] = max(widths[level], _LETTER_PX * len(node.label))
    columns, left = [], 0.0
    for width in widths:
        columns.append(left + width / 2.0)
        left += width + _GAP_PX
    return columns


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
