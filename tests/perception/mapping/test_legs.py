"""Tables in a view: their bases lie between their legs, and the ground below is theirs."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from behaviours.path.clearance import ClearanceMap
from behaviours.path.nearby import RecentObstacles
from perception.mapping.ground_grid import GroundGrid
from perception.mapping.landmarks import Landmarks, find_free
from perception.mapping.site_mapper import SiteMapper
from perception.mapping.view import View
from tests.worlds import values
from uav_bt.lab.classes import LabClass, LabClasses
from uav_bt.testing import pinhole
from uav_bt.types import ClassMap, Pose2D
from uav_bt.types.arrays import Floats
from uav_bt.types.dead_reckoning import OdometryPose
from uav_bt.types.projection import project
from uav_bt.types.site_map import SiteMap

CAMERA = replace(pinhole(224, 126), forward_offset_m=0.0)
PITCH_RAD, HEIGHT_M = math.radians(-38), 1.5
Ids = NDArray[np.uint8]
HERE = OdometryPose(time_s=1.0, x_m=0.0, y_m=0.0, yaw_rad=0.0)
HALF_M, BOARD_M, LEG_M = (0.6, 0.35), 0.75, 0.03  # of the table; its legs stand 0.1 m inwards
FLOOR, TABLE, TOP = 1, 2, 3


def lab(legs_m: float | None) -> LabClasses:
    return LabClasses(
        [
            LabClass(name="wall", role="outside", colour=(0, 0, 0)),
            LabClass(name="floor", role="ground", colour=(0, 0, 1)),
            LabClass(name="table", role="obstacle", colour=(0, 1, 0), top="top", legs_m=legs_m),
            LabClass(name="top", role="obstacle", colour=(0, 1, 1)),
        ]
    )


def view(
    table: Pose2D,
    legs_m: float | None = 1.3,
    board_m: float = BOARD_M,
    drone: OdometryPose = HERE,
) -> View:
    """Return the view from a pose, with a table ahead of the drone."""
    frame = values.frame((36, 64), PITCH_RAD, HEIGHT_M, captured_s=drone.time_s)
    ids = drawn(table, board_m)
    class_map = ClassMap(ids=ids, classes=lab(legs_m), captured_s=drone.time_s)
    return View.of(class_map, frame, CAMERA, drone)


def drawn(table: Pose2D, top_m: float) -> Ids:
    """Draw four legs, the sides of the board and its top."""
    ids = np.full((126, 224), FLOOR, dtype=np.uint8)
    corners = table.rectangle(*HALF_M)
    for x_m, y_m in table.rectangle(HALF_M[0] - 0.1, HALF_M[1] - 0.1):
        solid(ids, replace(table, x_m=x_m, y_m=y_m).rectangle(LEG_M, LEG_M), 0.0, top_m, TABLE)
    solid(ids, corners, top_m - 0.05, top_m, TABLE)
    if top_m < HEIGHT_M:
        solid(ids, corners, top_m, top_m, TOP)
    return ids


def solid(
    ids: Ids, outline: list[tuple[float, float]], low_m: float, high_m: float, class_id: int
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
    assert len(found.bases.xy_m) > 12
    assert beyond_m(found.bases.xy_m, table).max() < 0.12
    assert (found.bases.ids == TABLE).all()
    assert np.nanmedian(found.bases.heights_m) == pytest.approx(BOARD_M, abs=0.06)
    # Without legs the board's lower edge makes bases behind the table.
    assert beyond_m(view(table, legs_m=None).contacts.placed.xy_m, table).max() > 0.3


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
    apart_m = np.hypot(*np.moveaxis(front[:, None] - found.bases.xy_m, -1, 0))
    assert (apart_m.min(axis=1) < 0.08).all()


def flown(legs_m: float | None, table: Pose2D, board_m: float) -> SiteMap:
    """Return the map of a flight from 4 m to 1.6 m before a table."""
    mapper = SiteMapper(lab(legs_m))
    for step in range(40):
        drone = replace(HERE, time_s=0.2 * step, x_m=0.06 * step)
        mapper.follow(values.motion(drone))
        ahead = replace(table, x_m=table.x_m - drone.x_m)
        mapper.add(view(ahead, legs_m, board_m, drone))
    return mapper.map(values.motion(drone))


def test_no_route_leads_between_the_legs_of_a_table_at_flight_height() -> None:
    """Ground around the legs is seen before they are near; the board is above the image."""
    table = Pose2D(x_m=4.0, y_m=0.0, yaw_rad=math.pi / 2)
    found = flown(1.3, table, board_m=1.6)
    (item,) = found.objects
    assert math.hypot(item.x_m - table.x_m, item.y_m - table.y_m) < 0.2
    assert item.size_m == pytest.approx(1.0, abs=0.15)
    assert not found.movers
    below_m = (3.9, 0.0)
    assert ClearanceMap(found, RecentObstacles()).clearance_at(*below_m) < 0.05
    without = flown(None, table, board_m=1.6)
    assert ClearanceMap(without, RecentObstacles()).clearance_at(*below_m) > 0.3


def test_a_displaced_leg_stays_on_the_map() -> None:
    table = Pose2D(x_m=2.2, y_m=0.0, yaw_rad=math.pi / 2)
    found = view(table, board_m=1.6)
    known = Landmarks.of(found, found.bases.xy_m, found.bases.ids)
    known = known.take(np.argsort(known.xy_m[:, 0])[:2])
    known.xy_m[:] = [known.xy_m[0] - np.array([0.12, 0.0]), (1.3, 0.0)]
    on_legs = lab(1.3).legs_m > 0.0
    assert find_free(known, found, on_legs)[1].tolist() == [False, True]
    assert find_free(known, found, np.zeros_like(on_legs))[1].tolist() == [True, True]
