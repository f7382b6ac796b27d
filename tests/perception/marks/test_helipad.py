"""Fixes from class maps: accepted detections of the helipad, and their confidence."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from perception.marks.helipad import HelipadFinder
from sim_bridge.anafi import CAMERA_FORWARD_M, anafi_camera
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.objects import Helipad
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.views import render_views
from tests.paper_lab import CARPET, HELIPAD_BOX, HELIPAD_H, paper_map
from tests.perception.marks.class_views import view_of_classes
from uav_bt.errors import InputError
from uav_bt.lab.shipped import default_mark
from uav_bt.landing_marks import MarkSighting
from uav_bt.types import LandingMark

SIZE_PX = (224, 112)
CAMERA = anafi_camera(640, 360)
SCENE = Scene(name="pad", helipad=Helipad(position_m=(0.0, 0.0), yaw_deg=20), boxes=())


def found(
    ids: np.ndarray, pitch_deg: float, height_m: float, mark: LandingMark | None = None
) -> MarkSighting | None:
    """Return what one class map shows, the camera so high above the ground."""
    seen = view_of_classes(paper_map(ids), CAMERA, pitch_deg=pitch_deg, height_m=height_m)
    return HelipadFinder(mark or default_mark()).find(seen)


def view(range_m: float, pitch_deg: float, height_m: float) -> MarkSighting | None:
    """Return the fix of the twin's pad at a distance ahead of the camera."""
    pose = CameraPose(
        x_m=-range_m, y_m=0.0, z_m=height_m, yaw_rad=0.0, pitch_rad=math.radians(pitch_deg)
    )
    [drawn] = render_views(SCENE, [pose], truth_size_px=SIZE_PX)
    return found(drawn.ids, pitch_deg, height_m)


@pytest.mark.parametrize(
    ("range_m", "pitch_deg"), [(1.2, -42.0), (2.5, -42.0), (3.5, -28.0), (4.5, -28.0), (0.0, -90.0)]
)
def test_a_whole_h_is_trusted(range_m: float, pitch_deg: float) -> None:
    fix = view(range_m, pitch_deg, 1.5)

    assert fix is not None
    assert fix.forward_m == pytest.approx(range_m + CAMERA_FORWARD_M, abs=0.04)
    assert fix.confidence > 0.8


@pytest.mark.parametrize("above_m", [0.05, 0.15])
def test_from_just_above_the_pad_it_is_near_but_hardly_trusted(above_m: float) -> None:
    """The camera looks past the pad's middle: the visible part is ahead of it."""
    fix = view(-CAMERA_FORWARD_M, -42.0, default_mark().height_m + above_m)

    assert fix is not None
    assert 0.1 < fix.range_m < 0.4
    assert fix.confidence < 0.1


def test_a_speck_on_a_box_close_by_is_no_pad() -> None:
    """A mask shows an H and stripes of a hundredth of the area that a pad has there."""
    ids = np.full(SIZE_PX[::-1], CARPET, dtype=np.uint8)
    ids[60:65, 110:117] = HELIPAD_H
    ids[65:75, 108:120] = HELIPAD_BOX

    assert found(ids, -42.0, 1.5) is None


def test_of_a_larger_mark_the_same_h_is_a_smaller_part() -> None:
    """Twice as long and as wide, a whole H has four times the area."""
    ids = np.full(SIZE_PX[::-1], CARPET, dtype=np.uint8)
    ids[50:62, 99:125] = HELIPAD_H
    ids[62:76, 99:125] = HELIPAD_BOX
    usual, large = (
        found(ids, -90.0, 0.4 + 1.0, replace(default_mark(), length_m=side_m, width_m=side_m))
        for side_m in (0.5, 1.0)
    )
    assert usual is not None
    assert large is not None
    assert usual.confidence < 0.9
    assert large.confidence == pytest.approx(usual.confidence / 4.0)


@pytest.mark.parametrize("height_m", [0.0, 0.05, 0.2, 0.6])
@pytest.mark.parametrize(("range_m", "pitch_deg"), [(0.0, -90.0), (1.5, -42.0), (3.0, -28.0)])
def test_the_distance_is_right_for_pads_and_mats(
    height_m: float, range_m: float, pitch_deg: float
) -> None:
    pad = Helipad(position_m=(0.0, 0.0), yaw_deg=20, size_m=(0.5, 0.5, height_m))
    pose = CameraPose(
        x_m=-range_m, y_m=0.0, z_m=1.5, yaw_rad=0.0, pitch_rad=math.radians(pitch_deg)
    )
    [drawn] = render_views(Scene(name="pad", helipad=pad), [pose], truth_size_px=SIZE_PX)
    seen = found(drawn.ids, pitch_deg, 1.5, pad.mark)

    assert seen is not None
    assert seen.forward_m == pytest.approx(range_m + CAMERA_FORWARD_M, abs=0.04)
    assert seen.height_m == height_m


def test_the_helipad_takes_no_options() -> None:
    with pytest.raises(InputError, match="landing mark 'helipad' has no option 'id'"):
        HelipadFinder(replace(default_mark(), options={"id": 7}))
