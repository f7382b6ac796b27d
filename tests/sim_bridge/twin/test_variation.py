"""Random variations of a scene: objects, light, movers and take-off poses."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace

import numpy as np
import pytest

from sim_bridge.twin import variation
from sim_bridge.twin.objects import ObjectSpec
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


def full_of(wide_m: float, deep_m: float) -> Scene:
    """Return a scene with a grid of eight boxes."""
    boxes = tuple(
        ObjectSpec(kind="box-1", position_m=(1.25 * k - 1.875, y), size_m=(wide_m, deep_m, 2.3))
        for k in range(4)
        for y in (-1.0, 1.0)
    )
    return Scene(name="full", objects=boxes, take_off=TakeOffSpec(random=True))


@pytest.mark.parametrize("take_off_m", [None, (-1.5, 1.5)])
@pytest.mark.parametrize("pad_m", [(0.5, 0.5, 0.4), (1.6, 1.6, 0.0)])
def test_drawn_boxes_are_apart_from_each_other_and_from_mark_and_take_off(
    take_off_m: tuple[float, float] | None, pad_m: tuple[float, float, float]
) -> None:
    """They do not stand on a large mat, either: else the scene would be refused."""
    pad, start = replace(SCENE.helipad, size_m=pad_m), TakeOffSpec(position_m=take_off_m)
    original = replace(SCENE, objects=SCENE.objects[::2], helipad=pad, take_off=start)
    for seed in range(6):
        objects = drawn(original, seed).objects
        assert [each.kind for each in objects] == [each.kind for each in original.objects]
        assert all(0.6 <= each.size_m[2] <= 2.2 for each in objects)
        for a, b in itertools.combinations(objects, 2):
            assert math.dist(a.position_m, b.position_m) >= 1.05
        for each, at_m in itertools.product(objects, (pad.position_m, original.start_m)):
            assert math.dist(each.position_m, at_m) >= 0.95


@pytest.mark.parametrize("scene", [SCENE, MOVING, DEPOT])
def test_a_scene_is_varied_by_its_seed(scene: Scene) -> None:
    """Objects keep off the paths of movers: else the scene would be refused."""
    found, same, other = (varied(scene, seed, room=True, movers=2) for seed in (3, 3, 4))
    assert found == same != other
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


def test_an_arrangement_of_the_last_try_is_taken(monkeypatch: pytest.MonkeyPatch) -> None:
    """A single box on a free ground fits at once."""
    alone = replace(SCENE, objects=SCENE.objects[:1])
    expected = drawn(alone, 4)
    monkeypatch.setattr(variation, "_TRIES", 1)
    assert drawn(alone, 4) == expected


def test_drawn_movers_leave_the_mark_alone() -> None:
    scene = load_scene("test-a")
    for mover in [each for seed in range(6) for each in with_movers(scene, 2, seed).movers]:
        assert mover.distance_m(*scene.helipad.position_m) >= 0.9
        assert math.dist(*mover.path_m) >= 1.0


def test_movers_without_room_are_refused() -> None:
    with pytest.raises(ValueRangeError, match=r"takes at most 8 more, got 9"):
        with_movers(SCENE, 9, 0)
    with pytest.raises(ValueRangeError, match="no room for 2 more movers"):
        with_movers(full_of(0.95, 0.9), 2, 0)


def test_a_drawn_layout_uses_the_whole_ground() -> None:
    """In a large hall, boxes and random starts use more than the area of the paper's carpet."""
    scene = replace(drawn(HALL, 1), take_off=TakeOffSpec(random=True))
    starts = [start_pose(scene, seed) for seed in range(30)]
    for places in ([each.position_m for each in scene.objects], [(p.x_m, p.y_m) for p in starts]):
        assert np.abs(places).max(axis=0).min() > 3.0


@pytest.mark.parametrize("scene", [SCENE, DEPOT, MOVING])
def test_random_starts_are_on_free_ground_and_follow_the_seed(scene: Scene) -> None:
    """Starts are away from objects, mark, paths and edge."""
    scene = replace(scene, take_off=TakeOffSpec(random=True))
    starts = [start_pose(scene, seed) for seed in range(20)]
    assert start_pose(scene, 7) == starts[7]
    assert len({pose.x_m for pose in starts}) == 20
    away = [*(each.footprint for each in scene.ground_plan.standing), *scene.movers]
    for pose in starts:
        assert scene.ground.margin_m(pose.x_m, pose.y_m) >= 0.5
        assert min(each.distance_m(pose.x_m, pose.y_m) for each in away) >= 0.5


def test_a_ground_without_room_has_no_random_start_and_no_views() -> None:
    """The error names the scene and a remedy."""
    with pytest.raises(ValueRangeError, match=r"'full'.*remove or move"):
        start_pose(full_of(1.2, 1.9), 0)
    with pytest.raises(ValueRangeError, match=r"'full'.*no room"):
        sample_flight_poses(full_of(1.2, 1.9), np.random.default_rng(0), 9)
