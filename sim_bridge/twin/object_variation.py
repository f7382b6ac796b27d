"""Random variations of a lab: places of objects, lamps, and movers of its kinds."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from sim_bridge.twin.layout import layout_problem
from sim_bridge.twin.movers import MoverSpec
from sim_bridge.twin.placed import ObjectSpec, PlacedObject, Shape, object_names
from sim_bridge.twin.scene import Lighting, Scene, traffic_problem
from uav_bt.errors import ValueRangeError

_GAP_M: Final = 0.75  # between the circles around two objects; lets the drone pass most pairs
_FROM_PAD_M: Final = 0.6  # from the circle around an object to the pad's or take-off's centre
_TRIES: Final = 8000
_BRIGHTER: Final = (0.6, 1.3)  # range of a lamp's brightness over its own
_AMBIENTS: Final = (0.2, 0.5)


def moved_objects(scene: Scene, rng: np.random.Generator) -> tuple[ObjectSpec, ...]:
    """Return the objects of a scene at random places, as far apart as drone and paths need.

    Args:
        scene: the scene.
        rng: source of the random numbers.

    Raises:
        ValueRangeError: no arrangement was found.
    """
    placed: list[PlacedObject] = []
    names = object_names(scene.objects)
    gap_m = _GAP_M
    for number in range(_TRIES):
        if len(placed) == len(scene.objects):
            return tuple(item.spec for item in placed)
        if number % (_TRIES // 4) == _TRIES // 4 - 1:
            gap_m *= 0.6  # a full hall: accept narrower gaps
            placed.clear()
        item = _drawn(scene, len(placed), names[len(placed)], rng)
        if _fits(scene, item, placed, gap_m):
            placed.append(item)
        elif rng.random() < 0.01:  # restart: the first objects may leave no space for the rest
            placed.clear()
    raise ValueRangeError(f"no room for {len(names)} objects in scene '{scene.name}'")


def _drawn(scene: Scene, index: int, name: str, rng: np.random.Generator) -> PlacedObject:
    x_m, y_m = (
        round(float(rng.uniform(-side_m / 2, side_m / 2)), 2) for side_m in scene.ground.size_m
    )
    spec = replace(
        scene.objects[index],
        position_m=(x_m, y_m),
        yaw_deg=round(float(rng.uniform(-90.0, 90.0)), 1),
    )
    return PlacedObject(name=name, spec=spec, shape=scene.shape_of(spec.kind))


def _fits(scene: Scene, item: PlacedObject, placed: list[PlacedObject], gap_m: float) -> bool:
    at_m, reach_m = item.spec.position_m, _reach_m(item.shape)
    if any(
        math.dist(at_m, other.spec.position_m) < reach_m + _reach_m(other.shape) + gap_m
        for other in placed
    ):
        return False
    kept_free_m = [scene.start_m, *(pad.position_m for pad in scene.pads)]
    if min(math.dist(at_m, place_m) for place_m in kept_free_m) < reach_m + _FROM_PAD_M:
        return False
    if layout_problem(scene.helipad, scene.boxes, scene.ground, [item]) is not None:
        return False
    alone = replace(scene, boxes=(), objects=(item.spec,), movers=())
    return not scene.movers or traffic_problem(alone, scene.movers) is None


def _reach_m(shape: Shape) -> float:
    length_m, width_m, _ = shape.kind.size_m
    return length_m / 2 if shape.round else math.hypot(length_m, width_m) / 2


def varied_lamps(lighting: Lighting, rng: np.random.Generator) -> Lighting:
    """Return a light whose lamps and ambient share differ at random."""
    lamps = tuple(
        replace(lamp, brightness=round(float(lamp.brightness * rng.uniform(*_BRIGHTER)), 3))
        for lamp in lighting.lamps
    )
    return replace(lighting, ambient=round(float(rng.uniform(*_AMBIENTS)), 3), lamps=lamps)


def moving_kinds(scene: Scene) -> list[Shape]:
    """Return the kinds of the lab that move; none in a lab without kinds.

    Raises:
        ValueRangeError: the lab has kinds, and none moves.
    """
    shapes = scene.place.shapes.values()
    moving = [shape for shape in shapes if shape.kind.moves]
    if shapes and not moving:
        raise ValueRangeError(
            f"no kind of the lab '{scene.lab}' moves: give one 'moves: true' in its lab file"
        )
    return moving


def of_kind(mover: MoverSpec, shape: Shape) -> MoverSpec:
    """Return a random mover as one of a kind."""
    return replace(
        mover,
        kind=shape.name,
        pattern=MoverSpec.pattern,
        size_m=shape.kind.size_m,
        shape="cylinder" if shape.round else "box",
    )
