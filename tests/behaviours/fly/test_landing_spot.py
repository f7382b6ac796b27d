"""Where an emergency landing may end: a disc on one surface, never across the landing box's rim."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from behaviours.fly.land import nearest_landing_spot
from tests.paper_lab import BACKGROUND, BOXES, CARPET, HELIPAD_BOX, HELIPAD_H, paper_map
from tests.worlds import values
from uav_bt.lab.shipped import default_mark
from uav_bt.testing import pinhole
from uav_bt.types import Frame
from uav_bt.types.projection import ground_points

HEIGHT_M = 1.5
CAMERA_DOWN = pinhole(161, 91)
PX_PER_M = CAMERA_DOWN.fx_px / HEIGHT_M


def from_above() -> Frame:
    return values.frame((91, 161), -math.pi / 2, HEIGHT_M)


def spot(
    ids: NDArray[np.uint8], radius_m: float = 0.25, mark_m: float = default_mark().height_m
) -> tuple[float, float] | None:
    view = paper_map(ids=ids, captured_s=0.0)
    return nearest_landing_spot(view, CAMERA_DOWN, from_above(), radius_m=radius_m, mark_m=mark_m)


def all_ground() -> NDArray[np.uint8]:
    return np.full((91, 161), CARPET, dtype=np.uint8)


def test_on_open_ground_the_spot_is_right_below() -> None:
    """As near to the body's centre, behind the camera, as the view allows to know."""
    found = spot(all_ground(), radius_m=0.1)

    assert found == pytest.approx((0.0, 0.0), abs=1.5 / PX_PER_M)


def test_the_spot_keeps_clear_of_a_box() -> None:
    """Half of the view is a roof: the spot is on the other side, a radius away from it."""
    ids = all_ground()
    ids[:, :95] = BOXES[0]

    found = spot(ids)

    edge_m = (95 - 0.5 - CAMERA_DOWN.cx_px) / PX_PER_M
    assert found is not None
    assert found[1] == pytest.approx(edge_m + 0.25, abs=1.5 / PX_PER_M)


def test_unknown_ground_beyond_the_view_does_not_count() -> None:
    """A disc that does not fit into the view is not taken."""
    assert spot(all_ground(), radius_m=0.45 * 91 / PX_PER_M) is not None
    assert spot(all_ground(), radius_m=0.55 * 91 / PX_PER_M) is None


# --- beside and on the landing box ----------------------------------------------------------------

TOP_M = 0.4  # of the landing box above the ground
HALF_M = 0.25  # of its side
PIXEL_M = 1.0 / PX_PER_M
LENS_M = CAMERA_DOWN.forward_offset_m


def view_of_box(
    forward_m: tuple[float, float],
    right_m: tuple[float, float],
    around: int = CARPET,
    top_m: float = TOP_M,
) -> NDArray[np.uint8]:
    """Return the class map of a box as the camera sees it: its top, and the sides that face it.

    Args:
        forward_m: where it begins and ends, from the body's centre.
        right_m: the same to the right.
        around: class of everything else.
        top_m: height of the top above the ground.
    """
    pixels = np.stack(np.meshgrid(np.arange(161), np.arange(91)), axis=-1)
    ids = np.full((91, 161), around, dtype=np.uint8)
    for level_m in np.linspace(0.0, top_m, 60):
        ahead, right = np.moveaxis(
            ground_points(pixels, CAMERA_DOWN, -math.pi / 2, HEIGHT_M - level_m), -1, 0
        )
        ahead = ahead + LENS_M
        inside = (forward_m[0] <= ahead) & (ahead <= forward_m[1])
        ids[inside & (right_m[0] <= right) & (right <= right_m[1])] = HELIPAD_BOX
    return ids


def rim_m(found: tuple[float, float], centre: tuple[float, float]) -> float:
    """Return the distance from a spot to the box's outline: negative on the box."""
    beyond = [abs(at - middle) - HALF_M for at, middle in zip(found, centre, strict=True)]
    outside = math.hypot(*(max(0.0, each) for each in beyond))
    return outside if outside > 0.0 else max(beyond)


def test_over_the_rim_of_the_box_it_lands_beside_it() -> None:
    """The box begins 5 cm right of the body: the disc of 0.25 m ends there, 0.2 m to the left."""
    found = spot(view_of_box((-3.0, 3.0), (0.05, 3.0)))

    assert found is not None
    assert found[1] == pytest.approx(0.05 - 0.25, abs=1.5 * PIXEL_M)


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
    """Only the box is free: the spot is on its top, though its side is seen before it."""
    box = view_of_box((-0.1, 0.4), (right_m - HALF_M, right_m + HALF_M), around=BACKGROUND)
    found = spot(box, radius_m=0.15)

    assert found is not None
    assert rim_m(found, (0.15, right_m)) <= -0.15 + 1.5 * PIXEL_M


def test_a_box_that_is_too_small_for_the_disc_holds_nothing() -> None:
    """Half a metre does not hold a disc of 0.3 m radius, though box and side fill more pixels."""
    assert spot(view_of_box((-0.1, 0.4), (0.1, 0.6), around=BACKGROUND), radius_m=0.3) is None


def test_from_below_the_top_only_the_ground_counts() -> None:
    """A drone beside the box, lower than its top, cannot land on it."""
    low = values.frame((91, 161), -math.pi / 2, 0.4)
    ids = np.full((91, 161), HELIPAD_BOX, dtype=np.uint8)
    view = paper_map(ids=ids, captured_s=0.0)

    assert nearest_landing_spot(view, CAMERA_DOWN, low, radius_m=0.05, mark_m=0.4) is None


def test_the_height_of_the_mark_decides_how_large_its_top_is() -> None:
    """From 1.5 m the same pixels are 0.5 m across on a box of 0.4 m and 0.66 m on a mat."""
    ids = np.full((91, 161), BOXES[0], dtype=np.uint8)
    half_px = round(0.25 * CAMERA_DOWN.fx_px / (HEIGHT_M - 0.4))
    middle = round(CAMERA_DOWN.cx_px)
    row = round(CAMERA_DOWN.cy_px)
    ids[row - half_px : row + half_px + 1, middle - half_px : middle + half_px + 1] = HELIPAD_H
    wide_m = 0.25 * HEIGHT_M / (HEIGHT_M - 0.4)

    assert spot(ids, radius_m=0.9 * wide_m, mark_m=0.05) is not None
    assert spot(ids, radius_m=0.9 * wide_m, mark_m=0.4) is None
