"""Images without a flight: poses as in flight, reproducible images, exact truth."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sim_bridge.anafi import CAMERA_FORWARD_M
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene import TakeOffSpec
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.views import render_views, sample_flight_poses
from tests.sim_bridge.twin.room_world import body_in

SIZE = (160, 90)
SCENE = load_scene("test-a")
LAB = Profile.named("lab")


@pytest.mark.parametrize("name", ["test-a", "depot-val-a"])
def test_sampled_poses_are_where_a_drone_could_be(name: str) -> None:
    """Poses are above the ground, clear of boxes, at flight height, with pitches as in flight."""
    scene = load_scene(name)
    poses, body = sample_flight_poses(scene, np.random.default_rng(0), 210), body_in(scene)
    for pose in poses:
        x_m, y_m = pose.to_world(-CAMERA_FORWARD_M, 0.0)
        body.place(x_m, y_m, pose.z_m, pose.yaw_rad)
        assert body.contacts() == ()
        assert body.clearance_m() > 0.1
        assert scene.ground.contains(x_m, y_m)
        assert 0.6 < pose.z_m < 2.1
    ahead = [pose for pose in poses if pose.pitch_rad > math.radians(-32.0)]
    assert len(ahead) == 180
    assert np.median([pose.z_m for pose in ahead]) == pytest.approx(1.5, abs=0.03)
    assert sum(pose.pitch_rad < math.radians(-54.0) for pose in poses) == 30
    bare = replace(scene, helipad=None, take_off=TakeOffSpec(random=True))
    flat = sample_flight_poses(bare, np.random.default_rng(0), 14)
    assert all(pose.pitch_rad > -0.9 for pose in flat), "no pose looks down at a mark"


def test_a_share_of_the_cameras_is_lowered_and_nothing_else_changes() -> None:
    usual, drawn = (
        sample_flight_poses(SCENE, np.random.default_rng(0), 210, lowered=share)
        for share in (0.0, 0.5)
    )
    assert [replace(pose, pitch_rad=0.0) for pose in drawn] == [
        replace(pose, pitch_rad=0.0) for pose in usual
    ]
    lowered = [index for index in range(210) if drawn[index] != usual[index]]
    assert 70 < len(lowered) < 110
    assert all(index % 7 != 6 for index in lowered), "views of the landing are as they were"
    assert all(-60.0 <= math.degrees(drawn[index].pitch_rad) <= -31.0 for index in lowered)


def test_views_repeat_and_vary_with_the_seed() -> None:
    """The same seed gives the same bytes; it sets light and noise, but not the truth."""
    poses = sample_flight_poses(SCENE, np.random.default_rng(1), 3)
    first, again, other = (
        list(render_views(SCENE, poses, size_px=SIZE, profile=LAB, vary_light=True, seed=seed))
        for seed in (3, 3, 4)
    )
    for one, same, changed in zip(first, again, other, strict=True):
        assert np.array_equal(one.image, same.image)
        assert not np.array_equal(one.image, changed.image)
        assert np.array_equal(one.ids, changed.ids)
        assert np.array_equal(one.depth, changed.depth)


def test_clean_views_have_no_noise_and_truth_of_its_own_size() -> None:
    """Without a profile the image is clean; ids and depth have the requested size."""
    poses = sample_flight_poses(SCENE, np.random.default_rng(2), 1)
    (clean,) = render_views(SCENE, poses, size_px=SIZE, truth_size_px=(112, 56))
    (noisy,) = render_views(SCENE, poses, size_px=SIZE, profile=Profile.named("harsh"))
    assert (clean.image.shape, clean.pose) == ((90, 160, 3), poses[0])
    assert clean.ids.shape == clean.depth.shape == (56, 112)
    assert 3.0 < np.abs(noisy.image.astype(float) - clean.image).mean() < 25.0
