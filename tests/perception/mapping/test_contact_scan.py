"""Sampling of a class map along bearings, and runs of a role on a bearing."""

import math
from dataclasses import replace

import numpy as np
import pytest

from perception.mapping.contact_scan import GroundScan, find_bases, scan_ground
from perception.mapping.ground_grid import GroundGrid
from perception.mapping.view import View
from tests.paper_lab import BOXES, CARPET, CLASS_COUNT, CLASSES, ROOFS, paper_map
from tests.worlds import values
from uav_bt.lab.classes import NO_ROLE
from uav_bt.testing import pinhole
from uav_bt.types import CameraModel, ClassMap, Frame, Pose2D
from uav_bt.types.projection import project

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
    bases = find_bases(GroundScan(along(6, 1), ids, ids, ids, CLASSES.top_of, 1.5, min_run=2))
    found = {**vars(bases), "placed": bases.placed.xy_m}
    for each in ("placed", "hidden_m", "edges_m", "hidden_edges_m"):
        assert found[each][:, 0].tolist() == [at_m] * (each == kind)


def test_a_side_is_as_high_as_the_border_to_its_roof() -> None:
    """The camera is 1.5 m high; the side begins at 1.5 m, its roof covers the ground at 4.5 m."""
    side, roof, other = BOXES[0], ROOFS[0], ROOFS[1]
    tops = [
        [side, roof, roof],
        [side, side, roof],  # a single sample of roof is noise
        [side, other, other],  # the roof of another box
        [side, side, side],  # the edge is above the image
    ]
    ids = np.array([[CARPET, CARPET, side, side, *top] for top in tops], dtype=np.uint8)
    roles = CLASSES.roles(ids)
    bases = find_bases(GroundScan(along(7), ids, roles, roles, CLASSES.top_of, 1.5, min_run=2))
    assert bases.placed.xy_m[:, 0].tolist() == [1.5] * 4
    edge_m = 1.5 * (1.0 - 1.5 * (1 / 4 + 1 / 5) / 2)
    assert bases.placed.heights_m[0] == pytest.approx(edge_m)
    assert np.isnan(bases.placed.heights_m[1:]).all()


@pytest.mark.parametrize(("height_m", "last"), [(1.4, 4), (1.2, 3), (2.0, 2)])
def test_an_obstacle_is_tall_up_to_a_height_or_to_the_drone(height_m: float, last: int) -> None:
    """From 1.5 m on it covers up to 0.9 m of height, or up to 0.5 m below the camera."""
    roles = np.array([[1, 1] + [3] * (end - 1) + [1] * (9 - end) for end in range(2, 10)], np.uint8)
    scan = GroundScan(along(10, 8), roles, roles, roles, CLASSES.top_of, height_m, min_run=1)
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
