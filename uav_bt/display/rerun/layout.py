"""Layout of the Rerun viewer, and the entities that are drawn and cleared."""

from __future__ import annotations

from typing import Any, Final

import rerun as rr
import rerun.blueprint as rrb

from uav_bt.display.canvas import BACKDROP, Colour
from uav_bt.display.rerun.setting import (
    DEPTH_LENS,
    FREE_DISTANCE,
    HEADING,
    HEIGHT,
    LENS,
    MASK,
    PATH,
    SITE_MAP,
    TICK_TIME,
    TIMELINE,
    TREE,
    WORDS,
    WORLD,
    ViewSetting,
)

_FLOOR: Final[Colour] = (60, 64, 72)


def layout(setting: ViewSetting) -> rrb.Blueprint:
    """Return the layout of a flight without panes that would stay empty."""
    eyes: list[rrb.View] = [rrb.Spatial2DView(origin=MASK, name="Mask")]
    if setting.makes_depth:
        eyes.append(rrb.Spatial2DView(origin=DEPTH_LENS, name="Metric depth"))
    seen = rrb.Vertical(
        rrb.Spatial2DView(origin=LENS, name="Camera"),
        rrb.Horizontal(*eyes),
        row_shares=[3, 2],
    )
    tabs: list[rrb.View] = [_world(setting.title)]
    if setting.makes_map:
        tabs.append(rrb.Spatial2DView(origin=SITE_MAP, name="Site map"))
    flown = rrb.Tabs(*tabs, rrb.TextLogView(origin=WORDS, name="Words"))
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


def _world(title: str) -> rrb.Spatial3DView:
    # Each tick adds one piece of the path, so that the path is not stored at every tick.
    so_far = rrb.VisibleTimeRanges(
        timeline=TIMELINE,
        start=rrb.TimeRangeBoundary.infinite(),
        end=rrb.TimeRangeBoundary.cursor_relative(),
    )
    return rrb.Spatial3DView(
        origin=WORLD,
        name=title or "Lab",
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


class Entities:
    """Entities that are drawn and may be cleared again.

    Args:
        stream: the recording.
    """

    def __init__(self, stream: rr.RecordingStream) -> None:
        self._stream = stream
        self._drawn: set[str] = set()

    def draw(self, entity: str, *things: Any) -> None:
        """Draw an entity; it replaces the earlier one.

        Args:
            entity: path of the entity.
            things: archetypes of Rerun.
        """
        self._stream.log(entity, *things)
        self._drawn.add(entity)

    def clear(self, *entities: str) -> None:
        """Clear those of the entities that are drawn."""
        for entity in self._drawn.intersection(entities):
            self._drawn.remove(entity)
            self._stream.log(entity, rr.Clear(recursive=False))
