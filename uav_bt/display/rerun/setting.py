"""What does not change while a view lasts: entity paths, the flight's setting, the layout."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from numpy.typing import NDArray

from uav_bt.display.canvas import BACKDROP, Colour
from uav_bt.display.lab_map import LabMap
from uav_bt.display.video.depth_panes import Intruding
from uav_bt.errors import ShapeError, ValueRangeError
from uav_bt.tree import MissionTree
from uav_bt.types import CameraModel


class Entities:
    """What is drawn and may be taken away again.

    Args:
        stream: where to.
    """

    def __init__(self, stream: rr.RecordingStream) -> None:
        self._stream = stream
        self._drawn: set[str] = set()

    def draw(self, entity: str, *things: Any) -> None:
        """Draw an entity, in place of what it was.

        Args:
            entity: its path.
            things: Rerun's archetypes.
        """
        self._stream.log(entity, *things)
        self._drawn.add(entity)

    def clear(self, *entities: str) -> None:
        """Take entities away that are drawn."""
        for entity in self._drawn.intersection(entities):
            self._drawn.remove(entity)
            self._stream.log(entity, rr.Clear(recursive=False))


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
TREE: Final = "tree"
WORDS: Final = "words"
HEADING: Final = "plots/heading"
HEIGHT: Final = "plots/height"
FREE_DISTANCE: Final = "plots/free_distance"
TICK_TIME: Final = "plots/tick_time"


_FLOOR: Final[Colour] = (60, 64, 72)


def layout(setting: ViewSetting) -> rrb.Blueprint:
    """Return the layout of a flight; panes that would stay empty are left out."""
    eyes: list[rrb.View] = [rrb.Spatial2DView(origin=MASK, name="Mask")]
    if setting.makes_depth:
        eyes.append(rrb.Spatial2DView(origin=DEPTH_LENS, name="Metric depth"))
    seen = rrb.Vertical(
        rrb.Spatial2DView(origin=LENS, name="Camera"),
        rrb.Horizontal(*eyes),
        row_shares=[3, 2],
    )
    flown = rrb.Tabs(_world(), rrb.TextLogView(origin=WORDS, name="Words"))
    above: list[rrb.Container | rrb.View] = [seen, flown]
    if setting.tree:
        above.append(rrb.GraphView(origin=TREE, name="Tree"))
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(*above, column_shares=[4, 5, 3][: len(above)]),
            rrb.Horizontal(*_plots()),
            row_shares=[5, 2],
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE),
        auto_views=False,
    )


def _world() -> rrb.Spatial3DView:
    # The path is one piece a tick, so that a long flight does not repeat it every tick.
    so_far = rrb.VisibleTimeRanges(
        timeline=TIMELINE,
        start=rrb.TimeRangeBoundary.infinite(),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    return rrb.Spatial3DView(
        origin=WORLD,
        name="Lab",
        background=BACKDROP,
        line_grid=rrb.LineGrid3D(spacing=1.0, color=_FLOOR),
        overrides={PATH: [so_far]},
        eye_controls=rrb.EyeControls3D(
            position=[-1.2, -6.0, 5.2], look_target=[0.0, 0.0, 0.3], eye_up=[0.0, 0.0, 1.0]
        ),
    )


def _plots() -> list[rrb.View]:
    named = {
        HEADING: "Heading error, deg",
        HEIGHT: "Height, m",
        FREE_DISTANCE: "Free distance, m",
        TICK_TIME: "Tick time, ms",
    }
    return [
        rrb.TimeSeriesView(
            origin=origin, name=name, plot_legend=rrb.PlotLegend(corner=rrb.Corner2D.LeftTop)
        )
        for origin, name in named.items()
    ]
