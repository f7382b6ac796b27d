"""Tests for furnished rooms and their images."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from benchmarks.rooms.furnish import FLOWN, SIDE_PX, Assets, Furnisher, Furniture, draw_surface
from benchmarks.rooms.views import ViewKind, draw_poses, draw_views
from perception.segmentation.training.run import IGNORED
from sim_bridge.twin.scene_file import load_scene
from uav_bt.lab.shipped import load_lab

BARRIER = Path(__file__).parents[2] / "labs" / "depot" / "barrier.obj"


@pytest.fixture
def assets() -> Assets:
    noise = np.random.default_rng(5).integers(0, 255, (128, 96, 3), dtype=np.uint8)
    return Assets(furniture=[Furniture(path=BARRIER, size_m=(1.0, 0.4, 0.8))], photographs=[noise])


def furnished(folder: Path, assets: Assets, seed: int = 3) -> Path:
    return Furnisher(folder, assets, np.random.default_rng(seed), FLOWN).write()


def test_a_room_is_a_lab_with_a_scene(tmp_path: Path, assets: Assets) -> None:
    path = furnished(tmp_path / "room", assets)
    scene = load_scene(str(path))
    assert scene.placed
    assert scene.helipad is not None
    assert load_lab(str(tmp_path / "room")).mark.kind == "apriltag"


def test_the_same_seed_gives_the_same_room(tmp_path: Path, assets: Assets) -> None:
    found = []
    for number, seed in enumerate((3, 3, 4)):
        folder = furnished(tmp_path / str(number) / "room", assets, seed).parents[1]
        files = folder.rglob("*.*")
        found.append({path.relative_to(folder): path.read_bytes() for path in files})
    assert found[0] == found[1] != found[2]


def test_views_have_roles_and_depth_from_above_the_floor(tmp_path: Path, assets: Assets) -> None:
    scene = load_scene(str(furnished(tmp_path / "room", assets)))
    views = list(draw_views(scene, 12, seed=1, kind=ViewKind.LEVEL))
    shares = np.zeros(256)
    for view in views:
        assert set(np.unique(view.ids)) <= {0, 1, 2, IGNORED}
        shares += np.bincount(view.ids.ravel(), minlength=256)
        ground = view.ids == 1
        if ground.any():
            # A level camera sees the floor at its height or beyond; this one looks down.
            assert view.depth[ground].min() > 0.5 * view.pose.z_m
    assert (shares[:3] > 0.01 * shares.sum()).all(), "outside, ground and obstacle are in view"
    again = next(draw_views(scene, 12, seed=1, kind=ViewKind.LEVEL))
    np.testing.assert_array_equal(again.image, views[0].image)


def test_half_of_the_poses_are_flown_and_a_fifth_are_steep_or_close_above_furniture(
    tmp_path: Path, assets: Assets
) -> None:
    scene = load_scene(str(furnished(tmp_path / "room", assets)))
    poses = draw_poses(scene, np.random.default_rng(2), 400)
    heights_m = np.array([pose.z_m for pose in poses])
    pitches_deg = np.degrees([pose.pitch_rad for pose in poses])
    flown = (pitches_deg > -36) & (pitches_deg < -19) & (heights_m > 0.99) & (heights_m < 1.71)
    assert 0.42 < flown.mean() < 0.7
    assert 0.15 < (pitches_deg < -60).mean() < 0.35
    assert heights_m.min() < 0.5
    outlines = [item.footprint for item in scene.placed]
    over = [any(one.contains(pose.x_m, pose.y_m) for one in outlines) for pose in poses]
    assert np.mean(over) > 0.05
    down = draw_poses(scene, np.random.default_rng(2), 50, ViewKind.DOWN)
    assert max(pose.pitch_rad for pose in down) < np.radians(-84.9)


def test_no_pose_is_in_a_box_of_the_papers_lab() -> None:
    scene = load_scene("train-a")
    assert scene.objects
    for pose in draw_poses(scene, np.random.default_rng(0), 200):
        assert pose.z_m > scene.surface_m(pose.x_m, pose.y_m) + 0.2


def test_surfaces_repeat_without_a_seam(assets: Assets) -> None:
    rng = np.random.default_rng(0)
    for _ in range(20):
        image = draw_surface(assets.photographs, rng, plain=0.3)
        assert image.shape == (SIDE_PX, SIDE_PX, 3)
        assert image.dtype == np.uint8
