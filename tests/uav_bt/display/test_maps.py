"""Drawings of a lab, and the map pane of a flight: path, drone, view, the mission's own map."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from tests.paper_lab import CLASSES
from tests.uav_bt.display.display_world import CAMERA, LAB, World, facts, has, item, shown_of
from tests.worlds import values
from uav_bt.board import MARK, SITE_MAP
from uav_bt.display.canvas import ALARM, INK
from uav_bt.display.lab_map import (
    GROUND_COLOUR,
    HEADER_PX,
    LabMap,
    MapFrame,
    MapPlace,
    draw_lab,
    draw_lab_with_axes,
)
from uav_bt.display.map_pane import FOOTER_PX, OUTSIDE_COLOUR, PASSED, SEEN, MapPane, ground_view
from uav_bt.display.shown import FlownPath, Shown, phase_colours
from uav_bt.types import MarkFix, MoverState, Pose, Pose2D
from uav_bt.types.site_map import MapMover, MapObject, SiteMap

# 1000 x 828 pixels: 872 x 700 are left for the ground, which is 174.4 pixels a metre in width and
# 175 in height. The lower scale is used.
BARE, SIZE_PX, PX_PER_M = LabMap(ground=LAB.ground), (1000, 828), 174.4
MIDDLE_X, MIDDLE_Y = 500.0, 56.0 + 700.0 / 2


def pixel(x_m: float, y_m: float) -> tuple[int, int]:
    return round(MIDDLE_X + PX_PER_M * x_m), round(MIDDLE_Y - PX_PER_M * y_m)


@pytest.mark.parametrize("metre", [-2, 0, 2])
def test_each_metre_has_a_number_on_both_axes(metre: int) -> None:
    image = draw_lab_with_axes(BARE, size_px=SIZE_PX)
    column, below = pixel(metre, -2.0)
    assert has(image[below + 4 : below + 22, column - 10 : column + 10], INK)
    left, row = pixel(-2.5, metre)
    assert has(image[row - 8 : row + 8, left - 26 : left - 4], INK)


def test_the_arrow_points_along_the_take_off_heading_if_it_is_known() -> None:
    start = Pose2D(x_m=1.0, y_m=-1.0, yaw_rad=math.pi / 2)
    image = draw_lab_with_axes(replace(BARE, take_off=start), size_px=SIZE_PX)
    column, row = pixel(1.0, -0.75)
    assert tuple(image[row, column]) == INK, "up: y grows"
    column, row = pixel(1.25, -0.9)
    assert tuple(image[row, column]) == GROUND_COLOUR
    left, top = pixel(-2.5, 2.0)
    right, bottom = pixel(2.5, -2.0)
    random = draw_lab_with_axes(BARE, size_px=SIZE_PX)
    assert not has(random[top + 2 : bottom - 2, left + 2 : right - 2], INK)


@pytest.mark.parametrize(("y_m", "is_below"), [(0.5, True), (-1.75, False)])
def test_a_name_stands_below_its_box_or_above_it_at_the_edge(y_m: float, *, is_below: bool) -> None:
    box = item(1.5, y_m, (0.4, 0.4, 1.9))
    without, named = (
        draw_lab_with_axes(replace(BARE, boxes=(replace(box, name=name),)), size_px=SIZE_PX)
        for name in ("", "box_4")
    )
    rows, columns = np.nonzero((named != without).any(axis=2))
    low, high = (pixel(1.5, y_m - 0.2)[1], pixel(1.5, y_m + 0.2)[1])
    assert rows.min() > low if is_below else rows.max() < high
    assert columns.mean() == pytest.approx(pixel(1.5, y_m)[0], abs=5)


def test_places_of_a_mission_are_dots() -> None:
    good = MapPlace(text="lab:1,0", at_m=(1.0, 0.0))
    bad = MapPlace(text="lab:-1,0", at_m=(-1.0, 0.0), note="0.1 m to box-2", fault="no room")
    later = MapPlace(text="object:3", at_m=None)
    area_m = ((-1.25, -1.25), (1.25, -1.25), (1.25, 1.25), (-1.25, 1.25))
    lab = replace(BARE, places=(good, bad, later), areas_m=(area_m,))
    image = draw_lab_with_axes(lab, size_px=SIZE_PX)
    orange = (255, 170, 0)
    for at_m, colour in (((1.0, 0.0), orange), ((-1.0, 0.0), ALARM), ((0.0, 1.25), orange)):
        column, row = pixel(*at_m)
        assert image[row, column].tolist() == pytest.approx(colour, abs=30)


def test_a_mark_shows_its_top_and_a_mesh_its_pieces() -> None:
    """The upper edge of the mark is towards the y axis of its pose, which points left here."""
    top = np.zeros((40, 40, 3), dtype=np.uint8)
    top[:20] = (250, 10, 20)
    mark = item(0.0, 0.0, (1.0, 1.0, 0.0), yaw_rad=math.pi / 2, picture=top)
    triangle_m = ((1.5, 0.0), (2.0, 0.0), (2.0, 0.5))
    mesh = item(1.75, 0.25, (0.5, 0.5, 1.0), colour=(9, 99, 199), pieces_m=(triangle_m,))
    lab = replace(BARE, mark=mark, boxes=(mesh,))
    image = draw_lab(lab, MapFrame(size_px=(600, 600), scale_px_per_m=100.0))
    drawn = [tuple(image[300 - y, 300 + x]) for x, y in ((-30, 0), (30, 0), (195, 5), (155, 40))]
    assert drawn == [(250, 10, 20), (0, 0, 0), (9, 99, 199), GROUND_COLOUR]
    assert mesh.distance_m(1.6, 0.4) == pytest.approx(0.3 / math.sqrt(2), abs=1e-6)
    assert mesh.distance_m(1.9, 0.1) == 0.0


@pytest.mark.parametrize("size_px", [(600, 1000), (1000, 500)])
def test_x_goes_right_y_goes_up_and_the_ground_fills_a_side(size_px: tuple[int, int]) -> None:
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
    frame = MapFrame.around(LAB.ground.size_m, (640, 440), above_px=0, below_px=0)
    image = draw_lab(LAB, frame)
    box, pad = LAB.boxes[0], LAB.mark
    assert pad is not None
    for y_m, there in ((box.y_m, True), (-box.y_m, False)):  # mirrored
        x, y = (round(v) for v in frame.to_px((box.x_m - 0.15, y_m + 0.15)))
        assert (tuple(image[y, x]) == box.colour) == there
    x, y = (round(v) for v in frame.to_px((pad.x_m, pad.y_m)))
    assert tuple(image[y, x]) == (255, 255, 255), "the bar of the H"


# --- the map pane ---------------------------------------------------------------------------------

PANE_PX = (638, 439)
FRAME = MapFrame.around(LAB.ground.size_m, PANE_PX, above_px=HEADER_PX, below_px=FOOTER_PX)
EXPLORE = phase_colours(["explore"])["explore"]


def test_a_camera_sees_a_rectangle_straight_below_and_no_farther_than_its_reach() -> None:
    corners = ground_view(CAMERA, -math.pi / 2, 1.5, reach_m=9.0)
    forward = [point[0] - CAMERA.forward_offset_m for point in corners]
    right = [point[1] for point in corners]
    half_high, half_wide = (1.5 * n / 2 / CAMERA.fx_px for n in (CAMERA.height_px, CAMERA.width_px))
    assert forward == pytest.approx([half_high, half_high, -half_high, -half_high])
    assert right == pytest.approx([-half_wide, half_wide, half_wide, -half_wide])
    for ahead_m, right_m in ground_view(CAMERA, 0.9, 1.5, reach_m=2.0):  # it looks up
        assert math.hypot(ahead_m - CAMERA.forward_offset_m, right_m) == pytest.approx(2.0)


class Live:
    """A map pane of a flight."""

    def __init__(self, lab: LabMap | None = LAB, title: str = "") -> None:
        self.world, self.flown = World(), FlownPath()
        self.pane = MapPane(facts(lab_map=lab, title=title), PANE_PX)

    def fly(self, x_m: float, y_m: float, yaw_rad: float = 0.0, **changes: Any) -> np.ndarray:
        record = self.world.tick(pose=Pose(x_m=x_m, y_m=y_m, z_m=1.5, yaw_rad=yaw_rad))
        state = replace(record.observation.state, **changes.pop("state", {}))
        record = replace(record, observation=replace(record.observation, state=state), **changes)
        self.flown.add(record)
        return self.pane.draw(Shown(record, self.flown, self.world.board))


def at(image: np.ndarray, x_m: float, y_m: float) -> tuple[int, ...]:
    column, row = (round(v) for v in FRAME.to_px((x_m, y_m)))
    return tuple(image[row, column])


def test_what_moves_is_drawn_where_it_is() -> None:
    colour = (10, 20, 30)
    path_m = ((-1.0, 1.2), (1.0, 1.2))
    mover = item(-1.0, 1.2, (0.4, 0.4, 1.7), colour=colour, round=True, path_m=path_m)
    live = Live(replace(LAB, movers=(mover,)))
    assert at(live.fly(0.0, -1.5), -1.0, 1.2) == colour, "where its path begins"
    there = Pose(x_m=0.5, y_m=1.2, z_m=0.85, yaw_rad=0.0)
    moved = MoverState(name="mover-1", pose=there, vx_mps=0.5, vy_mps=0.0)
    truth = values.truth(Pose(x_m=0.0, y_m=-1.5, z_m=1.5, yaw_rad=0.0), 0.1)
    image = live.fly(0.0, -1.5, truth=replace(truth, movers=(moved,)))
    assert at(image, 0.5, 1.2) == colour
    assert at(image, -1.0, 1.2) != colour


def test_the_camera_view_lies_where_the_drone_looks() -> None:
    """Yaw is counter-clockwise: the view of a drone with heading +y is above it on the map."""
    live = Live()
    empty = live.pane.draw(shown_of(live.world, live.world.tick()))
    image = live.fly(0.0, -0.5, math.pi / 2)
    points = {"ahead": (0.0, 0.6), "behind": (0.0, -1.4), "right": (1.2, -0.5)}
    changed = {name: at(image, *point) != at(empty, *point) for name, point in points.items()}
    assert changed == {"ahead": True, "behind": False, "right": False}


def test_a_fix_is_marked_where_the_drone_believes_the_mark() -> None:
    live = Live()
    fix = MarkFix(captured_s=0.0, forward_m=-1.0, right_m=0.5, height_m=0.4, detected=True)
    live.world.board.write(MARK, fix)
    assert at(live.fly(0.0, 0.0, math.pi / 2), 0.5, -1.0) == (255, 196, 0)


def test_the_title_stands_above_the_lab_also_if_that_is_unknown() -> None:
    plain, titled = (Live(None, title).fly(0.0, 0.0) for title in ("", "land_only in train-a"))
    rows = np.flatnonzero((plain != titled).any(axis=(1, 2)))
    assert rows.size > 0
    assert rows.max() < HEADER_PX


def test_a_long_path_costs_no_more_than_a_short_one() -> None:
    """Each piece is drawn once, also on the mission's own map."""
    live = Live()
    live.world.board.write(SITE_MAP, believed())
    live.flown.points += [((math.sin(n), math.cos(n)), "") for n in range(3000)]
    live.fly(0.0, 0.0)
    drawn = live.pane._drawn
    live.fly(0.0, 0.0)
    assert live.pane._drawn == drawn + 1


def believed(x_m: float = 0.0, **more: Any) -> SiteMap:
    """Return a map with ground ahead of the start and to its right only."""
    rows, columns = np.indices((21, 21))
    ahead, right = rows - 10 > 0, columns - 10 > 0
    return values.site_map(
        21,
        pose=Pose2D(x_m=x_m, y_m=0.0, yaw_rad=0.0),
        corner_m=(-1.0, -1.0),
        seen_s=np.where(ahead, 1.0, -np.inf),
        free=ahead,
        outside=~ahead & right,
        passed=ahead & ~right,
        captured_s=1.0,
        **more,
    )


def test_the_missions_map_lies_where_the_drone_saw_it() -> None:
    """The drone starts at (0.5, 0) with heading y: x is to its right, and y is ahead."""
    box_2 = MapObject(class_id=5, x_m=0.5, y_m=0.5, size_m=0.3, width_m=0.3, std_m=0.1, seen_s=1.0)
    live = Live()
    down = {"gimbal_pitch_rad": -math.pi / 2, "height_above_ground_m": 0.01}

    def shown(y_m: float, site_map: SiteMap | None) -> np.ndarray:
        if site_map is not None:
            live.world.board.write(SITE_MAP, site_map)
        return live.fly(0.5, y_m, math.pi / 2, state=down)

    assert at(shown(0.0, None), 1.2, 0.7) not in {SEEN, PASSED, OUTSIDE_COLOUR}
    still = {
        "x_mps": 0.0,
        "y_mps": 0.0,
        "std_m": 0.1,
        "std_mps": 0.1,
        "first_s": 0.0,
        "seen_s": 1.0,
    }
    cart = MapMover(id=1, x_m=0.7, y_m=-0.6, radius_m=0.25, **still)
    points_m = np.array([[0.8, -0.3]])
    image = shown(0.0, believed(objects=(box_2,), movers=(cart,), obstacles_m=points_m))
    assert at(image, 1.3, 0.8) == SEEN
    assert at(image, -0.2, 0.8) == PASSED
    assert at(image, 1.3, -0.8) == OUTSIDE_COLOUR
    assert at(image, 1.0 - 0.15, 0.5) == tuple(CLASSES.colours[5]), "an object's side in its colour"
    assert at(image, 0.2, 0.8) == (255, 110, 90), "an obstacle ahead and to the left"
    assert at(image, -0.1 + 0.25, 0.7) == (255, 200, 40), "the circle around a mover"
    assert at(image, 0.8, 1.1)[2] > 180, "the side of the real box"
    live.world.board.forget(SITE_MAP)
    assert np.array_equal(shown(0.0, None), image), "the last map stays"
    image = [shown(0.4, believed(0.4)) for _ in range(2)][-1]
    assert at(image, 0.5, 0.2) == EXPLORE, "the path lies on top"
    assert live.flown.distance_m == pytest.approx(0.4)


def test_without_one_the_telemetry_is_added_up_from_where_it_looked_first() -> None:
    world, flown = World(), FlownPath()
    flown.add(world.tick(yaw_rad=1.0, forward_mps=2.0))
    flown.add(world.tick(yaw_rad=1.0, forward_mps=2.0))
    # Between two ticks it flies at their mean speed and mean heading. The drone's yaw is
    # clockwise: an eighth of a turn to the right is towards the world's -y.
    pose = flown.add(world.tick(yaw_rad=1.0 + math.pi / 2, forward_mps=0.0))
    eighth_m = 0.1 * math.sqrt(0.5)
    assert (pose.x_m, pose.y_m) == (pytest.approx(0.2 + eighth_m), pytest.approx(-eighth_m))
    assert pose.yaw_rad == pytest.approx(-math.pi / 2)
    assert flown.distance_m == pytest.approx(0.3)
