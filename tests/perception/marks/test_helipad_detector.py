"""Helipad detection on drawn class maps, and its place on the twin's exact ids."""

from __future__ import annotations

import math

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from perception.marks.helipad_detector import (
    HelipadDetection,
    HelipadDetector,
    HelipadDetectorConfig,
    locate,
)
from sim_bridge.anafi import CAMERA_FORWARD_M, anafi_camera
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.objects import Helipad
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.views import render_views
from tests.paper_lab import BOXES, CARPET, HELIPAD_BOX, HELIPAD_H, paper_map
from uav_bt.types import CameraModel

WIDTH_PX, HEIGHT_PX = 224, 112
Ids = NDArray[np.uint8]


def bare_ground(width_px: int = WIDTH_PX, height_px: int = HEIGHT_PX) -> Ids:
    return np.full((height_px, width_px), CARPET, dtype=np.uint8)


def draw_pad(ids: Ids, column: int, row: int, size: int = 10) -> Ids:
    """Draw a pad seen from ahead: the H's panel on top, the striped side below it."""
    ids[row - size // 2 : row + size // 2, column - size : column + size] = HELIPAD_H
    ids[row + size // 2 : row + 2 * size, column - size : column + size] = HELIPAD_BOX
    return ids


def detect(ids: Ids, **config: float) -> HelipadDetection | None:
    detector = HelipadDetector(HelipadDetectorConfig(**config))
    return detector.detect(paper_map(ids=ids, captured_s=0.0))


# --- pairs ----------------------------------------------------------------------------------------


def test_finds_a_pad() -> None:
    """The centroid is the H's, the confidence high, the area counted."""
    found = detect(draw_pad(bare_ground(), 90, 50))

    assert found is not None
    assert (found.column_px, found.row_px) == pytest.approx((89.5, 49.5))
    assert found.h_area_px == 200
    assert found.score > 0.9
    assert not found.cut_by_edge


def test_sees_nothing_on_bare_ground() -> None:
    """No pixel of either class: nothing found."""
    assert detect(bare_ground()) is None


@pytest.mark.parametrize("alone", [HELIPAD_H, HELIPAD_BOX])
def test_one_half_of_the_pair_is_not_enough(alone: int) -> None:
    """A patch of one class without the other is a mistake of the mask."""
    ids = bare_ground()
    ids[40:60, 80:110] = alone

    assert detect(ids) is None


def test_halves_far_apart_do_not_pair() -> None:
    """An H and stripes at opposite ends of the view do not belong together."""
    ids = bare_ground()
    ids[45:55, 20:40] = HELIPAD_H
    ids[45:60, 180:200] = HELIPAD_BOX

    assert detect(ids) is None


def test_a_small_gap_is_forgiven() -> None:
    """Masks have ragged borders: a gap of a fraction of the H still pairs, with less confidence."""
    joined, apart = bare_ground(), bare_ground()
    for ids, gap in ((joined, 0), (apart, 4)):
        ids[40:56, 80:110] = HELIPAD_H
        ids[56 + gap : 76 + gap, 80:110] = HELIPAD_BOX

    near, far = detect(joined), detect(apart)

    assert near is not None
    assert far is not None
    assert 0.35 <= far.score < near.score


def test_the_pair_wins_over_larger_distractors() -> None:
    """Larger patches of either class, each without the other, are passed by."""
    ids = draw_pad(bare_ground(), 60, 50, size=6)
    ids[20:60, 150:200] = HELIPAD_H
    ids[90:110, 100:215] = HELIPAD_BOX

    found = detect(ids)

    assert found is not None
    assert (found.column_px, found.row_px) == pytest.approx((59.5, 49.5))


def test_the_compact_pair_wins_over_a_scatter() -> None:
    """Specks of H joined by a thread do not fill their hull; the compact pair scores higher."""
    ids = draw_pad(bare_ground(), 60, 50, size=6)
    cv2.line(ids, (150, 20), (200, 60), HELIPAD_H, 1)
    cv2.line(ids, (200, 20), (150, 60), HELIPAD_H, 1)
    ids[60:75, 150:200] = HELIPAD_BOX

    found = detect(ids)

    assert found is not None
    assert found.column_px < 70


def test_a_scatter_alone_is_refused() -> None:
    """Scattered pixels as in the previous test are not a pad, even without a better pair."""
    ids = bare_ground()
    cv2.line(ids, (150, 20), (200, 60), HELIPAD_H, 1)
    cv2.line(ids, (200, 20), (150, 60), HELIPAD_H, 1)
    ids[60:75, 150:200] = HELIPAD_BOX

    assert detect(ids) is None


def test_specks_are_too_small() -> None:
    """A few pixels of both classes are noise."""
    ids = bare_ground()
    ids[50:52, 100:103] = HELIPAD_H
    ids[52:54, 100:103] = HELIPAD_BOX

    assert detect(ids) is None


def test_an_occluded_pad_is_still_found() -> None:
    """A box in front hides half of the pad: the visible half is found, its centroid shifted."""
    ids = draw_pad(bare_ground(), 90, 50)
    ids[:, 92:] = BOXES[0]

    found = detect(ids)

    assert found is not None
    assert 80 <= found.column_px < 90


def test_looking_down_the_ring_of_the_box_pairs() -> None:
    """From above the box is a ring around the H."""
    ids = bare_ground()
    ids[30:80, 80:130] = HELIPAD_BOX
    ids[36:74, 86:124] = HELIPAD_H

    found = detect(ids)

    assert found is not None
    assert (found.column_px, found.row_px) == pytest.approx((104.5, 54.5))


@pytest.mark.parametrize(
    ("column", "row"),
    [(100, 3), (100, 109), (6, 50), (218, 50)],
    ids=["top", "bottom", "left", "right"],
)
def test_a_pad_cut_by_the_border_is_trusted_less(column: int, row: int) -> None:
    """Whichever border cuts the H, the detection says so and its score is halved."""
    ids = bare_ground()
    cv2.rectangle(ids, (column - 14, row - 9), (column + 14, row + 9), HELIPAD_BOX, cv2.FILLED)
    cv2.rectangle(ids, (column - 10, row - 5), (column + 10, row + 5), HELIPAD_H, cv2.FILLED)

    found = detect(ids)

    assert found is not None
    assert found.cut_by_edge
    assert 0.4 < found.score <= 0.5


@pytest.mark.parametrize("factor", [1, 2, 4])
def test_thresholds_follow_the_map_size(factor: int) -> None:
    """The same view at another size gives the same answer, in that size's pixels."""
    small = draw_pad(bare_ground(), 90, 50, size=3)
    large = np.kron(small, np.ones((factor, factor), dtype=np.uint8))

    reference, found = detect(small), detect(large)

    assert reference is not None
    assert found is not None
    assert (found.column_px + 0.5) / factor == pytest.approx(reference.column_px + 0.5)
    assert found.score == pytest.approx(reference.score, abs=0.1)


# --- place ----------------------------------------------------------------------------------------

CAMERA = CameraModel(width_px=201, height_px=101, fx_px=100.0, fy_px=100.0, cx_px=100.0, cy_px=50.0)


def _at(column_px: float, row_px: float) -> HelipadDetection:
    return HelipadDetection(
        column_px=column_px, row_px=row_px, score=1.0, h_area_px=100.0, cut_by_edge=False
    )


def test_place_is_from_the_bodys_centre() -> None:
    """The camera sits ahead of the centre: straight below it is that much ahead."""
    assert locate(_at(100.0, 50.0), CAMERA, -math.pi / 2, 1.1) == pytest.approx((0.15, 0.0))
    assert locate(_at(150.0, 50.0), CAMERA, -math.pi / 4, 1.0) == pytest.approx(
        (0.15 + 1.0, 0.5 * math.sqrt(2))
    )


@pytest.mark.parametrize(
    ("row_px", "height_m"), [(50.0, 1.0), (20.0, 1.0), (51.0, 1.0), (90.0, 0.0), (90.0, -0.3)]
)
def test_no_place_for_rays_that_miss_the_plane(row_px: float, height_m: float) -> None:
    """Level, rising and far too long rays, and a camera that is not above the pad."""
    assert locate(_at(100.0, row_px), CAMERA, 0.0, height_m) is None


# --- agreement with the twin ----------------------------------------------------------------------

SCENE = Scene(name="pad", helipad=Helipad(position_m=(0.0, 0.0), yaw_deg=20), boxes=())
YAW_RAD = 0.7  # of the camera, counter-clockwise; the pad's bearing is measured from it


def _pose(range_m: float, bearing_rad: float, pitch_deg: float, height_m: float) -> CameraPose:
    direction = YAW_RAD - bearing_rad
    return CameraPose(
        x_m=-range_m * math.cos(direction),
        y_m=-range_m * math.sin(direction),
        z_m=height_m,
        yaw_rad=YAW_RAD,
        pitch_rad=math.radians(pitch_deg),
    )


# Range and bearing from the camera, pitch, height.
AHEAD = [
    (range_m, bearing_rad, -28.0, 1.5)
    for range_m in (1.6, 2.5, 3.5, 4.5)
    for bearing_rad in (-0.4, 0.0, 0.4)
]
BELOW = [(0.0, 0.0, -90.0, 1.5), (0.12, 2.0, -90.0, 1.7), (0.25, -1.2, -90.0, 1.9)]
CUT = [(0.9, 0.0, -28.0, 1.5), (0.9, 0.4, -28.0, 1.5)]


@pytest.mark.parametrize("size_px", [(224, 112), (640, 360)])
def test_the_twins_pad_is_located(size_px: tuple[int, int]) -> None:
    """From exact ids: within 4 cm from 1.6 to 4.5 m, within 1 cm straight below."""
    camera = anafi_camera(640, 360).resized(*size_px)
    cases = AHEAD + BELOW
    poses = [_pose(*case) for case in cases]
    for case, view in zip(cases, render_views(SCENE, poses, truth_size_px=size_px), strict=True):
        range_m, bearing_rad, pitch_deg, height_m = case
        found = detect(view.ids)
        assert found is not None, case
        assert not found.cut_by_edge, case
        place = locate(found, camera, math.radians(pitch_deg), height_m - 0.4)
        assert place is not None, case
        truth = (
            range_m * math.cos(bearing_rad) + CAMERA_FORWARD_M,
            range_m * math.sin(bearing_rad),
        )
        assert math.dist(place, truth) < (0.04 if pitch_deg > -90.0 else 0.01), case
        assert found.score > 0.9, case


def test_the_twins_pad_leaving_view_is_trusted_less() -> None:
    """Where the lower border cuts the H its centroid is a decimetre off: the score says so."""
    camera = anafi_camera(640, 360).resized(WIDTH_PX, HEIGHT_PX)
    poses = [_pose(*case) for case in CUT]
    for case, view in zip(
        CUT, render_views(SCENE, poses, truth_size_px=(WIDTH_PX, HEIGHT_PX)), strict=True
    ):
        found = detect(view.ids)
        assert found is not None, case
        place = locate(found, camera, math.radians(case[2]), case[3] - 0.4)
        assert place is not None, case
        assert place[0] - (case[0] * math.cos(case[1]) + CAMERA_FORWARD_M) > 0.08, case
        assert found.cut_by_edge, case
        assert found.score <= 0.5, case
