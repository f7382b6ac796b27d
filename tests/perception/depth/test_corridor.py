"""The corridor: brute-force intersection, known cases, and unknown depth."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from perception.camera.ground_plane import CameraView, level_rays
from perception.depth.corridor import CorridorBuilder, CorridorConfig
from uav_bt.types import BodyVelocity, CameraModel, Corridor, DepthMap
from uav_bt.types.projection import pixel_rays

# Wide, so that every plane is seen.
CAMERA = CameraModel(
    width_px=61, height_px=41, fx_px=30.0, fy_px=25.0, cx_px=30.0, cy_px=20.0, forward_offset_m=0.15
)
LEVEL = CameraView(camera=CAMERA, pitch_rad=0.0, height_m=1.5)
CENTRE = (20, 30)  # row and column of the optical axis
STRAY_PX = 4  # nearest pixels that are ignored


def depth_map(depth: np.ndarray, at_most: np.ndarray | None = None) -> DepthMap:
    bound = None if at_most is None else at_most.astype(np.float32)
    return DepthMap(depth=depth.astype(np.float32), metric=True, captured_s=1.0, at_most=bound)


def far() -> np.ndarray:
    return np.full((41, 61), 8.0)


def patch(place: tuple[int, int]) -> tuple[slice, slice]:
    """Return a place with its neighbours: more pixels than strays."""
    row, column = place
    return slice(row - 1, row + 2), slice(column - 1, column + 2)


def built(
    depth: np.ndarray,
    *,
    at_most: np.ndarray | None = None,
    things: np.ndarray | None = None,
    velocity: BodyVelocity | None = None,
    config: CorridorConfig | None = None,
) -> Corridor:
    return CorridorBuilder(config).build(
        depth_map(depth, at_most), LEVEL, things=things, velocity=velocity
    )


# --- planes ---------------------------------------------------------------------------------------


def brute_force(
    column: int, row: int, view: CameraView, config: CorridorConfig
) -> tuple[float, str | None]:
    """Walk through the planes as the paper writes them, point by point, for one pixel.

    The paper's axes: X up, Y lateral, Z forward. Here Y is to the right.
    """
    ray = pixel_rays((column, row), view.camera, view.pitch_rad, view.roll_rad)
    up, lateral, forward = -ray[2], ray[1], ray[0]
    c = np.array([0.0, 0.0, view.camera.forward_offset_m])
    p = c + 0.02 * np.array([up, lateral, forward])
    p_center = c + (p - c) * config.focal_factor
    planes = {
        "down": (0, -config.up_down_m),
        "up": (0, config.up_down_m),
        "left": (1, -config.side_m),
        "right": (1, config.side_m),
        "front": (2, config.front_m),
    }
    nearest, side = math.inf, None
    for name, (axis, place) in planes.items():
        step = p_center[axis] - c[axis]
        if abs(step) < 1e-12:  # parallel, or so nearly that the division overflows
            continue
        multiple = (place - c[axis]) / step
        if multiple <= 1.0:
            continue
        crossing = c + multiple * (p_center - c)
        distance = math.hypot(*(crossing - c))  # a nearly parallel plane is very far
        if distance < nearest:
            nearest, side = distance, name
    return nearest, side


@settings(deadline=None, max_examples=60)
@given(
    column=st.integers(1, 59),
    row=st.integers(1, 39),
    pitch=st.floats(-1.5, 0.3),
    roll=st.floats(-0.2, 0.2),
    walls=st.tuples(*[st.floats(0.3, 3.0)] * 3),
    focal=st.floats(0.8, 1.2),
)
def test_planes_agree_with_brute_force_intersection(
    *,
    column: int,
    row: int,
    pitch: float,
    roll: float,
    walls: tuple[float, ...],
    focal: float,
) -> None:
    """A pixel before its plane is inside, on that plane's side; one beyond it is outside."""
    side_m, front_m, up_down_m = walls
    config = CorridorConfig(side_m=side_m, front_m=front_m, up_down_m=up_down_m, focal_factor=focal)
    view = CameraView(camera=CAMERA, pitch_rad=pitch, height_m=1.0, roll_rad=roll)
    distance, side = brute_force(column, row, view, config)
    depth_m = min(
        distance / float(np.linalg.norm(pixel_rays((column, row), CAMERA, pitch, roll))), 1e3
    )
    builder, only = CorridorBuilder(config), np.zeros((41, 61), dtype=bool)
    only[row, column] = True
    for share, inside in ((0.99, True), (1.01, side is None or distance > 1e3)):
        given = depth_map(np.full((41, 61), share * depth_m))
        assert builder.intruding(given, view, things=only)[row, column] == inside


def test_planes_are_made_once_for_each_camera_and_attitude() -> None:
    builder = CorridorBuilder()
    first = builder._planes(LEVEL)
    builder.build(depth_map(far()), CameraView(camera=CAMERA, pitch_rad=0.0, height_m=0.0))
    assert builder._planes(LEVEL) is first
    small = CameraView(camera=CAMERA.resized(30, 20), pitch_rad=0.0, height_m=1.5)
    assert builder._planes(small)[1].shape == (20, 30)


# --- inside the corridor --------------------------------------------------------------------------


def test_a_free_way_has_nothing_in_it() -> None:
    corridor = built(far())

    assert corridor.captured_s == 1.0
    assert corridor.nearest_m == math.inf
    assert corridor.nearest_side is None
    assert corridor.free_distance_m == pytest.approx(8.15)
    assert corridor.time_to_impact_s == math.inf
    assert corridor.unknown_px == 0


@pytest.mark.parametrize(
    ("place", "side"),
    [
        ((20, 31), "front"),
        ((20, 50), "right"),
        ((20, 10), "left"),
        ((3, 30), "up"),
        ((37, 30), "down"),
    ],
)
def test_an_intrusion_belongs_to_the_plane_its_ray_would_cross(
    place: tuple[int, int], side: str
) -> None:
    depth = far()
    depth[patch(place)] = 0.4
    corridor = built(depth)
    points = 0.4 * level_rays(LEVEL)[:, *patch(place)] + np.array([0.15, 0, 0])[:, None, None]
    ranges_m = np.sort(np.linalg.norm(points, axis=0), axis=None)

    assert corridor.nearest_side == side
    assert corridor.nearest_m == pytest.approx(ranges_m[STRAY_PX], rel=1e-5)


def test_the_free_distance_ends_at_what_is_between_the_walls_and_not_beside_them() -> None:
    depth = far()
    depth[:, 45:] = 1.5  # 0.75 m and more to the right
    assert built(depth).free_distance_m > 5.0
    depth[:, 32:45] = 1.5
    assert built(depth).free_distance_m == pytest.approx(1.65)


def test_time_to_impact_counts_from_the_nose_at_the_present_speed() -> None:
    depth = far()
    depth[patch(CENTRE)] = 1.0
    moving = built(depth, velocity=BodyVelocity(forward_mps=0.5))

    assert moving.time_to_impact_s == pytest.approx((1.15 - 0.12) / 0.5)
    assert built(depth, velocity=BodyVelocity(forward_mps=0.0)).time_to_impact_s == math.inf
    assert built(depth, velocity=BodyVelocity(forward_mps=-0.5)).time_to_impact_s == math.inf
    assert built(far(), velocity=BodyVelocity(forward_mps=0.5)).time_to_impact_s > 15.0


def test_a_few_stray_pixels_are_not_believed() -> None:
    depth = far()
    depth[20, 28 : 28 + STRAY_PX] = 0.3
    assert built(depth).nearest_side is None
    depth[21, 28] = 0.3
    assert built(depth).nearest_side == "front"


# --- unknown depth --------------------------------------------------------------------------------


def test_unknown_background_is_no_obstacle() -> None:
    corridor = built(np.full((41, 61), np.nan))

    assert corridor.nearest_side is None
    assert corridor.free_distance_m == math.inf
    assert corridor.unknown_px == 0


def test_an_unknown_thing_that_must_be_inside_leaves_nothing_free() -> None:
    """Its base is below the view: at most 1.2 m away, how near nobody knows."""
    depth, things = far(), np.zeros((41, 61), dtype=bool)
    depth[10:30, 28:34] = np.nan
    things[10:30, 28:34] = True
    at_most = np.full((41, 61), np.inf)
    at_most[things] = 1.2
    corridor = built(depth, at_most=at_most, things=things)

    assert corridor.free_distance_m == 0.0
    assert corridor.nearest_m <= 1.5
    assert corridor.nearest_side == "front"
    assert corridor.unknown_px == 120


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("all_count", [False, True])
def test_a_corridor_is_what_its_pixels_say(seed: int, *, all_count: bool) -> None:
    rng = np.random.default_rng(seed)
    depth = rng.uniform(0.2, 6.0, (41, 61)).astype(np.float32)
    depth[rng.random((41, 61)) < 0.2] = np.nan
    at_most = rng.uniform(0.2, 6.0, (41, 61)).astype(np.float32)
    things = None if all_count else rng.random((41, 61)) < 0.5
    builder = CorridorBuilder()
    given = depth_map(depth, at_most)
    corridor = builder.build(given, LEVEL, things=things)

    rays, exits_m, _ = builder._planes(CameraView(camera=CAMERA, pitch_rad=0.0, height_m=0.0))
    counts = np.ones((41, 61), dtype=bool) if things is None else things
    known, bound = np.isfinite(depth) & counts, np.fmin(depth, at_most)
    lost = np.zeros_like(known) if things is None else ~np.isfinite(depth) & counts
    with np.errstate(invalid="ignore"):
        inside = (known & (depth < exits_m)) | (lost & (bound < exits_m))
    points = bound * rays + np.array([0.15, 0.0, 0.0], dtype=np.float32)[:, None, None]
    ranges = np.sqrt((points**2).sum(axis=0))

    def nearest(which: np.ndarray) -> float:
        return float(np.sort(ranges[which])[STRAY_PX])

    assert (builder.intruding(given, LEVEL, things=things) == inside).all()
    assert corridor.nearest_m == pytest.approx(nearest(inside), rel=1e-6)
    left, right = inside & (points[1] < 0.0), inside & (points[1] >= 0.0)
    assert corridor.nearest_left_m == pytest.approx(nearest(left), rel=1e-6)
    assert corridor.nearest_right_m == pytest.approx(nearest(right), rel=1e-6)
    assert corridor.unknown_px == np.count_nonzero(lost)
    if things is None:  # otherwise unknown things leave nothing free
        x, y, z = depth * rays
        between = known & (np.abs(y) <= 0.5) & (np.abs(z) <= 0.8) & (x + 0.15 > 0.0)
        free_m = np.sort(x[between])[STRAY_PX] + 0.15
        assert corridor.free_distance_m == pytest.approx(free_m, rel=1e-6)
