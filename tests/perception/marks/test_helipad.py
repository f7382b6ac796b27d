"""The helipad: pairs of an H and its box in drawn class maps, and its place in the twin's."""

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from perception.marks.helipad import HelipadFinder, best_pair
from sim_bridge.anafi import CAMERA_FORWARD_M, anafi_camera
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.objects import Helipad
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.views import render_views
from tests.paper_lab import BOXES, CARPET, HELIPAD_BOX, HELIPAD_H, paper_map
from tests.perception.marks.mark_views import view_of_classes
from uav_bt.lab.shipped import default_mark
from uav_bt.landing_marks import MarkSighting
from uav_bt.types import LandingMark

SIZE_PX = (224, 112)
CAMERA = anafi_camera(640, 360)
PAD = Helipad(position_m=(0.0, 0.0), yaw_deg=20)
Ids = NDArray[np.uint8]


def painted(*patches: tuple[int, int, int, int, int], on: Ids | None = None) -> Ids:
    """Paint rectangles of (class, first row, end row, first column, end column) on bare ground."""
    ids = np.full(SIZE_PX[::-1], CARPET, dtype=np.uint8) if on is None else on.copy()
    for class_id, row, row_end, column, column_end in patches:
        ids[row:row_end, column:column_end] = class_id
    return ids


def drawn_pad(column: int, row: int, size: int = 10) -> Ids:
    """Draw a pad seen from ahead: the H's panel on top, the striped side below it."""
    middle, left, right = row + size // 2, column - size, column + size
    return painted(
        (HELIPAD_H, row - size // 2, middle, left, right),
        (HELIPAD_BOX, middle, row + 2 * size, left, right),
    )


def sighting(
    ids: Ids, pitch_deg: float, height_m: float, mark: LandingMark | None = None
) -> MarkSighting | None:
    """Return what one class map shows, the camera so high above the ground."""
    seen = view_of_classes(paper_map(ids), CAMERA, pitch_deg=pitch_deg, height_m=height_m)
    return HelipadFinder(mark or default_mark()).find(seen)


def in_the_twin(
    range_m: float, pitch_deg: float, height_m: float, bearing_rad: float = 0.0, pad: Helipad = PAD
) -> MarkSighting:
    """Return what the twin's exact ids show of a pad at a range and bearing from the lens."""
    away_rad, pitch_rad = 0.7 - bearing_rad, math.radians(pitch_deg)
    x_m, y_m = -range_m * math.cos(away_rad), -range_m * math.sin(away_rad)
    pose = CameraPose(x_m=x_m, y_m=y_m, z_m=height_m, yaw_rad=0.7, pitch_rad=pitch_rad)
    [view] = render_views(Scene(name="pad", helipad=pad), [pose], truth_size_px=SIZE_PX)
    found = sighting(view.ids, pitch_deg, height_m, pad.mark)
    assert found is not None
    return found


FAR_APART = painted((HELIPAD_H, 45, 55, 20, 40), (HELIPAD_BOX, 45, 60, 180, 200))
SPECKS = painted((HELIPAD_H, 50, 52, 100, 103), (HELIPAD_BOX, 52, 54, 100, 103))
# Lines of H, which do not fill their hull, and a box beside them
SCATTER = painted((HELIPAD_BOX, 60, 75, 150, 200))
cv2.line(SCATTER, (150, 20), (200, 60), HELIPAD_H, 1)
cv2.line(SCATTER, (200, 20), (150, 60), HELIPAD_H, 1)
H_ALONE, BOX_ALONE = (painted((each, 40, 60, 80, 110)) for each in (HELIPAD_H, HELIPAD_BOX))


@pytest.mark.parametrize("ids", [painted(), H_ALONE, BOX_ALONE, FAR_APART, SPECKS, SCATTER])
def test_what_is_no_pair_is_no_pad(ids: Ids) -> None:
    assert best_pair(paper_map(ids=ids)) is None


def test_a_small_gap_is_forgiven() -> None:
    """Masks have ragged borders: a gap of a fraction of the H still pairs, with a lower score."""
    joined, apart = (
        painted((HELIPAD_H, 40, 56, 80, 110), (HELIPAD_BOX, 56 + gap, 76 + gap, 80, 110))
        for gap in (0, 4)
    )
    assert 0.35 <= best_pair(paper_map(apart))[1] < best_pair(paper_map(joined))[1]
    region, score = best_pair(paper_map(ids=drawn_pad(90, 50)))
    assert (region.centroid, region.area_px) == (pytest.approx((89.5, 49.5)), 200)
    assert score > 0.9


SMALL = drawn_pad(60, 50, size=6)
# Larger patches of either class, each without the other
LARGE = painted((HELIPAD_H, 20, 60, 150, 200), (HELIPAD_BOX, 90, 110, 100, 215), on=SMALL)


def test_the_pair_wins_over_distractors_cut_in_half_or_from_above() -> None:
    for ids, column in (
        (LARGE, 59.5),
        (np.where(SMALL == CARPET, SCATTER, SMALL), 59.5),
        (painted((BOXES[0], 0, 112, 92, 224), on=drawn_pad(90, 50)), 85.5),  # half is occluded
        (painted((HELIPAD_BOX, 30, 80, 80, 130), (HELIPAD_H, 36, 74, 86, 124)), 104.5),  # a ring
        (drawn_pad(90, 50), 89.5),
    ):
        assert best_pair(paper_map(ids))[0].centroid[0] == pytest.approx(column)


@pytest.mark.parametrize(("column", "row"), [(100, 3), (100, 109), (6, 50), (218, 50)])
def test_a_pad_cut_by_any_border_is_trusted_half(column: int, row: int) -> None:
    ids = painted()
    cv2.rectangle(ids, (column - 14, row - 9), (column + 14, row + 9), HELIPAD_BOX, cv2.FILLED)
    cv2.rectangle(ids, (column - 10, row - 5), (column + 10, row + 5), HELIPAD_H, cv2.FILLED)
    assert 0.4 < best_pair(paper_map(ids))[1] <= 0.5


@pytest.mark.parametrize("factor", [2, 4])
def test_thresholds_follow_the_map_size(factor: int) -> None:
    """The same view at another size gives the same answer, in that size's pixels."""
    small = drawn_pad(90, 50, size=3)
    large = np.kron(small, np.ones((factor, factor), dtype=np.uint8))
    (reference, reference_score), (found, score) = (best_pair(paper_map(x)) for x in (small, large))
    assert (found.centroid[0] + 0.5) / factor == pytest.approx(reference.centroid[0] + 0.5)
    assert score == pytest.approx(reference_score, abs=0.1)


@pytest.mark.parametrize("pad_m", [0.0, 0.05, 0.2, 0.6])
@pytest.mark.parametrize(
    ("view", "within_m"),
    [
        *(((far_m, -28.0, 1.5, side), 0.04) for far_m in (2.0, 3.0, 4.5) for side in (-0.4, 0.4)),
        ((0.0, -90.0, 1.7, 0.0), 0.01),
        ((0.12, -90.0, 1.7, 0.0), 0.01),
        ((1.5, -42.0, 1.7, 0.0), 0.04),
    ],
)
def test_a_whole_pad_is_located_and_trusted(pad_m: float, view: tuple, within_m: float) -> None:
    """From exact ids, and from the body's centre: the lens sits ahead of it."""
    pad = replace(PAD, size_m=(0.5, 0.5, pad_m))
    fix, (range_m, *_, bearing_rad) = in_the_twin(*view, pad), view
    ahead_m, aside_m = range_m * math.cos(bearing_rad), range_m * math.sin(bearing_rad)
    place = (fix.forward_m - CAMERA_FORWARD_M, fix.right_m, fix.height_m)
    assert math.dist(place, (ahead_m, aside_m, pad_m)) < within_m
    assert fix.confidence > 0.8


def test_the_twins_pad_that_leaves_the_view_is_trusted_less() -> None:
    """Where the lower border cuts the H, its centroid is a decimetre off."""
    for bearing_rad in (0.0, 0.4):
        fix = in_the_twin(0.9, -28.0, 1.5, bearing_rad)
        assert fix.forward_m - (0.9 * math.cos(bearing_rad) + CAMERA_FORWARD_M) > 0.08
        assert fix.confidence <= 0.5
    for above_m in (0.05, 0.15):  # the camera looks past the pad's middle: its part is ahead
        fix = in_the_twin(-CAMERA_FORWARD_M, -42.0, default_mark().height_m + above_m)
        assert 0.1 < fix.range_m < 0.4
        assert fix.confidence < 0.1


# A mask shows an H and stripes of a hundredth of the area that a pad has there.
SPECK = painted((HELIPAD_H, 60, 65, 110, 117), (HELIPAD_BOX, 65, 75, 108, 120))
BELOW = drawn_pad(112, 60)


def test_rays_that_miss_the_pads_plane_and_specks_have_no_place() -> None:
    """Level, rising and far too long rays, and a camera that is not above the pad."""
    level = [(drawn_pad(112, row), 0.0, 1.5) for row in (56, 20, 60)]
    steep = [(BELOW, -42.0, 0.4), (BELOW, -42.0, 0.1), (SPECK, -42.0, 1.5)]
    for ids, pitch_deg, height_m in level + steep:
        assert best_pair(paper_map(ids=ids)) is not None
        assert sighting(ids, pitch_deg, height_m) is None


def test_of_a_larger_mark_the_same_h_is_a_smaller_part() -> None:
    """Twice as long and as wide, a whole H has four times the area."""
    ids = painted((HELIPAD_H, 50, 62, 99, 125), (HELIPAD_BOX, 62, 76, 99, 125))
    usual, large = (
        sighting(ids, -90.0, 1.4, replace(default_mark(), length_m=side_m, width_m=side_m))
        for side_m in (0.5, 1.0)
    )
    assert usual.confidence < 0.9
    assert large.confidence == pytest.approx(usual.confidence / 4.0)
