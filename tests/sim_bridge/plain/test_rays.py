"""Rays onto ground, boxes and every shape of a lab agree with MuJoCo's rays and the renderer."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import mujoco
import numpy as np
import pytest

from sim_bridge.plain.caster import Caster
from sim_bridge.twin.builder import HIT_GROUP
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.model import build_model
from sim_bridge.twin.movers import Traffic
from sim_bridge.twin.render import Renderer
from sim_bridge.twin.scene import Scene, TakeOffSpec
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.views import sample_flight_poses
from tests.paper_lab import CARPET
from tests.sim_bridge.twin.lab_world import lens
from tests.sim_bridge.twin.room_world import (
    FURNISHED,
    FURNITURE,
    L_SHAPED,
    START,
    alone,
    scene_of,
    write_lab,
)
from uav_bt.types import MoverState, Pose2D

SIZE = (160, 90)


def around(count: int) -> list[CameraPose]:
    """Return poses on a circle that look at the middle, from above and below a table's top."""
    generator, poses = np.random.default_rng(7), []
    for turn_deg in np.linspace(0.0, 360.0, count, endpoint=False).tolist():
        away_m, z_m = generator.uniform(1.2, 1.8), generator.uniform(0.15, 2.3)
        x_m, y_m = Pose2D(x_m=0.0, y_m=0.0, yaw_rad=math.radians(turn_deg)).to_world(away_m, 0.0)
        pitch_deg = math.degrees(math.atan2(0.5 - z_m, away_m))
        poses.append(lens(x_m, y_m, z_m, turn_deg + generator.normal(180.0, 6.0), pitch_deg))
    return poses


def share_off(
    scene: Scene,
    poses: Sequence[CameraPose],
    movers: tuple[MoverState, ...] = (),
    *,
    off_m: float = 1e-3,
) -> float:
    """Return the share of pixels whose class or depth differs from that of the renderer."""
    caster, wrong = Caster(scene, SIZE), []
    with Renderer(build_model(scene)) as renderer:
        for pose in poses:
            ids, depth_m = caster.cast(pose, movers)
            drawn, exact_m = renderer.ids_and_depth(pose, *SIZE, movers)
            known = ids != 0  # the caster has no ceiling, and walls where the lab states them
            if scene.room.walls is not None:
                known |= caster.rays[..., 1] > 0
            wrong.append(np.mean((ids != drawn) | known & (np.abs(depth_m - exact_m) > off_m)))
    return float(np.mean(wrong))


@pytest.mark.parametrize("kind", ["drum", "crate", "table", "rack", "cone", *FURNITURE])
def test_rays_meet_a_shape_where_mujoco_meets_its_contacts(tmp_path: Path, kind: str) -> None:
    """Random rays of the view, on and beside pixels: the same hits, within a micrometre."""
    scene = alone(write_lab(tmp_path / "hall", FURNISHED), kind)
    lab = build_model(scene, drawn=False)
    data = mujoco.MjData(lab.model)
    mujoco.mj_forward(lab.model, data)
    groups = np.zeros(6, np.uint8)
    groups[HIT_GROUP] = 1
    caster, generator = Caster(scene, (64, 36)), np.random.default_rng(1)
    geom, met = np.zeros(1, np.int32), 0
    for pose in around(8):
        rays = caster.rays + generator.uniform(-0.004, 0.004, caster.rays.shape)
        ids, depth_m = caster.cast(pose, rays=rays)
        axis, up = map(np.array, pose.axes())
        start, right = np.array((pose.x_m, pose.y_m, pose.z_m)), np.cross(axis, up)
        for at in map(tuple, generator.integers((0, 0), (36, 64), (60, 2))):
            ray = axis + rays[at][0] * right - rays[at][1] * up
            length = np.linalg.norm(ray)
            far = mujoco.mj_ray(lab.model, data, start, ray / length, groups, 1, -1, geom) / length
            name = lab.contact_name(int(geom[0]))
            if name != "ceiling":
                assert depth_m[at] == pytest.approx(far, abs=2e-5)
                assert (ids[at] >= 4) == (name == f"{kind}-1")
            met += name == f"{kind}-1"
    assert met > 20


@pytest.mark.parametrize("kind", ["drum", "table", "rack", "cone"])
def test_the_renderer_draws_the_same_shapes(tmp_path: Path, kind: str) -> None:
    """A drawn cylinder has 32 faces; at an edge a ray may meet another part."""
    scene = alone(write_lab(tmp_path / "hall"), kind)
    assert share_off(scene, around(5), off_m=0.01 if kind == "drum" else 1e-3) < 3e-3


def test_the_renderer_draws_the_same_furniture_doors_and_windows(tmp_path: Path) -> None:
    """Doors and windows have the class of the walls, as seen and as cast."""
    kinds = enumerate((*FURNITURE, "door", "window"))
    items = [
        f"  - {{kind: {kind}, wall: {n % 4 + 1}, along_m: {n // 4 * 1.4}}}\n" for n, kind in kinds
    ]
    scene = scene_of(write_lab(tmp_path / "hall", FURNISHED), f"{START}objects:\n{''.join(items)}")
    poses = [lens(0.0, 0.0, 1.4, yaw_deg, -15.0) for yaw_deg in range(0, 360, 72)]
    assert share_off(scene, poses, off_m=0.01) < 3e-3


@pytest.mark.parametrize("name", ["train-b", "benchmarks/scenes/hall-10m.yaml", "depot-train-a"])
def test_the_renderer_draws_the_same_scenes(name: str) -> None:
    """They differ on borders only. The depot has a concave mesh, and walls at the ground's edge."""
    scene = load_scene(name)
    poses = sample_flight_poses(scene, np.random.default_rng(1), 12, lowered=0.5)
    assert share_off(scene, poses) < (3e-3 if name.startswith("depot") else 6e-4)


def test_movers_are_seen_where_they_are(tmp_path: Path) -> None:
    text = f"""\
{START}movers:
  - {{kind: cone, path_m: [[-1.0, 1.0], [1.5, 1.0]], speed_mps: 0.5, yaw_deg: 30}}
  - {{kind: table, path_m: [[1.5, -1.0], [0.0, -1.0]], speed_mps: 0.4}}
  - {{pattern: 1, path_m: [[0.0, 0.2], [1.5, 0.2]], speed_mps: 0.5}}
  - {{pattern: 1, shape: box, size_m: [0.5, 0.3, 1], path_m: [[2, 1], [2, 0]], speed_mps: 0.5}}
"""
    scene = scene_of(write_lab(tmp_path / "hall"), text)
    pose = lens(-2.2, 0.0, 1.4, 0.0, -23.0)
    movers = Traffic(scene.movers, 0).at(1.5)
    ids, _ = Caster(scene, SIZE).cast(pose, movers)
    assert set(np.unique(ids)) >= {scene.shape_of(mover).class_id for mover in scene.movers}
    assert share_off(scene, [pose], movers, off_m=0.01) < 4e-3


def test_a_ground_of_five_corners_and_its_walls_hide_what_is_behind(tmp_path: Path) -> None:
    """An L-shaped hall: beyond its inner corner there is a wall, in both views."""
    scene = scene_of(write_lab(tmp_path / "hall", L_SHAPED), "take_off: {from: [-2.0, -1.0]}\n")
    plan = scene.ground_plan
    assert (plan.contains(1.0, 1.0), plan.contains(-1.0, 1.0)) == (False, True)
    poses = [lens(-2.0, -1.0, 1.5, yaw_deg, -23.0) for yaw_deg in (30.0, 70.0, -15.0)]
    assert share_off(scene, poses, off_m=0.01) < 2e-3


def test_a_view_straight_down_on_a_bare_ground_has_the_depth_of_the_lens() -> None:
    scene = Scene(name="bare", take_off=TakeOffSpec(random=True))
    ids, depth_m = Caster(scene, SIZE).cast(lens(0.4, 0.3, 1.3, 0.0, -90.0))
    assert (ids == CARPET).all()
    assert depth_m == pytest.approx(np.full(depth_m.shape, 1.3), abs=1e-5)
