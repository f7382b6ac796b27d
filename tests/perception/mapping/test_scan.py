"""Scans of a view: points by contact, their match with the map, and legs."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from behaviours.path.clearance import ClearanceMap
from behaviours.path.nearby import RecentObstacles
from perception.mapping.contact_scan import GroundScan, find_bases, scan_ground
from perception.mapping.ground_grid import GroundGrid
from perception.mapping.landmarks import Landmarks, find_free
from perception.mapping.registration import _GATE_M, _LINE_RATIO, _LINE_REACH_M, _equations
from perception.mapping.site_mapper import SiteMapper
from perception.mapping.view import View
from tests.paper_lab import CLASS_COUNT, paper_map
from tests.worlds import values
from uav_bt.lab.classes import NO_ROLE, LabClass, LabClasses
from uav_bt.testing import pinhole
from uav_bt.types import CameraModel, ClassMap, Frame, Pose2D
from uav_bt.types.arrays import Floats
from uav_bt.types.dead_reckoning import OdometryPose
from uav_bt.types.projection import project
from uav_bt.types.site_map import SiteMap

CAMERA = replace(pinhole(224, 112), forward_offset_m=0.1)
HERE = Pose2D(x_m=0.0, y_m=0.0, yaw_rad=0.0)


def noise(seed: int = 0) -> ClassMap:
    """Return a class map in which every pixel has a random class."""
    ids = np.random.default_rng(seed).integers(0, CLASS_COUNT, (112, 224), dtype=np.uint8)
    return paper_map(ids=ids, captured_s=1.0)


def frame(pitch_rad: float) -> Frame:
    return values.frame((36, 64), pitch_rad, captured_s=1.0, index=1)


def along(samples: int, bearings: int = 4) -> np.ndarray:
    """Return places a metre apart, straight ahead on each bearing."""
    level_m = np.zeros((bearings, samples, 2))
    level_m[..., 0] = np.arange(samples)
    return level_m


@pytest.mark.parametrize("pitch_deg", [-5, -40, -85])
def test_a_sample_has_the_class_of_the_nearest_pixel(pitch_deg: int) -> None:
    class_map, pitch_rad = noise(), math.radians(pitch_deg)
    scan = scan_ground(class_map, frame(pitch_rad), CAMERA)
    down_m = np.full((*scan.ids.shape, 1), 1.5)
    pixels = np.rint(project(np.concatenate([scan.level_m, down_m], axis=-1), CAMERA, pitch_rad))
    inside = ((pixels >= 0) & (pixels <= (223, 111))).all(axis=-1)
    columns, rows = pixels[inside].astype(int).T
    assert inside.any()
    assert np.array_equal(scan.ids[inside], class_map.ids[rows, columns])
    assert np.array_equal(scan.roles[inside], class_map.roles[rows, columns])
    assert (scan.ids[~inside] == NO_ROLE).all()
    assert (scan.roles[~inside] == NO_ROLE).all()


@pytest.mark.parametrize("half_view_deg", [21, 35, 40])
def test_no_sample_lies_behind_the_camera(half_view_deg: int) -> None:
    """Pitched down by 1 rad, a lens of 80 degrees sees the ground behind the point below it."""
    focal_px = 56.0 / math.tan(math.radians(half_view_deg))
    wide = CameraModel(
        width_px=224, height_px=112, fx_px=focal_px, fy_px=focal_px, cx_px=111.5, cy_px=55.5
    )
    level_m = scan_ground(noise(), frame(-1.0), wide).level_m
    assert (level_m[..., 0] > 0.0).all()
    assert (np.diff(np.hypot(*np.moveaxis(level_m, -1, 0)), axis=1) > 0.0).all()


@pytest.mark.parametrize(
    ("roles", "kind", "at_m"),  # roles: 0 outside, 1 ground, 3 obstacle
    [
        pytest.param([1, 3, 1, 3, 3, 0], "placed", 2.5, id="a speck, then an obstacle"),
        pytest.param([1, 3, 3, 0, 0, 0], "placed", 0.5, id="no edge behind an obstacle"),
        pytest.param([NO_ROLE, 3, 3, 1, 1, 1], "hidden_m", 1.0, id="a base below the image"),
        pytest.param([1, 1, 0, 0, 3, 3], "edges_m", 1.5, id="the ground ends before an obstacle"),
        pytest.param([0, 0, 0, 1, 1, 1], "hidden_edges_m", 0.0, id="the ground ended before"),
        pytest.param([1, 1, 1, 1, 1, 3], "", 0.0, id="too short"),
        pytest.param([0, 0, 3, 3, 0, 0], "hidden_edges_m", 0.0, id="no ground below"),
    ],
)
def test_the_nearest_long_run_of_a_role_counts(roles: list[int], kind: str, at_m: float) -> None:
    """Runs have two samples at least."""
    ids = np.array([roles], dtype=np.uint8)
    bases = find_bases(GroundScan(along(6, 1), ids, ids, 1.5, min_run=2))
    found = {**vars(bases), "placed": bases.placed.xy_m}
    for each in ("placed", "hidden_m", "edges_m", "hidden_edges_m"):
        assert found[each][:, 0].tolist() == [at_m] * (each == kind)


@pytest.mark.parametrize(("height_m", "last"), [(1.4, 4), (1.2, 3), (2.0, 2)])
def test_an_obstacle_is_tall_up_to_a_height_or_to_the_drone(height_m: float, last: int) -> None:
    """From 1.5 m on it covers up to 0.9 m of height, or up to 0.5 m below the camera."""
    roles = np.array([[1, 1] + [3] * (end - 1) + [1] * (9 - end) for end in range(2, 10)], np.uint8)
    scan = GroundScan(along(10, 8), roles, roles, height_m, min_run=1)
    assert find_bases(scan).placed.tall.tolist() == [end >= last for end in range(2, 10)]


def test_a_point_of_the_ground_has_the_role_of_the_nearest_pixel() -> None:
    class_map, pitch_rad = noise(1), -0.6
    view = View.of(class_map, frame(pitch_rad), CAMERA, HERE)
    points_m = np.random.default_rng(2).uniform((-1.0, -3.0), (6.0, 3.0), (40, 5, 2))
    inside, shows = view.shows_ground(points_m)
    down_m = np.full((40, 5, 1), 1.5)
    pixels = project(np.concatenate([points_m, down_m], axis=-1), CAMERA, pitch_rad)
    with np.errstate(invalid="ignore"):
        expected = ((pixels >= 0) & (pixels <= (223, 111))).all(axis=-1)
    columns, rows = np.rint(pixels[expected]).astype(int).T
    assert 0 < np.count_nonzero(expected) < expected.size
    assert np.array_equal(inside, expected)
    assert np.array_equal(shows[expected], class_map.is_ground[rows, columns])
    assert not shows[~expected].any()


def test_a_camera_that_looks_up_shows_no_ground() -> None:
    view = View.of(noise(), frame(0.5), CAMERA, HERE)
    grid = GroundGrid()
    grid.add(view)
    assert not grid.free.any()
    assert not np.isfinite(grid.seen_s).any()


# --- the least squares of one round of matching ---------------------------------------------------


@pytest.mark.parametrize("seed", range(4))
def test_each_place_is_matched_across_the_line_of_its_neighbours(seed: int) -> None:
    rng = np.random.default_rng(seed)
    along_m = rng.uniform(-2.0, 2.0, 150)
    wall_m = np.column_stack([along_m, 0.3 * along_m + rng.normal(0.0, 0.01, 150)])
    known_m = np.concatenate([wall_m, rng.uniform(-2.0, 2.0, (60, 2))])
    places_m = known_m[::3] + rng.normal(0.0, 0.1, (70, 2))
    origin_m, std_m = np.array([0.4, -0.2]), rng.uniform(0.03, 0.08, 70)
    distances_m, indices = cKDTree(known_m).query(places_m, k=6)

    expected_m, slopes, weights = [], [], []
    for place_m, near_m, rows, std in zip(places_m, distances_m, indices, std_m, strict=True):
        if near_m[0] > _GATE_M:
            continue
        around_m = known_m[rows[near_m <= near_m[0] + _LINE_REACH_M]]
        spread_m = around_m - around_m.mean(axis=0)
        values, vectors = np.linalg.eigh(spread_m.T @ spread_m)
        if values[1] > _LINE_RATIO * max(values[0], 1e-9):
            normal, foot_m = vectors[:, 0], around_m.mean(axis=0)
        else:
            normal, foot_m = (place_m - around_m[0]) / near_m[0], around_m[0]
        x_m, y_m = place_m - origin_m
        expected_m.append(normal @ (place_m - foot_m))
        slopes.append([*normal, normal[1] * x_m - normal[0] * y_m])
        weights.append(1.0 / (1.0 + (expected_m[-1] / std) ** 2) / std**2)

    residuals_m, hessian, gradient = _equations(
        places_m, origin_m, std_m, distances_m, indices, known_m
    )
    slope, weight = np.array(slopes), np.array(weights)
    assert 20 < len(residuals_m) == len(expected_m)
    # A normal and its opposite are the same line.
    assert np.abs(residuals_m) == pytest.approx(np.abs(expected_m), rel=1e-9, abs=1e-12)
    assert hessian == pytest.approx(slope.T @ (weight[:, None] * slope), rel=1e-9, abs=1e-7)
    assert gradient == pytest.approx(slope.T @ (weight * expected_m), rel=1e-9, abs=1e-7)


# --- tables in a view -----------------------------------------------------------------------------

LENS = replace(pinhole(224, 126), forward_offset_m=0.0)
PITCH_RAD, HEIGHT_M = math.radians(-38), 1.5
Ids = NDArray[np.uint8]
START = OdometryPose(time_s=1.0, x_m=0.0, y_m=0.0, yaw_rad=0.0)
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
    drone: OdometryPose = START,
) -> View:
    """Return the view from a pose, with a table ahead of the drone."""
    frame = values.frame((36, 64), PITCH_RAD, HEIGHT_M, captured_s=drone.time_s)
    ids = drawn(table, board_m)
    class_map = ClassMap(ids=ids, classes=lab(legs_m), captured_s=drone.time_s)
    return View.of(class_map, frame, LENS, drone)


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
    pixels = project(np.array(points_m), LENS, PITCH_RAD)
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
        drone = replace(START, time_s=0.2 * step, x_m=0.06 * step)
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
