"""Constants of a view: entity paths and the setting of the flight.

This module does not need Rerun: `fly` and records use settings without that extra.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

from uav_bt.display.lab_map import LabMap
from uav_bt.display.video.depth_panes import Intruding
from uav_bt.errors import ValueRangeError
from uav_bt.lab.classes import LabClasses
from uav_bt.tree import MissionTree
from uav_bt.types import Airframe, CameraModel


@dataclass(frozen=True, kw_only=True)
class CorridorSize:
    """Distances of the corridor's planes from the body's centre, metres."""

    side_m: float  # to the left and to the right
    front_m: float
    up_down_m: float

    def __post_init__(self) -> None:
        if not min(self.side_m, self.front_m, self.up_down_m) > 0.0:
            raise ValueRangeError(f"a corridor's planes must be more than 0 m away, got {self}")


@dataclass(frozen=True, kw_only=True)
class TreeNode:
    """A node of the tree graph."""

    path: str  # unique in the tree
    label: str
    parent: str | None  # path of the parent node; None for the root


def tree_nodes(tree: MissionTree) -> tuple[TreeNode, ...]:
    """Return the nodes of a tree in the order of the file, parents first."""
    parents = {child.path: node.path for node in tree.nodes() for child in node.children}
    return tuple(
        TreeNode(path=node.path, label=node.name, parent=parents.get(node.path))
        for node in tree.nodes()
    )


@dataclass(frozen=True, kw_only=True, eq=False)
class ViewSetting:
    """Camera, lab, tree and classes of one flight."""

    camera: CameraModel  # intrinsics at the size of the frames
    classes: LabClasses
    airframe: Airframe = field(default_factory=Airframe)
    title: str = ""  # mission, scene and seed
    lab_map: LabMap | None = None  # None: unknown
    tree: tuple[TreeNode, ...] = ()
    makes_depth: bool = False  # whether the mission makes metric depth, which then has a pane
    makes_map: bool = False  # whether the mission keeps a site map, which then has a pane
    corridor: CorridorSize | None = None  # None: the mission has no corridor
    intruding: Intruding | None = None  # None: no pixel is marked


TIMELINE: Final = "flight"  # seconds since the first tick

WORLD: Final = "world"  # metres, z up, the origin in the middle of the ground
LAB: Final = f"{WORLD}/lab"
PATH: Final = f"{WORLD}/path"
BODY: Final = f"{WORLD}/drone"
CORRIDOR: Final = f"{WORLD}/corridor"  # in the heading-aligned frame: x forward, y left, z up
OBSTACLES: Final = f"{WORLD}/obstacles"
FIX: Final = f"{WORLD}/mark_fix"
LENS: Final = f"{WORLD}/camera"  # image and overlays, in pixels of the image
DEPTH_LENS: Final = f"{WORLD}/depth"  # the same lens at the size of the depth map
MASK: Final = "mask"
SITE_MAP: Final = "site_map"  # image of the mission's map
TREE: Final = "tree"
WORDS: Final = "words"
HEADING: Final = "plots/heading"
HEIGHT: Final = "plots/height"
FREE_DISTANCE: Final = "plots/free_distance"
TICK_TIME: Final = "plots/tick_time"
