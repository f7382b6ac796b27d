"""What does not change while a view lasts: entity paths and the flight's setting.

Nothing here needs Rerun: `fly` and records know settings without that extra.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

from uav_bt.display.lab_map import LabMap
from uav_bt.display.video.class_pane import ClassPalette
from uav_bt.display.video.depth_panes import Intruding
from uav_bt.errors import ValueRangeError
from uav_bt.tree import MissionTree
from uav_bt.types import Airframe, CameraModel


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
    """Camera, lab, tree and classes of one flight."""

    camera: CameraModel  # at the frames' size
    palette: ClassPalette
    airframe: Airframe = field(default_factory=Airframe)
    title: str = ""  # the mission, the scene, the seed
    lab_map: LabMap | None = None  # None where it is unknown
    tree: tuple[TreeNode, ...] = ()
    makes_depth: bool = False  # whether the mission makes metric depth: it gets a pane
    makes_map: bool = False  # whether the mission keeps a site map: it gets a pane
    corridor: CorridorSize | None = None  # None: the mission builds none
    intruding: Intruding | None = None  # None marks no pixel


TIMELINE: Final = "flight"  # seconds since the first tick

WORLD: Final = "world"  # z up, the origin in the carpet's middle, metres
LAB: Final = f"{WORLD}/lab"
PATH: Final = f"{WORLD}/path"
BODY: Final = f"{WORLD}/drone"
CORRIDOR: Final = f"{WORLD}/corridor"  # in the heading-aligned frame: x forward, y left, z up
OBSTACLES: Final = f"{WORLD}/obstacles"
FIX: Final = f"{WORLD}/helipad_fix"
LENS: Final = f"{WORLD}/camera"  # image and overlays, in the image's pixels
DEPTH_LENS: Final = f"{WORLD}/depth"  # the same lens at the depth map's size
MASK: Final = "mask"
SITE_MAP: Final = "site_map"  # the mission's own map, an image
TREE: Final = "tree"
WORDS: Final = "words"
HEADING: Final = "plots/heading"
HEIGHT: Final = "plots/height"
FREE_DISTANCE: Final = "plots/free_distance"
TICK_TIME: Final = "plots/tick_time"
