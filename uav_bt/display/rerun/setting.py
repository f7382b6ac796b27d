"""What a view shows of a flight that does not change while it lasts."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uav_bt.display.lab_map import LabMap
from uav_bt.errors import ShapeError, ValueRangeError
from uav_bt.tree import MissionTree
from uav_bt.types import CameraModel, ClassMap, DepthMap, Frame

Intruding = Callable[[Frame, ClassMap, DepthMap], NDArray[np.bool_]]
"""Tells which pixels of a depth map are inside the corridor, (H, W)."""


@dataclass(frozen=True, kw_only=True)
class CorridorSize:
    """How far the corridor's planes lie from the body's centre, metres."""

    side_m: float  # to the left and to the right
    front_m: float
    up_down_m: float

    def __post_init__(self) -> None:
        if not min(self.side_m, self.front_m, self.up_down_m) > 0.0:
            raise ValueRangeError(f"a corridor's planes must be more than 0 m away, got {self}")


@dataclass(frozen=True, kw_only=True)
class TreeNode:
    """A node of the tree as the graph draws it."""

    path: str  # unique in its tree
    label: str
    parent: str | None  # the path of the node above; None for the root


def tree_nodes(tree: MissionTree) -> tuple[TreeNode, ...]:
    """Return the nodes of a tree in the order of the file, parents first."""
    parents = {child.path: node.path for node in tree.nodes() for child in node.children}
    return tuple(
        TreeNode(path=node.path, label=node.name, parent=parents.get(node.path))
        for node in tree.nodes()
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class ViewSetting:
    """Camera, lab, tree and classes of one flight.

    Raises:
        ShapeError: there is not one colour for each class name.
    """

    camera: CameraModel  # at the frames' size
    class_names: tuple[str, ...]  # by class id
    class_colours: NDArray[np.uint8]  # (N, 3) RGB by class id
    title: str = ""  # the mission, the scene, the seed
    lab_map: LabMap | None = None  # None where it is unknown
    tree: tuple[TreeNode, ...] = ()
    makes_depth: bool = False  # whether the mission makes metric depth: it gets a pane
    corridor: CorridorSize | None = None  # None: the mission builds none
    intruding: Intruding | None = None  # None marks no pixel

    def __post_init__(self) -> None:
        if self.class_colours.shape != (len(self.class_names), 3):
            expected = f"{len(self.class_names)}x3"
            raise ShapeError("class colours", expected=expected, actual=self.class_colours.shape)
