"""The panes of class map, depth and corridor."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.paper_lab import CLASSES, paper_map
from tests.uav_bt.display.display_world import has
from uav_bt.board.blackboard import Reading
from uav_bt.display.canvas import ALARM, INK, PANEL
from uav_bt.display.video.perception_panes import (
    corridor_rows,
    draw_class_map,
    draw_corridor,
    draw_depth,
    empty_pane,
    legend_of,
)
from uav_bt.lab.classes import LabClass, LabClasses
from uav_bt.types import ClassMap, Corridor, DepthMap

PANE_PX = (638, 359)
GREY = np.full((36, 64, 3), 100, np.uint8)


def depth_map(value: float, unknown: slice | None = None) -> DepthMap:
    depth = np.full((28, 56), value, np.float32)
    if unknown is not None:
        depth[:, unknown] = np.nan
    return DepthMap(depth=depth, metric=True, captured_s=0.0, confidence=0.8)


def corridor(**changes: object) -> Corridor:
    values = {
        "captured_s": 0.0,
        "free_distance_m": 1.2,
        "nearest_m": 0.7,
        "nearest_side": "left",
        "time_to_impact_s": math.inf,
        "nearest_left_m": 0.7,
    } | changes
    return Corridor(**values)


def class_map(*ids: int) -> ClassMap:
    """Return a map with a vertical stripe of each class."""
    stripes = np.repeat(np.array(ids, dtype=np.uint8), 8)
    return paper_map(ids=np.tile(stripes, (28, 1)), captured_s=0.0)


def test_the_legend_has_the_classes_that_are_in_view_and_no_others() -> None:
    assert [name for name, _ in legend_of(class_map(9, 2, 2))] == ["helipad h", "box 6"]
    ids = np.full((100, 100), 3, dtype=np.uint8)
    ids[0, :5] = 7  # a few pixels are no entry
    assert [name for name, _ in legend_of(paper_map(ids))] == ["helipad box"]


def test_swatches_are_drawn_in_the_colours_of_their_classes() -> None:
    wall = LabClass(name="wall", role="outside", colour=(10, 10, 10))
    drum = LabClass(name="drum", role="obstacle", colour=(200, 30, 30))
    ids = np.zeros((100, 100), dtype=np.uint8)
    ids[90:, 90:] = 1
    seen = ClassMap(ids=ids, classes=LabClasses([wall, drum]), captured_s=0.0)
    legend = draw_class_map(seen, PANE_PX)[10:50]
    assert (legend == np.array(drum.colour)).all(axis=2).sum() >= 40


@pytest.mark.parametrize("size_px", [PANE_PX, (318, 178)])
def test_however_many_classes_are_in_view_the_legend_leaves_the_ground_free(
    size_px: tuple[int, int],
) -> None:
    dark = [each for each in range(17) if CLASSES.colours[each].min() < 150]
    bright = draw_class_map(class_map(*dark), size_px).min(axis=2) > 150
    assert bright[10:30].sum() > 100
    assert bright[30:50].sum() > 100
    assert bright[50:].sum() == 0
    assert bright[:, -10:].sum() == 0


def test_near_is_red_far_is_blue_and_unknown_is_neither() -> None:
    near = draw_depth(depth_map(0.6), PANE_PX)[200, 100].astype(int)
    far = draw_depth(depth_map(4.4), PANE_PX)[200, 100].astype(int)
    unknown = draw_depth(depth_map(0.6, slice(0, 28)), PANE_PX)[200, 100].astype(int)
    assert near[0] > near[2] + 80
    assert far[2] > far[0] + 80
    assert np.ptp(unknown) < 20, "grey"
    at_end, beyond = (draw_depth(depth_map(metres), PANE_PX)[200, 100] for metres in (5.0, 19.0))
    assert (at_end == beyond).all()


def test_a_pixel_has_the_colour_that_the_bar_shows_at_its_metres() -> None:
    image = draw_depth(depth_map(2.0), PANE_PX)
    bottom, top = PANE_PX[1] - 14, 34
    bar = image[top:bottom, PANE_PX[0] - 40].astype(int)
    same = np.flatnonzero(np.abs(bar - image[200, 100]).sum(axis=1) < 12)
    assert same.size
    assert 5.0 * (1.0 - same.mean() / (bottom - top)) == pytest.approx(2.0, abs=0.1)


def test_without_depth_the_pane_says_why() -> None:
    plain = draw_depth(None, PANE_PX)
    told = draw_depth(None, PANE_PX, why_none="the frame is black")
    assert tuple(plain[5, 5]) == PANEL
    assert np.count_nonzero((told == INK).all(axis=2)) > np.count_nonzero(
        (plain == INK).all(axis=2)
    )


def test_depth_that_is_not_all_that_was_asked_for_says_why() -> None:
    assert not has(draw_depth(depth_map(2.0, slice(None)), PANE_PX), ALARM), "nothing known"
    assert has(draw_depth(depth_map(2.0), PANE_PX, why_none="no scale: too little ground"), ALARM)


def test_a_long_reason_stays_within_a_small_pane() -> None:
    image = empty_pane("no depth: the class map is of another frame", (318, 178))
    assert (image[:, :4] == PANEL).all()
    assert (image[:, -4:] == PANEL).all()


def test_what_intrudes_is_marked_and_nothing_else() -> None:
    marked = np.zeros((28, 56), dtype=bool)
    marked[10:20, 30:40] = True
    image = draw_corridor(GREY, corridor(), marked, PANE_PX).astype(int)
    inside, outside = image[200, 400], image[250, 100]
    assert inside[0] > inside[2] + 40
    assert tuple(outside) == (50, 50, 50), "darkened"
    clear = corridor(nearest_side=None, nearest_m=math.inf, nearest_left_m=math.inf)
    assert not has(draw_corridor(GREY, clear, None, PANE_PX), ALARM)
    assert has(draw_corridor(GREY, corridor(), None, PANE_PX), ALARM), "the words"


def test_depth_and_what_is_inside_the_corridor_as_rows() -> None:
    rows = {
        name: value for name, value, _ in corridor_rows(Reading(depth_map(1.0), 0.2), corridor())
    }
    assert rows == {
        "depth": "0.2 s old, confidence 0.80",
        "inside": "left, 0.70 m",
        "ahead": "1.20 m",
        "left": "0.70 m",
        "right": "free",
        "unknown": "0 pixels of objects",
    }


@pytest.mark.parametrize(("age_s", "words"), [(math.inf, "none yet"), (2.5, "none for 2.5 s")])
def test_without_depth_the_rows_raise_alarm(age_s: float, words: str) -> None:
    rows = corridor_rows(Reading(None, age_s), None)
    assert [(value, colour) for _, value, colour in rows] == [(words, ALARM), ("unknown", ALARM)]


def test_depth_without_a_corridor_is_a_row_of_its_own() -> None:
    assert [value for _, value, _ in corridor_rows(Reading(depth_map(1.0), 0.1), None)][1:] == [
        "unknown"
    ]
