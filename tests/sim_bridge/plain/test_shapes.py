"""Rays onto each shape of a lab agree with MuJoCo's rays and with the renderer."""

from __future__ import annotations

import math
from pathlib import Path

import mujoco
import numpy as np
import pytest

from sim_bridge.plain.caster import Caster
from sim_bridge.twin.builder import HIT_GROUP
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.model import build_model
from sim_bridge.twin.render import Renderer
from sim_bridge.twin.routes import Traffic
from sim_bridge.twin.scene_file import load_scene
from tests.sim_bridge.twin.room_world import alone, scene_of, write_lab

SIZE = (64, 36)


def poses(count: int) -> list[CameraPose]:
    """Return poses on a circle that look at the middle, from above and below a table's top."""
    generator = np.random.default_rng(7)
    found = []
    for number in range(count):
        turn, away = 2.0 * math.pi * number / count, generator.uniform(1.2, 1.8)
        z_m = float(generator.uniform(0.15, 2.3))
        found.append(
            CameraPose(
                x_m=away * math.cos(turn),
                y_m=away * math.sin(turn),
                z_m=z_m,
                yaw_rad=turn + math.pi + float(generator.normal(0.0, 0.1)),
                pitch_rad=math.atan2(0.5 - z_m, away),
            )
        )
    return found


@pytest.mark.parametrize("kind", ["drum", "crate", "table", "rack", "cone"])
def test_rays_meet_a_shape_where_mujoco_meets_its_contacts(tmp_path: Path, kind: str) -> None:
    """Random rays of the view, on and beside pixels: the same hits, within a micrometre."""
    scene = alone(write_lab(tmp_path / "hall"), kind)
    lab = build_model(scene, drawn=False)
    data = mujoco.MjData(lab.model)
    mujoco.mj_forward(lab.model, data)
    groups = np.zeros(6, np.uint8)
    groups[HIT_GROUP] = 1
    caster, generator = Caster(scene, SIZE), np.random.default_rng(1)
    met, geom = 0, np.zeros(1, np.int32)
    for pose in poses(8):
        rays = caster.rays + generator.uniform(-0.004, 0.004, caster.rays.shape)
        ids, depth_m = caster.cast(pose, rays=rays)
        axis, up = (np.array(each) for each in pose.axes())
        right = np.cross(axis, up)
        start = np.array((pose.x_m, pose.y_m, pose.z_m))
        for row, column in generator.integers((0, 0), SIZE[::-1], (60, 2)):
            ray = axis + rays[row, column, 0] * right - rays[row, column, 1] * up
            length = np.linalg.norm(ray)
            far = mujoco.mj_ray(lab.model, data, start, ray / length, groups, 1, -1, geom) / length
            name = lab.contact_name(int(geom[0]))
            if name == "ceiling":
                continue
            assert depth_m[row, column] == pytest.approx(far, abs=2e-5)
            assert (ids[row, column] >= 4) == (name == f"{kind}-1")
            met += name == f"{kind}-1"
    assert met > 20


@pytest.mark.parametrize("kind", ["drum", "table", "rack", "cone"])
def test_the_renderer_draws_the_same_classes_and_depth(tmp_path: Path, kind: str) -> None:
    scene = alone(write_lab(tmp_path / "hall"), kind)
    caster, wrong = Caster(scene, (160, 90)), []
    with Renderer(build_model(scene)) as renderer:
        for pose in poses(5):
            ids, depth_m = caster.cast(pose)
            drawn, exact_m = renderer.ids_and_depth(pose, 160, 90)
            same = (ids == drawn) & (ids != 0)
            # A drawn cylinder has 32 faces; at an edge a ray may meet another part.
            off = same & (np.abs(depth_m - exact_m) > (0.01 if kind == "drum" else 1e-3))
            wrong.append(np.mean((ids != drawn) | off))
    assert np.mean(wrong) < 3e-3


def test_a_concave_mesh_is_seen_as_it_is() -> None:
    """The depot's barrier has a foot: rays do not meet its hull."""
    scene = load_scene("depot-train-a")
    barrier = next(item for item in scene.placed if item.name == "barrier-1")
    x_m, y_m = barrier.spec.position_m
    along = math.radians(barrier.spec.yaw_deg)
    pose = CameraPose(
        x_m=x_m + 1.4 * math.cos(along),
        y_m=y_m + 1.4 * math.sin(along),
        z_m=0.5,
        yaw_rad=along + math.pi,
        pitch_rad=-0.1,
    )
    ids, depth_m = Caster(scene, (160, 90)).cast(pose)
    with Renderer(build_model(scene)) as renderer:
        drawn, exact_m = renderer.ids_and_depth(pose, 160, 90)
    same = (ids == drawn) & (ids == barrier.shape.class_id)
    assert np.mean(ids != drawn) < 2e-3
    assert np.mean(np.abs(depth_m - exact_m)[same] > 3e-3) < 1e-2
    shown = (ids == barrier.shape.class_id).sum(axis=1)
    assert shown[shown > 0].max() > 2 * shown[shown > 0].min(), "narrow above, wide below"


def test_movers_of_a_kind_are_seen_where_they_are(tmp_path: Path) -> None:
    text = """\
take_off: {from: [-2.5, -1.5]}
movers:
  - {kind: cone, path_m: [[-1.0, 1.0], [1.5, 1.0]], speed_mps: 0.5, yaw_deg: 30}
  - {kind: table, path_m: [[1.5, -1.0], [0.0, -1.0]], speed_mps: 0.4}
"""
    scene = scene_of(write_lab(tmp_path / "hall"), text)
    assert [mover.size_m for mover in scene.movers] == [(0.6, 0.5, 0.7), (1.0, 0.6, 0.8)]
    movers = Traffic(scene.movers, 0).at(1.5)
    pose = CameraPose(x_m=-2.2, y_m=0.0, z_m=1.4, yaw_rad=0.0, pitch_rad=-0.4)
    ids, depth_m = Caster(scene, (160, 90)).cast(pose, movers)
    with Renderer(build_model(scene)) as renderer:
        drawn, exact_m = renderer.ids_and_depth(pose, 160, 90, movers)
    same = (ids == drawn) & (ids != 0)
    assert set(np.unique(ids)) >= {scene.class_of(mover) for mover in scene.movers}
    assert np.mean(ids != drawn) < 2e-3
    assert np.mean(np.abs(depth_m - exact_m)[same] > 3e-3) < 1e-3


def test_a_ground_of_five_corners_and_its_walls_hide_what_is_behind(tmp_path: Path) -> None:
    """An L-shaped hall: beyond its inner corner there is a wall, in both views."""
    outline = "[[-3, -2], [3, -2], [3, 0], [0, 0], [0, 2], [-3, 2]]"
    folder = write_lab(tmp_path / "hall")
    lab = (folder / "lab.yaml").read_text(encoding="utf-8")
    lab = lab.replace("size_m: [6, 4], surface", f"outline_m: {outline}, surface")
    (folder / "lab.yaml").write_text(lab, encoding="utf-8")
    scene = scene_of(folder, "take_off: {from: [-2.0, -1.0]}\n")
    assert not scene.ground_plan.contains(1.0, 1.0)
    assert scene.ground_plan.contains(-1.0, 1.0)
    caster = Caster(scene, (160, 90))
    with Renderer(build_model(scene)) as renderer:
        for yaw_rad in (0.5, 1.2, -0.3):
            pose = CameraPose(x_m=-2.0, y_m=-1.0, z_m=1.5, yaw_rad=yaw_rad, pitch_rad=-0.4)
            ids, depth_m = caster.cast(pose)
            drawn, exact_m = renderer.ids_and_depth(pose, 160, 90)
            assert np.mean(ids != drawn) < 2e-3
            below = np.abs(depth_m - exact_m)[(ids == drawn) & (caster.rays[..., 1] > 0)]
            assert below.max() < 0.01
