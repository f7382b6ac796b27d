"""The drawings of a lab: metres and pixels, content, axes, names, take-off pose."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.uav_bt.display.display_world import LAB as FULL_LAB
from tests.uav_bt.display.display_world import has
from uav_bt.display.canvas import INK
from uav_bt.display.lab_drawing import (
    GROUND_COLOUR,
    draw_lab,
    draw_lab_with_axes,
    draw_legend,
)
from uav_bt.display.lab_map import LabMap, MapFrame, MapItem, phase_colours
from uav_bt.types import Pose2D

# 1000 x 828 pixels: 872 x 700 are left for the ground, which is 174.4 pixels a metre in width and
# 175 in height. The lower scale is used.
LAB, SIZE_PX, PX_PER_M = LabMap(ground_size_m=(5.0, 4.0)), (1000, 828), 174.4
MIDDLE_X, MIDDLE_Y = 500.0, 56.0 + 700.0 / 2


def pixel(x_m: float, y_m: float) -> tuple[int, int]:
    return round(MIDDLE_X + PX_PER_M * x_m), round(MIDDLE_Y - PX_PER_M * y_m)


def changed(one: np.ndarray, other: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the rows and columns that differ."""
    differs = (one != other).any(axis=2)
    return np.flatnonzero(differs.any(axis=1)), np.flatnonzero(differs.any(axis=0))


@pytest.mark.parametrize("metre", [-2, -1, 0, 1, 2])
def test_each_metre_has_a_tick_on_both_axes(metre: int) -> None:
    image = draw_lab_with_axes(LAB, size_px=SIZE_PX)
    column, below = pixel(metre, -2.0)
    assert image[below + 4, column - 1 : column + 2].max() > 130
    assert image[below + 4, column + 10 : column + 13].max() < 60
    left, row = pixel(-2.5, metre)
    assert image[row - 1 : row + 2, left - 4].max() > 130
    assert image[row + 10 : row + 13, left - 4].max() < 60


def test_the_arrow_points_along_the_take_off_heading_if_it_is_known() -> None:
    start = Pose2D(x_m=1.0, y_m=-1.0, yaw_rad=math.pi / 2)
    image = draw_lab_with_axes(replace(LAB, take_off=start), size_px=SIZE_PX)
    column, row = pixel(1.0, -0.75)
    assert tuple(image[row, column]) == INK, "up: y grows"
    column, row = pixel(1.25, -0.9)
    assert tuple(image[row, column]) == GROUND_COLOUR
    left, top = pixel(-2.5, 2.0)
    right, bottom = pixel(2.5, -2.0)
    random = draw_lab_with_axes(LAB, size_px=SIZE_PX)
    assert not has(random[top + 2 : bottom - 2, left + 2 : right - 2], INK)


@pytest.mark.parametrize(
    ("y_m", "side"),
    [(0.5, "below"), (-1.75, "above")],  # at the edge there is no room below
)
def test_a_name_is_written_beside_its_box(y_m: float, side: str) -> None:
    box = MapItem(x_m=1.5, y_m=y_m, size_m=(0.4, 0.4, 1.9))
    without = draw_lab_with_axes(replace(LAB, boxes=(box,)), size_px=SIZE_PX)
    with_name = draw_lab_with_axes(
        replace(LAB, boxes=(replace(box, name="box_4"),)), size_px=SIZE_PX
    )
    rows, columns = changed(with_name, without)
    low, high = (pixel(1.5, y_m - 0.2)[1], pixel(1.5, y_m + 0.2)[1])
    assert rows.min() > low if side == "below" else rows.max() < high
    assert columns.mean() == pytest.approx(pixel(1.5, y_m)[0], abs=5)


def test_a_name_keeps_off_a_neighbouring_box() -> None:
    box = MapItem(x_m=0.5, y_m=0.5, size_m=(0.4, 0.4, 1.9))
    neighbour = replace(box, y_m=0.08)  # 2 cm below
    without = draw_lab_with_axes(replace(LAB, boxes=(box, neighbour)), size_px=SIZE_PX)
    named = (replace(box, name="box_4"), neighbour)
    rows, _ = changed(draw_lab_with_axes(replace(LAB, boxes=named), size_px=SIZE_PX), without)
    assert rows.max() < pixel(0.5, 0.7)[1]


def test_the_origin_lies_in_the_middle_x_goes_right_and_y_goes_up() -> None:
    frame = MapFrame(size_px=(640, 440), scale_px_per_m=100.0)
    assert frame.to_px(0.0, 0.0) == (320.0, 220.0)
    assert frame.to_px(1.0, 0.0) == (420.0, 220.0)
    assert frame.to_px(0.0, 1.5) == (320.0, 70.0)


@pytest.mark.parametrize(("size_px", "scale"), [((600, 1000), 100.0), ((1000, 500), 100.0)])
def test_the_ground_and_its_margin_fill_the_narrower_side(
    size_px: tuple[int, int], scale: float
) -> None:
    frame = MapFrame.around((5.0, 4.0), size_px, margin_m=0.5)
    assert frame.scale_px_per_m == pytest.approx(scale)


def test_a_turned_box_has_its_corners_turned_counter_clockwise() -> None:
    box = MapItem(x_m=1.0, y_m=2.0, size_m=(2.0, 4.0, 1.0), yaw_rad=math.pi / 2)
    expected = [(-1.0, 3.0), (-1.0, 1.0), (3.0, 1.0), (3.0, 3.0)]
    assert np.allclose(box.corners(), expected)


def test_boxes_and_the_mark_stand_where_the_world_has_them() -> None:
    frame = MapFrame.around(FULL_LAB.ground_size_m, (640, 440))
    image = draw_lab(FULL_LAB, frame)
    box, pad = FULL_LAB.boxes[0], FULL_LAB.mark
    assert pad is not None
    for y_m, there in ((box.y_m, True), (-box.y_m, False)):  # mirrored
        x, y = (round(v) for v in frame.to_px(box.x_m - 0.15, y_m + 0.15))
        assert (tuple(image[y, x]) == box.colour) == there
    x, y = (round(v) for v in frame.to_px(pad.x_m, pad.y_m))
    assert tuple(image[y, x]) == (255, 255, 255), "the bar of the H"


def test_phases_get_colours_of_their_own_in_the_order_they_appear() -> None:
    colours = phase_colours(["", "explore", "explore", "search", "land"])
    assert list(colours) == ["", "explore", "search", "land"]
    assert len(set(colours.values())) == 4
    assert phase_colours(["explore"])["explore"] == colours["explore"]


def test_a_legend_that_is_too_long_keeps_its_last_phases() -> None:
    many = [f"phase {number}" for number in range(7)]
    image = np.zeros((30, 300, 3), dtype=np.uint8)
    draw_legend(image, phase_colours(many), base_px=20)
    assert (image[:, 290:] == 0).all()
    assert has(image, phase_colours(many)["phase 6"])
