"""Where a flight begins."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from sim_bridge.twin.scene import BoxSpec, Helipad, Scene, TakeOffSpec
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.start import start_pose
from uav_bt.errors import ValueRangeError


def test_on_the_helipad_the_body_stands_on_its_top() -> None:
    """The hull's lower side at 0.4 m, its centre 5 cm above."""
    scene = load_scene("train-a")
    pose = start_pose(scene, 0)
    assert (pose.x_m, pose.y_m) == scene.helipad.position_m
    assert pose.z_m == pytest.approx(0.45)
    assert pose.yaw_rad == pytest.approx(math.radians(scene.take_off.yaw_deg))


def test_random_starts_are_on_free_carpet_and_follow_the_seed() -> None:
    """Away from boxes, pad and edge; the same seed gives the same place."""
    scene = replace(load_scene("train-a"), take_off=TakeOffSpec(random=True))
    places = [start_pose(scene, seed) for seed in range(30)]
    assert start_pose(scene, 7) == places[7]
    assert len({pose.x_m for pose in places}) == 30
    for pose in places:
        assert pose.z_m == pytest.approx(0.05)
        assert abs(pose.x_m) <= 2.0
        assert abs(pose.y_m) <= 1.5
        assert all(b.footprint.distance_m(pose.x_m, pose.y_m) >= 0.5 for b in scene.boxes)


def test_a_given_place_is_taken_as_it_is() -> None:
    """With its yaw, on the carpet."""
    spec = TakeOffSpec(position_m=(0.3, -0.4), yaw_deg=90.0)
    pose = start_pose(Scene(name="x", helipad=Helipad(position_m=(-1, 1)), take_off=spec), 0)
    assert (pose.x_m, pose.y_m, pose.z_m) == pytest.approx((0.3, -0.4, 0.05))
    assert pose.yaw_rad == pytest.approx(math.pi / 2)


def test_a_full_carpet_has_no_random_start() -> None:
    """The error names the scene and what to do."""
    boxes = tuple(
        BoxSpec(pattern=k + 1, position_m=(-1.8 + 1.2 * k, 0.0), size_m=(0.8, 3.6, 1.0))
        for k in (0, 1, 3)
    )
    pad = Helipad(position_m=(0.6, 0.0), size_m=(0.8, 3.6, 0.4))
    scene = Scene(name="full", helipad=pad, boxes=boxes, take_off=TakeOffSpec(random=True))
    with pytest.raises(ValueRangeError, match=r"'full'.*remove or move"):
        start_pose(scene, 0)
