"""Images without a flight: poses as in flight, reproducible images, exact truth."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.views import render_views, sample_flight_poses

SIZE = (160, 90)
SCENE = load_scene("test-a")


def test_sampled_poses_are_where_a_drone_could_be() -> None:
    """Poses are above the ground, clear of boxes, at flight height, with pitches as in flight."""
    poses = sample_flight_poses(SCENE, np.random.default_rng(0), 210)
    for pose in poses:
        x = pose.x_m - 0.15 * math.cos(pose.yaw_rad)
        y = pose.y_m - 0.15 * math.sin(pose.yaw_rad)
        assert (abs(x) <= 2.5, abs(y) <= 2.0, 0.6 < pose.z_m < 2.1) == (True, True, True)
        for item in SCENE.placed:
            high = pose.z_m > item.standing.height_m + 0.3
            assert high or item.footprint.distance_m(x, y) > 0.3
    ahead = [pose for pose in poses if pose.pitch_rad > math.radians(-32.0)]
    assert len(ahead) == 180
    assert np.median([pose.z_m for pose in ahead]) == pytest.approx(1.5, abs=0.03)
    assert sum(pose.pitch_rad < math.radians(-54.0) for pose in poses) == 30
    bare = replace(SCENE, helipad=None, take_off=replace(SCENE.take_off, random=True))
    flat = sample_flight_poses(bare, np.random.default_rng(0), 14)
    assert all(pose.pitch_rad > -0.9 for pose in flat), "no pose looks down at a mark"


def test_a_share_of_the_cameras_is_lowered_and_nothing_else_changes() -> None:
    ahead = sample_flight_poses(SCENE, np.random.default_rng(0), 210)
    drawn = sample_flight_poses(SCENE, np.random.default_rng(0), 210, lowered=0.5)
    lowered = 0
    for index, (usual, pose) in enumerate(zip(ahead, drawn, strict=True)):
        assert replace(pose, pitch_rad=usual.pitch_rad) == usual
        if pose != usual:
            assert index % 7 != 6, "a view of the landing"
            assert math.radians(-60.0) <= pose.pitch_rad <= math.radians(-31.0)
            lowered += 1
    assert 70 < lowered < 110


def test_views_repeat_and_vary_with_the_seed() -> None:
    """The same seed gives the same bytes; it sets light and noise, but not the truth."""
    poses = sample_flight_poses(SCENE, np.random.default_rng(1), 3)
    lab = Profile.named("lab")

    def views(seed: int) -> list[tuple[bytes, bytes, bytes]]:
        drawn = render_views(SCENE, poses, size_px=SIZE, profile=lab, vary_light=True, seed=seed)
        return [(v.image.tobytes(), v.ids.tobytes(), v.depth.tobytes()) for v in drawn]

    first, again, other = views(3), views(3), views(4)
    assert first == again
    for (image, *truth), (changed, *kept) in zip(first, other, strict=True):
        assert (image != changed, truth == kept) == (True, True)


def test_clean_views_have_no_noise_and_truth_of_its_own_size() -> None:
    """Without a profile the image is clean; ids and depth have the requested size."""
    poses = sample_flight_poses(SCENE, np.random.default_rng(2), 1)
    (clean,) = render_views(SCENE, poses, size_px=SIZE, truth_size_px=(112, 56))
    (noisy,) = render_views(SCENE, poses, size_px=SIZE, profile=Profile.named("harsh"))
    assert (clean.image.shape, clean.pose) == ((90, 160, 3), poses[0])
    assert clean.ids.shape == clean.depth.shape == (56, 112)
    assert 3.0 < np.abs(noisy.image.astype(float) - clean.image).mean() < 25.0
