"""Random variations of a scene, and take-off poses."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sim_bridge.twin.layout import layout_problem
from sim_bridge.twin.objects import BoxSpec, Helipad
from sim_bridge.twin.scene import Scene, TakeOffSpec
from sim_bridge.twin.scene_file import load_scene, scene_names
from sim_bridge.twin.variation import start_pose, varied, varied_scene
from uav_bt.errors import ValueRangeError

SCENE = load_scene("train-a")
HALL = load_scene("benchmarks/scenes/hall-10m.yaml")


def drawn(seed: int = 0, *, layout: bool = True) -> object:
    return varied_scene(SCENE, np.random.default_rng(seed), name="drawn", layout=layout)


@pytest.mark.parametrize("seed", range(8))
def test_a_drawn_layout_can_be_flown_in(seed: int) -> None:
    """Boxes are on the ground, apart from each other and the pad, with the usual heights."""
    scene = varied_scene(SCENE, np.random.default_rng(seed), name="drawn", layout=True)
    assert layout_problem(scene.helipad, scene.boxes, scene.ground) is None
    assert [box.pattern for box in scene.boxes] == [box.pattern for box in SCENE.boxes]
    places = [box.position_m for box in scene.boxes]
    for index, place in enumerate(places):
        assert math.dist(place, scene.helipad.position_m) >= 0.95
        assert all(math.dist(place, other) >= 1.05 for other in places[:index])
    assert all(0.6 <= box.size_m[2] <= 2.2 for box in scene.boxes)


@pytest.mark.parametrize("name", scene_names())
def test_every_shipped_scene_can_be_varied(name: str) -> None:
    """A take-off point apart from the mark stays free, too."""
    for seed in range(6):
        scene = varied(load_scene(name), seed, room=True, movers=1)
        assert len(scene.movers) == len(load_scene(name).movers) + 1


def test_boxes_keep_away_from_a_take_off_point_apart_from_the_mark() -> None:
    elsewhere = replace(SCENE, boxes=(), take_off=TakeOffSpec(position_m=(-1.5, 1.5)))
    elsewhere = replace(elsewhere, boxes=SCENE.boxes[:3])
    for seed in range(20):
        for box in varied(elsewhere, seed, room=True, movers=0).boxes:
            assert math.dist(box.position_m, (-1.5, 1.5)) >= 0.95


def test_a_drawn_layout_uses_the_whole_ground() -> None:
    """In a large hall, boxes and random starts use more than the area of the paper's carpet."""
    drawn_hall = varied_scene(HALL, np.random.default_rng(1), name="drawn", layout=True)
    assert len(drawn_hall.boxes) == 12
    assert max(max(map(abs, box.position_m)) for box in drawn_hall.boxes) > 3.0
    anywhere = replace(HALL, take_off=TakeOffSpec(random=True))
    starts = [start_pose(anywhere, seed) for seed in range(30)]
    assert max(abs(pose.x_m) for pose in starts) > 3.0
    assert max(abs(pose.y_m) for pose in starts) > 3.0


def test_without_a_layout_only_the_light_is_another() -> None:
    scene = varied_scene(SCENE, np.random.default_rng(0), name="drawn", layout=False)
    assert (scene.boxes, scene.helipad, scene.take_off) == (
        SCENE.boxes,
        SCENE.helipad,
        SCENE.take_off,
    )
    assert scene.lighting != SCENE.lighting
    assert scene.lighting.direction[2] < 0.0


def test_the_same_draw_gives_the_same_scene() -> None:
    assert drawn(3) == drawn(3)
    assert drawn(3) != drawn(4)


def test_on_the_helipad_the_body_stands_on_its_top() -> None:
    """The bottom of the hull is at 0.4 m, its centre 5 cm higher."""
    scene = load_scene("train-a")
    pose = start_pose(scene, 0)
    assert (pose.x_m, pose.y_m) == scene.helipad.position_m
    assert pose.z_m == pytest.approx(0.45)
    assert pose.yaw_rad == pytest.approx(math.radians(scene.take_off.yaw_deg))


def test_random_starts_are_on_free_ground_and_follow_the_seed() -> None:
    """Starts are away from boxes, pad and edge; the same seed gives the same start."""
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
    """It keeps its yaw and is on the ground."""
    spec = TakeOffSpec(position_m=(0.3, -0.4), yaw_deg=90.0)
    pose = start_pose(Scene(name="x", helipad=Helipad(position_m=(-1, 1)), take_off=spec), 0)
    assert (pose.x_m, pose.y_m, pose.z_m) == pytest.approx((0.3, -0.4, 0.05))
    assert pose.yaw_rad == pytest.approx(math.pi / 2)


def test_a_full_ground_has_no_random_start() -> None:
    """The error names the scene and a remedy."""
    boxes = tuple(
        BoxSpec(pattern=k + 1, position_m=(-1.8 + 1.2 * k, 0.0), size_m=(0.8, 3.6, 1.0))
        for k in (0, 1, 3)
    )
    pad = Helipad(position_m=(0.6, 0.0), size_m=(0.8, 3.6, 0.4))
    scene = Scene(name="full", helipad=pad, boxes=boxes, take_off=TakeOffSpec(random=True))
    with pytest.raises(ValueRangeError, match=r"'full'.*remove or move"):
        start_pose(scene, 0)
