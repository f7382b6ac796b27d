"""Rooms by chance: their scenes, bad ones, and the training of `any`."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
import torch

from benchmarks.rooms.bad_rooms import CASES, MIRROR_X_M, write_bad_room
from benchmarks.rooms.furnish import FLOWN, Assets, Furnisher, Furniture
from benchmarks.rooms.network import ROOM_FILES
from benchmarks.rooms.training import RoomImages, depth_loss, train_room_net, zoomed
from benchmarks.rooms.views import ViewKind, draw_poses, draw_views, role_numbers
from perception.networks.training.loop import LoopConfig
from perception.networks.weights_file import SHIPPED_WEIGHTS
from perception.segmentation.runtime import RoomSegmenter
from perception.segmentation.training.run import IGNORED
from sim_bridge.twin.model import build_model
from sim_bridge.twin.scene_file import load_scene
from uav_bt.app.site import network_of
from uav_bt.lab.shipped import load_lab
from uav_bt.learning.views import ViewPlan, twin_views
from uav_bt.testing import Fault
from uav_bt.types import Frame

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


# --- bad rooms ------------------------------------------------------------------------------------


def test_every_bad_room_is_another_lab_that_flies_with_any(tmp_path: Path) -> None:
    found = set()
    for number, case in enumerate(CASES):
        path = write_bad_room(case, tmp_path / str(number))
        scene = load_scene(str(path))
        assert scene.helipad is None
        build_model(scene, drawn=False)
        assert network_of(load_lab(str(path.parents[1])))["model"] == "any"
        faults = tuple(CASES[case].get("faults", ()))
        assert all(map(Fault.parse, faults))
        lab = (path.parents[1] / "lab.yaml").read_bytes()
        found.add((lab, path.read_bytes(), str(CASES[case].get("camera")), faults))
    assert len(found) == len(CASES)


def test_a_mirror_shows_what_stands_before_it(tmp_path: Path) -> None:
    scene = load_scene(str(write_bad_room("mirror", tmp_path / "room")))
    places = {each.spec.position_m for each in scene.placed}
    assert places == {(2 * MIRROR_X_M - x_m, y_m) for x_m, y_m in places}
    assert all(abs(x_m - MIRROR_X_M) > 0.5 for x_m, _ in places)


# --- tests for the training of the network for any room -------------------------------------------


def striped(count: int) -> RoomImages:
    """Return images whose lower half is ground; depth falls from the middle to the lower edge."""
    rng = np.random.default_rng(1)
    rgb = rng.integers(0, 40, (count, 112, 224, 3), dtype=np.uint8)
    rgb[:, 56:, :, 1] += 180
    roles = np.zeros((count, 112, 224), np.uint8)
    roles[:, 56:] = 1
    roles[:, :4] = IGNORED
    depth = np.full((count, 112, 224), 4.0, np.float16)
    depth[:, 56:] = np.linspace(4.0, 1.0, 56)[:, None]
    return RoomImages(rgb=rgb, roles=roles, depth=depth)


def test_labels_follow_the_geometry_of_their_image() -> None:
    ramp = torch.linspace(0.1, 0.9, 224).repeat(6, 3, 112, 1)
    rgb, labels = zoomed(ramp, ramp[:, :1].clone(), torch.Generator().manual_seed(2))
    torch.testing.assert_close(rgb[:, :1], labels, atol=0.01, rtol=0.0)
    slopes = labels[:, 0, 50, -1] - labels[:, 0, 50, 0]
    assert (slopes.abs() < 0.8).all()
    assert {bool(each > 0) for each in slopes} == {True, False}


def test_a_common_factor_costs_less_than_a_wrong_shape() -> None:
    truth = torch.linspace(1.0, 4.0, 56 * 112).view(1, 1, 56, 112)
    right = torch.log(truth)
    factor = depth_loss(right + 0.2, truth)
    shape = depth_loss(right + 0.2 * torch.sign(torch.sin(50 * truth)), truth)
    assert depth_loss(right, truth) == pytest.approx(0.0, abs=1e-6)
    assert 0.0 < factor < shape
    assert depth_loss(right, torch.full_like(truth, 60.0)) == 0.0


def test_training_learns_roles_and_depth() -> None:
    images, losses = striped(8), list[float]()
    net = train_room_net(
        images,
        LoopConfig(steps=25, batch=4, warm_up_steps=3, average=0.5),
        lambda rgb, labels, _: (rgb, labels),
        lambda now, _: losses.append(now.loss),
    )
    assert np.mean(losses[-5:]) < 0.5 * np.mean(losses[:3])
    assert (net.predict_roles(images.rgb[0])[8:] == images.roles[0][8:]).mean() > 0.9


def test_the_shipped_network_answers_as_its_weights_do() -> None:
    file, weights = SHIPPED_WEIGHTS / "any.onnx", SHIPPED_WEIGHTS / "any.safetensors"
    net, _ = ROOM_FILES.load(weights)
    size = (net.config.width_px, net.config.height_px)
    flies = RoomSegmenter(file, load_lab("depot").classes)
    same = []
    plan = ViewPlan(scenes=("depot-val-a",), views=6, size_px=(640, 360))
    for _, rgb, _ in twin_views(plan):
        small = cv2.resize(rgb, size, interpolation=cv2.INTER_AREA)
        frame = Frame(image=small, index=1, captured_s=2.5, gimbal_pitch_rad=-0.5)
        roles = role_numbers(flies.segment(frame).roles)
        same.append((net.predict_roles(small) == roles).mean())
    assert np.mean(same) > 0.97
