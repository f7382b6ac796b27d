"""Ray casting shows what the twin's renderer draws."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sim_bridge.plain.caster import Caster
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.model import build_model
from sim_bridge.twin.movers import MoverSpec
from sim_bridge.twin.render import Renderer
from sim_bridge.twin.routes import Traffic
from sim_bridge.twin.scene import Scene, TakeOffSpec
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.views import sample_flight_poses
from tests.paper_lab import BACKGROUND, CARPET

SIZE = (112, 56)


@pytest.mark.parametrize("name", ["train-b", "val-a"])
def test_views_agree_with_the_renderer(name: str) -> None:
    """Class ids differ on borders only, and depth by less than a millimetre."""
    scene = load_scene(name)
    caster = Caster(scene, SIZE)
    wrong = []
    with Renderer(build_model(scene)) as renderer:
        for pose in sample_flight_poses(scene, np.random.default_rng(1), 12, lowered=0.5):
            ids, depth_m = caster.cast(pose)
            drawn, exact_m = renderer.ids_and_depth(pose, *SIZE)
            wrong.append(np.mean(ids != drawn))
            same = (ids == drawn) & (ids != BACKGROUND)
            assert np.abs(depth_m - exact_m)[same].max(initial=0.0) < 1e-3
    assert np.mean(wrong) < 3e-4


def test_people_and_carts_are_seen_where_they_are() -> None:
    scene = replace(
        load_scene("train-a"),
        boxes=(),
        movers=(
            MoverSpec(path_m=((-1.5, 1.0), (1.5, 1.0)), speed_mps=0.5),
            MoverSpec(
                path_m=((1.5, -1.2), (0.5, -1.2)),
                speed_mps=0.5,
                shape="box",
                size_m=(0.5, 0.35, 1.0),
                yaw_deg=30.0,
            ),
        ),
    )
    movers = Traffic(scene.movers, 0).at(1.3)
    pose = CameraPose(x_m=-1.9, y_m=-0.2, z_m=1.5, yaw_rad=0.1, pitch_rad=math.radians(-20))
    ids, depth_m = Caster(scene, SIZE).cast(pose, movers)
    with Renderer(build_model(scene)) as renderer:
        drawn, exact_m = renderer.ids_and_depth(pose, *SIZE, movers)
    assert np.mean(ids != drawn) < 2e-3  # the renderer's cylinder has 32 faces
    same = (ids == drawn) & (ids != BACKGROUND)
    assert np.abs(depth_m - exact_m)[same].max() < 0.03  # where a ray grazes it


def test_a_camera_straight_down_inside_a_corner_of_boxes_sees_the_ground() -> None:
    """A view without a horizon: depth is the height of the lens."""
    scene = replace(load_scene("train-a"), boxes=())
    pose = CameraPose(x_m=1.5, y_m=1.2, z_m=1.3, yaw_rad=0.0, pitch_rad=-math.pi / 2)
    ids, depth_m = Caster(scene, SIZE).cast(pose)
    assert ids[28, 56] == CARPET
    assert depth_m[28, 56] == pytest.approx(1.3)


def test_a_scene_without_boxes_and_mark_shows_its_ground() -> None:
    scene = Scene(name="empty", take_off=TakeOffSpec(position_m=(0.0, 0.0)))
    pose = CameraPose(x_m=0.0, y_m=0.0, z_m=1.5, yaw_rad=0.0, pitch_rad=-math.pi / 2)
    ids, depth_m = Caster(scene, SIZE).cast(pose)
    assert (ids == CARPET).all()
    assert depth_m == pytest.approx(np.full(depth_m.shape, 1.5), abs=1e-5)
    with Renderer(build_model(scene)) as renderer:
        drawn, _ = renderer.ids_and_depth(pose, *SIZE)
    assert (drawn == ids).all()
