"""The drawings of a lab: metres and pixels, content, axes, names, take-off pose."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.uav_bt.display.display_world import LAB as FULL_LAB
from tests.uav_bt.display.display_world import has, item
from uav_bt.display.canvas import INK
from uav_bt.display.lab_map import GROUND_COLOUR, LabMap, MapFrame, draw_lab, draw_lab_with_axes
from uav_bt.types import Pose2D

# 1000 x 828 pixels: 872 x 700 are left for the ground, which is 174.4 pixels a metre in width and
# 175 in height. The lower scale is used.
LAB, SIZE_PX, PX_PER_M = LabMap(ground=FULL_LAB.ground), (1000, 828), 174.4
MIDDLE_X, MIDDLE_Y = 500.0, 56.0 + 700.0 / 2


def pixel(x_m: float, y_m: float) -> tuple[int, int]:
    return round(MIDDLE_X + PX_PER_M * x_m), round(MIDDLE_Y - PX_PER_M * y_m)


@pytest.mark.parametrize("metre", [-2, 0, 2])
def test_each_metre_has_a_number_on_both_axes(metre: int) -> None:
    image = draw_lab_with_axes(LAB, size_px=SIZE_PX)
    column, below = pixel(metre, -2.0)
    assert has(image[below + 4 : below + 22, column - 10 : column + 10], INK)
    left, row = pixel(-2.5, metre)
    assert has(image[row - 8 : row + 8, left - 26 : left - 4], INK)


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


@pytest.mark.parametrize(("y_m", "is_below"), [(0.5, True), (-1.75, False)])
def test_a_name_is_written_below_its_box_and_above_it_at_the_edge(
    y_m: float, *, is_below: bool
) -> None:
    box = item(1.5, y_m, (0.4, 0.4, 1.9))
    without, named = (
        draw_lab_with_axes(replace(LAB, boxes=(replace(box, name=name),)), size_px=SIZE_PX)
        for name in ("", "box_4")
    )
    rows, columns = np.nonzero((named != without).any(axis=2))
    low, high = (pixel(1.5, y_m - 0.2)[1], pixel(1.5, y_m + 0.2)[1])
    assert rows.min() > low if is_below else rows.max() < high
    assert columns.mean() == pytest.approx(pixel(1.5, y_m)[0], abs=5)


def test_places_of_a_mission_are_dots() -> None:
    image = draw_lab_with_axes(replace(LAB, places=(("lab:1,0", (1.0, 0.0)),)), size_px=SIZE_PX)
    column, row = pixel(1.0, 0.0)
    assert tuple(image[row, column]) == (255, 170, 0)


@pytest.mark.parametrize("size_px", [(600, 1000), (1000, 500)])
def test_x_goes_right_y_goes_up_and_the_ground_fills_the_narrower_side(
    size_px: tuple[int, int],
) -> None:
    frame = MapFrame.around((5.0, 4.0), size_px, margin_m=0.5, above_px=0, below_px=0)
    middle_x, middle_y = size_px[0] / 2, size_px[1] / 2
    assert frame.scale_px_per_m == pytest.approx(100.0)
    assert frame.to_px((1.0, 1.5)) == pytest.approx((middle_x + 100.0, middle_y - 150.0))


def test_a_turned_box_has_its_corners_turned_counter_clockwise_and_a_round_one_a_circle() -> None:
    box = item(1.0, 2.0, (2.0, 4.0, 1.0), yaw_rad=math.pi / 2)
    assert np.allclose(box.corners(), [(-1.0, 3.0), (-1.0, 1.0), (3.0, 1.0), (3.0, 3.0)])
    circle = np.array(replace(box, round=True).corners())
    assert np.allclose(np.hypot(circle[:, 0] - 1.0, circle[:, 1] - 2.0), 1.0)


def test_boxes_and_the_mark_stand_where_the_world_has_them() -> None:
    frame = MapFrame.around(FULL_LAB.ground.size_m, (640, 440), above_px=0, below_px=0)
    image = draw_lab(FULL_LAB, frame)
    box, pad = FULL_LAB.boxes[0], FULL_LAB.mark
    assert pad is not None
    for y_m, there in ((box.y_m, True), (-box.y_m, False)):  # mirrored
        x, y = (round(v) for v in frame.to_px((box.x_m - 0.15, y_m + 0.15)))
        assert (tuple(image[y, x]) == box.colour) == there
    x, y = (round(v) for v in frame.to_px((pad.x_m, pad.y_m)))
    assert tuple(image[y, x]) == (255, 255, 255), "the bar of the H"
