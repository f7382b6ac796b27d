"""Sightings of tags in the world without images."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_bridge.anafi import CAMERA_FORWARD_M
from sim_bridge.plain.caster import Caster
from sim_bridge.plain.mark_sight import MarkErrors, is_covered, see_mark
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.objects import Helipad, ObjectSpec
from sim_bridge.twin.scene import Scene
from uav_bt.landing_marks import MarkSighting

TAG = Helipad(
    position_m=(1.0, 0.5),
    yaw_deg=20.0,
    size_m=(0.5, 0.5, 0.2),
    kind="apriltag",
    options={"id": 7, "size_m": 0.3},
)


def lens(x_m: float, y_m: float, yaw_deg: float, pitch_deg: float) -> CameraPose:
    yaw_rad, pitch_rad = math.radians(yaw_deg), math.radians(pitch_deg)
    return CameraPose(x_m=x_m, y_m=y_m, z_m=1.5, yaw_rad=yaw_rad, pitch_rad=pitch_rad)


def seen(camera: CameraPose, seed: int = 0, **errors: float) -> MarkSighting | None:
    return see_mark(TAG, camera, MarkErrors(**errors), np.random.default_rng(seed))


def test_the_same_fix_as_from_an_image() -> None:
    """Two metres to the west, looking east: ahead; the upper edge is 110 degrees to the left."""
    found = seen(lens(-1.0, 0.7, 0.0, -30.0))

    assert found is not None
    assert found.forward_m - CAMERA_FORWARD_M == pytest.approx(2.0, abs=0.1)
    assert found.right_m == pytest.approx(0.2, abs=0.02)
    assert found.height_m == 0.2
    assert found.heading_deg == pytest.approx(110.0, abs=4.0)


def test_errors_have_the_stated_size() -> None:
    headings = [seen(lens(-1.0, 0.5, 0.0, -30.0), seed, heading_deg=2.0) for seed in range(300)]
    found = [each.heading_deg for each in headings if each is not None]

    assert len(found) == 300
    assert np.std(np.array(found, dtype=np.float64)) == pytest.approx(2.0, rel=0.15)


@pytest.mark.parametrize(
    "camera",
    [lens(-1.0, 0.5, 180.0, -30.0), lens(-1.0, 0.5, 0.0, 0.0), lens(-9.0, 0.5, 0.0, -5.0)],
    ids=["behind", "above the view", "too small"],
)
def test_out_of_view_or_too_small_it_is_not_seen(camera: CameraPose) -> None:
    assert seen(camera) is None


def test_a_box_in_between_covers_it() -> None:
    box = ObjectSpec(kind="box-1", position_m=(0.0, 0.5), size_m=(0.3, 0.4, 1.4))
    camera = lens(-1.0, 0.5, 0.0, -30.0)
    covered = []
    for boxes in ((), (box,)):
        caster = Caster(Scene(name="mark", helipad=TAG, objects=boxes), (112, 56))
        _, depth_m = caster.cast(camera)
        covered.append(is_covered(TAG, camera, depth_m, caster.camera))

    assert covered == [False, True]
