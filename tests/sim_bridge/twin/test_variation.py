"""Scenes drawn from a scene."""

from __future__ import annotations

import math

import numpy as np
import pytest

from sim_bridge.twin.scene import layout_problem
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.variation import varied_scene

SCENE = load_scene("train-a")


def drawn(seed: int = 0, *, layout: bool = True) -> object:
    return varied_scene(SCENE, np.random.default_rng(seed), name="drawn", layout=layout)


@pytest.mark.parametrize("seed", range(8))
def test_a_drawn_layout_can_be_flown_in(seed: int) -> None:
    """Boxes stand apart from each other and from the pad, on the carpet, as high as others do."""
    scene = varied_scene(SCENE, np.random.default_rng(seed), name="drawn", layout=True)
    assert layout_problem(scene.helipad, scene.boxes) is None
    assert [box.pattern for box in scene.boxes] == [box.pattern for box in SCENE.boxes]
    places = [box.position_m for box in scene.boxes]
    for index, place in enumerate(places):
        assert math.dist(place, scene.helipad.position_m) >= 0.95
        assert all(math.dist(place, other) >= 1.05 for other in places[:index])
    assert all(0.6 <= box.size_m[2] <= 2.2 for box in scene.boxes)


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
