"""The landing spot: a disc on one surface, never across the landing box's rim."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from behaviours.fly.land import MARGIN_M, EmergencyLand, nearest_landing_spot
from tests.paper_lab import BACKGROUND, BOXES, CARPET, HELIPAD_BOX, HELIPAD_H, paper_map
from tests.worlds import values
from tests.worlds.leaves import step
from uav_bt.lab.shipped import default_mark
from uav_bt.testing import LeafBench, pinhole
from uav_bt.testing.world import live
from uav_bt.types import LandingMark
from uav_bt.types.projection import ground_points

HEIGHT_M = 1.5
CAMERA_DOWN = pinhole(161, 91)
PX_PER_M = CAMERA_DOWN.fx_px / HEIGHT_M
ALL_GROUND = np.full((91, 161), CARPET, dtype=np.uint8)
TOP_M = 0.4  # of the landing box above the ground
HALF_M = 0.25  # of its side
PIXEL_M = 1.0 / PX_PER_M


def spot(
    ids: NDArray[np.uint8],
    radius_m: float = 0.25,
    mark_m: float = default_mark().height_m,
    height_m: float = HEIGHT_M,
) -> tuple[float, float] | None:
    seen, frame = paper_map(ids), values.frame((91, 161), -math.pi / 2, height_m)
    return nearest_landing_spot(seen, CAMERA_DOWN, frame, radius_m=radius_m, mark_m=mark_m)


@pytest.mark.parametrize(("radius_m", "fits"), [(0.1, True), (0.45, True), (0.55, False)])
def test_on_open_ground_the_spot_is_right_below(radius_m: float, *, fits: bool) -> None:
    """As near to the body's centre, behind the camera, as the view allows to know.

    The larger radii are shares of the view's height: a disc must fit into the view.
    """
    found = spot(ALL_GROUND, radius_m if radius_m < 0.4 else radius_m * 91 / PX_PER_M)
    assert (found is not None) == fits
    assert radius_m > 0.4 or found == pytest.approx((0.0, 0.0), abs=1.5 / PX_PER_M)


def test_the_spot_keeps_clear_of_a_box() -> None:
    ids = ALL_GROUND.copy()
    ids[:, :95] = BOXES[0]
    found = spot(ids)
    edge_m = (95 - 0.5 - CAMERA_DOWN.cx_px) / PX_PER_M
    assert found is not None
    assert found[1] == pytest.approx(edge_m + 0.25, abs=1.5 / PX_PER_M)


def view_of_box(
    forward_m: tuple[float, float],
    right_m: tuple[float, float],
    around: int = CARPET,
    top_m: float = TOP_M,
) -> NDArray[np.uint8]:
    """Return the class map of a box, from the body's centre: its top, and the sides in view."""
    pixels = np.stack(np.meshgrid(np.arange(161), np.arange(91)), axis=-1)
    ids = np.full((91, 161), around, dtype=np.uint8)
    for level_m in np.linspace(0.0, top_m, 60):
        places = ground_points(pixels, CAMERA_DOWN, -math.pi / 2, HEIGHT_M - level_m)
        ahead, right = places[..., 0] + CAMERA_DOWN.forward_offset_m, places[..., 1]
        inside = (forward_m[0] <= ahead) & (ahead <= forward_m[1])
        ids[inside & (right_m[0] <= right) & (right <= right_m[1])] = HELIPAD_BOX
    return ids


def rim_m(found: tuple[float, float], centre: tuple[float, float]) -> float:
    """Return the distance from a spot to the box's outline: negative on the box."""
    beyond = [abs(at - middle) - HALF_M for at, middle in zip(found, centre, strict=True)]
    outside = math.hypot(*(max(0.0, each) for each in beyond))
    return outside if outside > 0.0 else max(beyond)


@pytest.mark.parametrize("ahead_m", [-0.5, -0.25, 0.0, 0.2, 0.4, 0.7])
@pytest.mark.parametrize("right_m", [-0.6, -0.3, -0.15, 0.0, 0.1, 0.25, 0.5])
def test_a_disc_never_lies_across_the_rim(ahead_m: float, right_m: float) -> None:
    """From wherever the box is seen, the hull's 0.2 m lie whole on it or whole beside it."""
    box = [(at - HALF_M, at + HALF_M) for at in (ahead_m, right_m)]
    found = spot(view_of_box(box[0], box[1]), radius_m=0.2)
    assert found is not None
    assert abs(rim_m(found, (ahead_m, right_m))) >= 0.2 - 1.5 * PIXEL_M


@pytest.mark.parametrize("right_m", [-0.5, 0.0, 0.3, 0.6])
def test_the_side_of_the_box_is_no_place_to_land(right_m: float) -> None:
    """Only the box is free: the spot is on its top, though its side is seen before it.

    It does not hold a disc of 0.3 m radius, though box and side fill more pixels.
    """
    box = view_of_box((-0.1, 0.4), (right_m - HALF_M, right_m + HALF_M), around=BACKGROUND)
    found = spot(box, radius_m=0.15)
    assert found is not None
    assert rim_m(found, (0.15, right_m)) <= -0.15 + 1.5 * PIXEL_M
    assert spot(box, radius_m=0.3) is None


def test_from_below_the_top_only_the_ground_counts() -> None:
    assert spot(np.full_like(ALL_GROUND, HELIPAD_BOX), 0.05, TOP_M, height_m=0.4) is None


def test_the_height_of_the_mark_decides_how_large_its_top_is() -> None:
    """From 1.5 m the same pixels are 0.5 m across on a box of 0.4 m and 0.66 m on a mat."""
    ids = np.full((91, 161), BOXES[0], dtype=np.uint8)
    half_px = round(0.25 * CAMERA_DOWN.fx_px / (HEIGHT_M - TOP_M))
    rows, columns = (
        slice(round(each) - half_px, round(each) + half_px + 1)
        for each in (CAMERA_DOWN.cy_px, CAMERA_DOWN.cx_px)
    )
    ids[rows, columns] = HELIPAD_H
    wide_m = 0.25 * HEIGHT_M / (HEIGHT_M - TOP_M)
    assert spot(ids, 0.9 * wide_m, mark_m=0.05) is not None
    assert spot(ids, 0.9 * wide_m, mark_m=TOP_M) is None


def test_an_emergency_landing_takes_a_mat_for_what_it_is() -> None:
    """A mat of 0.05 m and 0.6 m a side, the only surface: its middle holds hull and margin."""
    bench = LeafBench(EmergencyLand)
    bench.camera = CAMERA_DOWN
    bench.provide(mark=LandingMark(length_m=0.6, width_m=0.6, height_m=0.05))
    mat = view_of_box((-0.1, 0.5), (0.3, 0.9), around=BACKGROUND, top_m=0.05)
    live(bench, ids=mat, gimbal_deg=-90.0)
    spot_m, hull_m = step(bench), bench.leaf.mission.airframe.radius_m + MARGIN_M
    assert 0.3 + hull_m - 0.03 <= spot_m.right_m <= 0.9 - hull_m + 0.03
    assert -0.1 + hull_m - 0.03 <= spot_m.forward_m <= 0.5 - hull_m + 0.03
