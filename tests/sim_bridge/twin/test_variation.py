"""Random variations of a scene: objects, light, movers and take-off poses."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sim_bridge.twin import variation
from sim_bridge.twin.flying_body import FlyingBody
from sim_bridge.twin.model import build_model
from sim_bridge.twin.objects import Helipad, ObjectSpec
from sim_bridge.twin.scene import Scene, TakeOffSpec
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.variation import start_pose, varied, varied_scene, with_movers
from sim_bridge.twin.views import sample_flight_poses
from uav_bt.errors import ValueRangeError

SCENE = load_scene("train-a")
DEPOT = load_scene("depot-val-a")
HALL = load_scene("benchmarks/scenes/hall-10m.yaml")
MOVING = load_scene("benchmarks/scenes/moving.yaml")


def drawn(scene: Scene, seed: int, *, layout: bool = True) -> Scene:
    return varied_scene(scene, np.random.default_rng(seed), name="drawn", layout=layout)


@pytest.mark.parametrize("take_off_m", [None, (-1.5, 1.5)])
@pytest.mark.parametrize("pad_m", [(0.5, 0.5, 0.4), (1.6, 1.6, 0.0)])
def test_drawn_boxes_are_apart_from_each_other_and_from_mark_and_take_off(
    take_off_m: tuple[float, float] | None, pad_m: tuple[float, float, float]
) -> None:
    """They do not stand on a large mat, either: else the scene would be refused."""
    original = replace(
        SCENE,
        objects=SCENE.objects[::2],
        helipad=replace(SCENE.helipad, size_m=pad_m),
        take_off=TakeOffSpec(position_m=take_off_m),
    )
    for seed in range(6):
        scene = drawn(original, seed)
        assert [each.kind for each in scene.objects] == [each.kind for each in original.objects]
        places = [scene.helipad.position_m, scene.start_m]
        for spec in scene.objects:
            assert all(math.dist(spec.position_m, at) >= 0.95 for at in places[:2])
            assert all(math.dist(spec.position_m, at) >= 1.05 for at in places[2:])
            assert 0.6 <= spec.size_m[2] <= 2.2
            places.append(spec.position_m)


@pytest.mark.parametrize("scene", [SCENE, MOVING, DEPOT, load_scene("depot-train-b")])
def test_a_scene_is_varied_by_its_seed(scene: Scene) -> None:
    """Objects keep off the paths of movers: else the scene would be refused."""
    found = varied(scene, 3, room=True, movers=2)
    assert found == varied(scene, 3, room=True, movers=2)
    assert found != varied(scene, 4, room=True, movers=2)
    assert [each.kind for each in found.objects] == [each.kind for each in scene.objects]
    assert (found.objects != scene.objects, found.lighting != scene.lighting) == (True, True)
    assert (found.movers[:-2], len(found.movers)) == (scene.movers, len(scene.movers) + 2)
    kinds = {mover.kind for mover in found.movers[-2:]}
    assert kinds <= ({"person", "cart"} if scene.lab == "depot" else {None})


def test_without_a_layout_only_the_light_is_another() -> None:
    scene = drawn(SCENE, 0, layout=False)
    assert replace(scene, name=SCENE.name, lighting=SCENE.lighting) == SCENE
    assert scene.lighting != SCENE.lighting
    assert scene.lighting.direction[2] < 0.0


def test_an_arrangement_that_is_found_by_the_last_try_is_taken(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A single box on a free ground fits at once."""
    alone = replace(SCENE, objects=SCENE.objects[:1])
    expected = drawn(alone, 4)
    monkeypatch.setattr(variation, "_TRIES", 1)
    assert drawn(alone, 4) == expected


@pytest.mark.parametrize("seed", range(6))
def test_drawn_movers_leave_the_mark_alone(seed: int) -> None:
    scene = load_scene("test-a")
    for mover in with_movers(scene, 2, seed).movers:
        assert mover.distance_m(*scene.helipad.position_m) >= 0.9
        assert math.dist(*mover.path_m) >= 1.0


def test_too_many_movers_are_refused() -> None:
    with pytest.raises(ValueRangeError, match=r"takes at most 8 more, got 9"):
        with_movers(SCENE, 9, 0)
    packed = tuple(
        ObjectSpec(kind="box-1", position_m=(x - 2.0, y - 1.5), size_m=(0.3, 0.3, 2.0))
        for x in range(5)
        for y in range(4)
    )
    full = replace(SCENE, helipad=None, objects=packed, take_off=TakeOffSpec(position_m=(0.5, 0.0)))
    with pytest.raises(ValueRangeError, match="no room for 2 more movers"):
        with_movers(full, 2, 0)


def test_a_drawn_layout_uses_the_whole_ground() -> None:
    """In a large hall, boxes and random starts use more than the area of the paper's carpet."""
    scene = replace(drawn(HALL, 1), take_off=TakeOffSpec(random=True))
    starts = [start_pose(scene, seed) for seed in range(30)]
    for places in ([each.position_m for each in scene.objects], [(p.x_m, p.y_m) for p in starts]):
        assert np.abs(places).max(axis=0).min() > 3.0


# --- take-off poses and views ---------------------------------------------------------------------


@pytest.mark.parametrize(
    ("take_off_m", "start_m"), [(None, (-1.0, 1.0, 0.45)), ((0.3, -0.4), (0.3, -0.4, 0.05))]
)
def test_the_body_stands_on_the_landing_mark_or_at_a_place(
    take_off_m: tuple[float, float] | None, start_m: tuple[float, float, float]
) -> None:
    """Its centre is 5 cm above the mark, which is 0.4 m high, or above the ground."""
    spec = TakeOffSpec(position_m=take_off_m, yaw_deg=90.0)
    pose = start_pose(Scene(name="x", helipad=Helipad(position_m=(-1, 1)), take_off=spec), 0)
    found = (pose.x_m, pose.y_m, pose.z_m, pose.yaw_rad)
    assert found == pytest.approx((*start_m, math.pi / 2))


@pytest.mark.parametrize("scene", [SCENE, DEPOT, MOVING])
def test_random_starts_are_on_free_ground_and_follow_the_seed(scene: Scene) -> None:
    """Starts are away from objects, mark, paths and edge."""
    scene = replace(scene, take_off=TakeOffSpec(random=True))
    places = [start_pose(scene, seed) for seed in range(20)]
    assert start_pose(scene, 7) == places[7]
    assert len({pose.x_m for pose in places}) == 20
    half_x, half_y = (side / 2 - 0.5 for side in scene.ground.size_m)
    for pose in places:
        assert (abs(pose.x_m) <= half_x, abs(pose.y_m) <= half_y) == (True, True)
        away = [*(each.footprint for each in scene.ground_plan.standing), *scene.movers]
        assert min(each.distance_m(pose.x_m, pose.y_m) for each in away) >= 0.5


def test_a_ground_without_room_has_no_random_start_and_no_views() -> None:
    """The error names the scene and a remedy."""
    boxes = tuple(
        ObjectSpec(kind=f"box-{k + 1}", position_m=(1.25 * k - 1.875, y), size_m=(1.2, 1.9, 2.3))
        for k in range(4)
        for y in (-1.0, 1.0)
    )
    scene = Scene(name="full", objects=boxes, take_off=TakeOffSpec(random=True))
    with pytest.raises(ValueRangeError, match=r"'full'.*remove or move"):
        start_pose(scene, 0)
    with pytest.raises(ValueRangeError, match=r"'full'.*no room"):
        sample_flight_poses(scene, np.random.default_rng(0), 9)


def test_views_of_a_lab_touch_nothing() -> None:
    lab = build_model(DEPOT, drawn=False)
    for pose in sample_flight_poses(DEPOT, np.random.default_rng(0), 14):
        body = FlyingBody(lab, lag_s=0.1)
        body.place(pose.x_m, pose.y_m, pose.z_m, pose.yaw_rad)
        assert body.contacts() == ()
