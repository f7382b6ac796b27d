"""Setting of a view in Rerun, and the viewer's layout."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import rerun.blueprint as rrb

from uav_bt.display.canvas import BACKDROP, Colour
from uav_bt.display.lab_map import LabMap
from uav_bt.display.video.perception_panes import Intruding
from uav_bt.lab.classes import LabClasses
from uav_bt.types import Airframe, CameraModel

TIMELINE: Final = "flight"  # seconds since the first tick

_PLOTS: Final = {
    "plots/heading": "Heading, deg",
    "plots/height": "Height, m",
    "plots/free_distance": "Free distance, m",
    "plots/tick_time": "Tick time, ms",
}
_FLOOR: Final[Colour] = (60, 64, 72)

TreeNode = tuple[str, str, int]  # path, label, and level below the root


@dataclass(frozen=True, kw_only=True, eq=False)
class ViewSetting:
    """What does not change during a flight."""

    camera: CameraModel  # intrinsics at the size of the frames
    classes: LabClasses
    airframe: Airframe = field(default_factory=Airframe)
    title: str = ""  # mission, scene and seed
    lab_map: LabMap | None = None  # None: unknown
    tree: tuple[TreeNode, ...] = ()  # in the order of the file, parents first
    makes_depth: bool = False  # whether the mission makes metric depth, which then has a pane
    makes_map: bool = False  # whether the mission keeps a site map, which then has a pane
    # Metres from the body's centre to the corridor's planes: aside, ahead, up and down.
    corridor_m: tuple[float, float, float] | None = None
    intruding: Intruding | None = None  # None: no pixel is marked


def layout(setting: ViewSetting) -> rrb.Blueprint:
    """Return the layout of a flight without panes that would stay empty."""
    eyes: list[rrb.View] = [rrb.Spatial2DView(origin="mask", name="Mask")]
    if setting.makes_depth:
        eyes.append(rrb.Spatial2DView(origin="world/depth", name="Metric depth"))
    camera = rrb.Spatial2DView(origin="world/camera", name="Camera")
    # Each tick adds one piece of the path, so that the path is not stored at every tick.
    so_far = rrb.VisibleTimeRanges(
        timeline=TIMELINE,
        start=rrb.TimeRangeBoundary.infinite(),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    tabs: list[rrb.View] = [
        rrb.Spatial3DView(
            origin="world",
            name=setting.title or "Lab",
            background=BACKDROP,
            line_grid=rrb.LineGrid3D(spacing=1.0, color=_FLOOR),
            overrides={"world/path": [so_far]},
            eye_controls=rrb.EyeControls3D(
                position=[-1.2, -6.0, 5.2], look_target=[0.0, 0.0, 0.3], eye_up=[0.0, 0.0, 1.0]
            ),
        )
    ]
    if setting.makes_map:
        tabs.append(rrb.Spatial2DView(origin="site_map", name="Site map"))
    above: list[rrb.Container | rrb.View] = [
        rrb.Vertical(camera, rrb.Horizontal(*eyes), row_shares=[3, 2]),
        rrb.Tabs(*tabs, rrb.TextLogView(origin="words", name="Words")),
    ]
    if setting.tree:
        above.append(rrb.TextDocumentView(origin="tree", name="Tree"))
    legend = rrb.PlotLegend(corner=rrb.Corner2D.LeftTop)
    plots = [
        rrb.TimeSeriesView(origin=origin, name=name, plot_legend=legend)
        for origin, name in _PLOTS.items()
    ]
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(*above, column_shares=[4, 5, 3][: len(above)]),
            rrb.Horizontal(*plots),
            row_shares=[5, 2],
        ),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE),
        auto_views=False,
    )
