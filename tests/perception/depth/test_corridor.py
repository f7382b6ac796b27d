"""The corridor: brute-force intersection, known cases, and unknown depth."""

import math
from typing import Any

import numpy as np
import pytest

from perception.camera.ground_plane import CameraView, level_rays
from perception.depth.corridor import CorridorBuilder, CorridorConfig
from uav_bt.types import BodyVelocity, CameraModel, Corridor, DepthMap

# Wide, so that every plane is seen.
CAMERA = CameraModel(
    width_px=61, height_px=41, fx_px=30.0, fy_px=25.0, cx_px=30.0, cy_px=20.0, forward_offset_m=0.15
)
LEVEL = CameraView(camera=CAMERA, pitch_rad=0.0, height_m=1.5)
STRAY_PX = 4  # nearest pixels that are ignored


def depth_map(depth: np.ndarray, at_most: np.ndarray | None = None) -> DepthMap:
    bound = None if at_most is None else at_most.astype(np.float32)
    return DepthMap(depth=depth.astype(np.float32), metric=True, captured_s=1.0, at_most=bound)


FAR = np.full((41, 61), 8.0)


def with_patch(place: tuple[int, int], depth_m: float) -> tuple[np.ndarray, tuple[slice, slice]]:
    """Return far depth with a place and its neighbours nearer: more pixels than strays."""
    depth, (row, column) = FAR.copy(), place
    patch = slice(row - 1, row + 2), slice(column - 1, column + 2)
    depth[patch] = depth_m
    return depth, patch


def built(
    depth: np.ndarray, at_most: np.ndarray | None = None, forward_mps: float = 0.0, **given: Any
) -> Corridor:
    velocity = BodyVelocity(forward_mps=forward_mps)
    return CorridorBuilder().build(depth_map(depth, at_most), LEVEL, velocity=velocity, **given)


@pytest.mark.parametrize(
    ("pitch", "roll", "front_m"),
    [(0.0, 0.0, 2.0), (-0.5, 0.1, 0.4), (-1.5, 0.0, 2.0), (0.3, -0.2, 1)],
)
def test_a_pixel_before_the_nearest_plane_of_its_ray_is_inside(
    pitch: float, roll: float, front_m: float
) -> None:
    view = CameraView(camera=CAMERA, pitch_rad=pitch, height_m=1.0, roll_rad=roll)
    builder = CorridorBuilder(CorridorConfig(side_m=0.5, front_m=front_m, up_down_m=0.8))
    forward, right, down = level_rays(view)
    with np.errstate(divide="ignore"):
        depth_m = np.minimum(0.5 / np.abs(right), 0.8 / np.abs(down))
        depth_m = np.minimum(depth_m, np.where(forward > 0, (front_m - 0.15) / forward, math.inf))
    for share, inside in ((0.999, True), (1.001, False)):
        assert (builder.intruding(depth_map(share * depth_m), view) == inside).all()


@pytest.mark.parametrize(("depth_m", "free_m"), [(8.0, 8.15), (math.nan, math.inf)])
def test_a_free_way_or_unknown_background_has_nothing_in_it(depth_m: float, free_m: float) -> None:
    corridor = built(np.full((41, 61), depth_m))
    assert (corridor.captured_s, corridor.unknown_px) == (1.0, 0)
    assert (corridor.nearest_m, corridor.nearest_side) == (math.inf, None)
    assert corridor.free_distance_m == pytest.approx(free_m)
    assert corridor.time_to_impact_s == math.inf


def test_an_intrusion_belongs_to_the_plane_its_ray_would_cross() -> None:
    at = {"front": (20, 31), "right": (20, 50), "left": (20, 10), "up": (3, 30), "down": (37, 30)}
    for side, place in at.items():
        depth, patch = with_patch(place, 0.4)
        corridor = built(depth)
        points = 0.4 * level_rays(LEVEL)[:, *patch] + np.array([0.15, 0, 0])[:, None, None]
        ranges_m = np.sort(np.linalg.norm(points, axis=0), axis=None)
        assert corridor.nearest_side == side
        assert corridor.nearest_m == pytest.approx(ranges_m[STRAY_PX], rel=1e-5)
        assert corridor.free_distance_m == pytest.approx(0.55)


def test_time_to_impact_counts_from_the_nose_at_the_present_speed() -> None:
    depth, _ = with_patch((20, 30), 1.0)
    assert built(depth, forward_mps=0.5).time_to_impact_s == pytest.approx((1.15 - 0.12) / 0.5)
    assert built(depth, forward_mps=0.0).time_to_impact_s == math.inf
    assert built(depth, forward_mps=-0.5).time_to_impact_s == math.inf


def test_an_unknown_thing_that_must_be_inside_leaves_nothing_free() -> None:
    """Its base is below the view: at most 1.2 m away, how near nobody knows."""
    depth, things = FAR.copy(), np.zeros((41, 61), dtype=bool)
    depth[10:30, 28:34] = np.nan
    things[10:30, 28:34] = True
    corridor = built(depth, np.where(things, 1.2, np.inf), things=things)

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

    assert (builder.intruding(given, LEVEL, things=things) == inside).all()
    for found_m, which in (
        (corridor.nearest_m, inside),
        (corridor.nearest_left_m, inside & (points[1] < 0.0)),
        (corridor.nearest_right_m, inside & (points[1] >= 0.0)),
    ):
        assert found_m == pytest.approx(np.sort(ranges[which])[STRAY_PX], rel=1e-6)
    assert corridor.unknown_px == np.count_nonzero(lost)
    if things is None:  # otherwise unknown things leave nothing free
        x, y, z = depth * rays
        between = known & (np.abs(y) <= 0.5) & (np.abs(z) <= 0.8) & (x + 0.15 > 0.0)
        free_m = np.sort(x[between])[STRAY_PX] + 0.15
        assert corridor.free_distance_m == pytest.approx(free_m, rel=1e-6)
