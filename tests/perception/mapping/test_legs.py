"""Tables in a view: their bases lie between their legs, and the ground below is theirs."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest

from perception.mapping.ground_grid import GroundGrid
from perception.mapping.view import View
from uav_bt.lab.classes import LabClass, LabClasses
from uav_bt.testing import pinhole
from uav_bt.types import ClassMap, Frame, Pose2D
from uav_bt.types.arrays import Floats
from uav_bt.types.projection import project

CAMERA = pinhole(224, 126)
PITCH_RAD, HEIGHT_M = math.radians(-38), 1.5
HALF_M, BOARD_M, LEG_M = (0.6, 0.35), 0.75, 0.03  # of the table; its legs stand 0.1 m inwards
FLOOR, TABLE, TOP, CRATE = 1, 2, 3, 4


def lab(legs_m: float | None) -> LabClasses:
    return LabClasses(
        [
            LabClass(name="wall", role="outside", colour=(0, 0, 0)),
            LabClass(name="floor", role="ground", colour=(0, 0, 1)),
            LabClass(name="table", role="obstacle", colour=(0, 1, 0), top="top", legs_m=legs_m),
            LabClass(name="top", role="obstacle", colour=(0, 1, 1)),
            LabClass(name="crate", role="obstacle", colour=(1, 0, 0)),
        ]
    )


def view(*tables: Pose2D, legs_m: float | None = 1.3, board_m: float = BOARD_M) -> View:
    """Return a view with tables ahead, the farthest first."""
    ids = np.full((126, 224), FLOOR, dtype=np.uint8)
    for table in tables:
        draw(ids, table, board_m)
    frame = Frame(
        image=np.zeros((36, 64, 3), dtype=np.uint8),
        index=1,
        captured_s=1.0,
        gimbal_pitch_rad=PITCH_RAD,
        height_above_carpet_m=HEIGHT_M,
    )
    class_map = ClassMap(ids=ids, classes=lab(legs_m), captured_s=1.0)
    found = View.of(class_map, frame, CAMERA, Pose2D(x_m=0.0, y_m=0.0, yaw_rad=0.0))
    assert found is not None
    return found


def draw(ids: np.ndarray[tuple[int, ...], np.dtype[np.uint8]], table: Pose2D, top_m: float) -> None:
    """Draw four legs, the sides of the board and its top."""
    corners = table.rectangle(*HALF_M)
    for x_m, y_m in table.rectangle(HALF_M[0] - 0.1, HALF_M[1] - 0.1):
        solid(ids, replace(table, x_m=x_m, y_m=y_m).rectangle(LEG_M, LEG_M), 0.0, top_m, TABLE)
    solid(ids, corners, top_m - 0.05, top_m, TABLE)
    if top_m < HEIGHT_M:
        solid(ids, corners, top_m, top_m, TOP)


def solid(
    ids: np.ndarray[tuple[int, ...], np.dtype[np.uint8]],
    outline: list[tuple[float, float]],
    low_m: float,
    high_m: float,
    class_id: int,
) -> None:
    points_m = [(x_m, y_m, HEIGHT_M - at_m) for at_m in (low_m, high_m) for x_m, y_m in outline]
    pixels = project(np.array(points_m), CAMERA, PITCH_RAD)
    hull = cv2.convexHull(np.rint(pixels).astype(np.int32))
    cv2.fillConvexPoly(ids, hull, class_id)  # type: ignore[call-overload]


def beyond_m(points_m: Floats, table: Pose2D) -> Floats:
    """Return how far points lie outside the rectangle of a table's legs."""
    local_m = np.abs(table.points_to_body(points_m)) - (np.array(HALF_M) - 0.1 + LEG_M)
    return np.asarray(np.hypot(*np.maximum(local_m, 0.0).T))


@pytest.mark.parametrize("yaw_deg", [0, 25, 60, 90])
def test_bases_of_a_table_lie_between_its_legs(yaw_deg: int) -> None:
    table = Pose2D(x_m=2.0, y_m=0.1, yaw_rad=math.radians(yaw_deg))
    found = view(table)
    assert len(found.bases_m) > 12
    assert beyond_m(found.bases_m, table).max() < 0.12
    assert (found.base_ids == TABLE).all()
    assert np.nanmedian(found.base_heights_m) == pytest.approx(BOARD_M, abs=0.06)
    # Without legs the board's lower edge makes bases behind the table.
    assert beyond_m(view(table, legs_m=None).contacts.placed_m, table).max() > 0.3


def test_ground_below_a_table_is_seen_and_belongs_to_it() -> None:
    table = Pose2D(x_m=2.0, y_m=0.0, yaw_rad=math.pi / 2)
    found, without = view(table), view(table, legs_m=None)
    below_m = np.array([[1.9, 0.0], [2.2, 0.2]])
    beside_m = np.array([[1.4, 0.0], [1.9, 1.0]])
    assert without.shows_ground(np.vstack([below_m, beside_m]))[1].all()
    inside, free = found.shows_ground(np.vstack([below_m, beside_m]))
    assert inside.all()
    assert free.tolist() == [False, False, True, True]
    grid = GroundGrid()
    grid.add(found)
    assert not grid.was_ground(below_m).any()
    assert grid.was_ground(beside_m).all()


def test_a_leg_as_narrow_as_one_bearing_is_a_base() -> None:
    """The board is above the image, so that the legs stand alone."""
    table = Pose2D(x_m=2.2, y_m=0.0, yaw_rad=math.pi / 2)
    found = view(table, board_m=1.6)
    legs = np.array(table.rectangle(HALF_M[0] - 0.1, HALF_M[1] - 0.1))
    front = legs[legs[:, 0] < 2.2]
    apart_m = np.hypot(*np.moveaxis(front[:, None] - found.bases_m, -1, 0))
    assert (apart_m.min(axis=1) < 0.08).all()


def test_two_tables_apart_are_not_joined() -> None:
    first = Pose2D(x_m=1.6, y_m=-0.45, yaw_rad=math.pi / 2)
    second = replace(first, x_m=2.6, y_m=1.2)
    found = view(second, first)
    off_m = np.minimum(beyond_m(found.bases_m, first), beyond_m(found.bases_m, second))
    assert off_m.max() < 0.15


def test_a_board_beside_its_only_leg_in_view_makes_no_base() -> None:
    """The other front leg lies beyond the image."""
    table = Pose2D(x_m=1.7, y_m=-1.3, yaw_rad=math.pi / 2)
    assert beyond_m(view(table).bases_m, table).max() < 0.15
    assert beyond_m(view(table, legs_m=None).bases_m, table).max() > 0.5


def test_a_crate_is_placed_as_before() -> None:
    ids = np.full((126, 224), FLOOR, dtype=np.uint8)
    solid(ids, Pose2D(x_m=2.0, y_m=0.0, yaw_rad=0.0).rectangle(0.2, 0.3), 0.0, 0.6, CRATE)
    draws = [ClassMap(ids=ids, classes=lab(legs_m), captured_s=1.0) for legs_m in (None, 1.3)]
    frame = Frame(
        image=np.zeros((36, 64, 3), dtype=np.uint8),
        index=1,
        captured_s=1.0,
        gimbal_pitch_rad=PITCH_RAD,
        height_above_carpet_m=HEIGHT_M,
    )
    pose = Pose2D(x_m=0.0, y_m=0.0, yaw_rad=0.0)
    views = [View.of(each, frame, CAMERA, pose) for each in draws]
    assert views[0] is not None
    assert views[1] is not None
    assert len(views[0].bases_m) > 10
    assert np.array_equal(views[0].bases_m, views[1].bases_m)
