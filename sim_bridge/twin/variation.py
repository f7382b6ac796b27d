"""Random variations of a scene: light, boxes, movers and take-off pose."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from sim_bridge.anafi import ANAFI_AIRFRAME
from sim_bridge.twin.layout import layout_problem
from sim_bridge.twin.movers import PATTERN_COUNT, MoverSpec
from sim_bridge.twin.noise import child_seed
from sim_bridge.twin.object_variation import moved_objects, moving_kinds, of_kind, varied_lamps
from sim_bridge.twin.objects import BoxSpec
from sim_bridge.twin.scene import MAX_MOVERS, Lighting, Scene, traffic_problem
from uav_bt.errors import ValueRangeError
from uav_bt.types import Pose

_FROM_EDGE_M: Final = 0.4  # least distance of a box's centre from the ground's edge
# Least distance between the centres of two boxes (most gaps let the drone pass), and to the pad.
_APART_M: Final = 1.05
_FROM_PAD_M: Final = 0.95
_SIDES_M: Final = (0.3, 0.5)
_HEIGHTS_M: Final = (0.6, 2.2)  # range of heights in the shipped scenes
_HIGH_SHARE: Final = 0.6  # share of boxes that reach the flight height, 1.5 m
_HIGH_M: Final = 1.5
_TRIES: Final = 4000  # number of boxes to try
_MOVER_FROM_EDGE_M: Final = 0.4  # least distance of a path from the ground's edge
_MOVER_FROM_PAD_M: Final = 0.9  # least distance from the mark and take-off point
_MOVER_GAP_M: Final = 0.2  # free space between boxes beyond a mover's width
_PATH_M: Final = 1.0  # least length of a path
_START_FROM_EDGE_M: Final = 0.5
_START_FROM_BOX_M: Final = 0.5  # from the body's centre to the nearest box or pad
_START_TRIES: Final = 10_000


def varied_light(rng: np.random.Generator) -> Lighting:
    """Return a random light without cast shadows, which take 10 ms per frame."""
    azimuth = rng.uniform(0.0, 2.0 * math.pi)
    slant = rng.uniform(0.2, 0.9)
    return Lighting(
        ambient=round(float(rng.uniform(0.25, 0.6)), 3),
        direction=(
            round(slant * math.cos(azimuth), 3),
            round(slant * math.sin(azimuth), 3),
            -1.0,
        ),
    )


def varied_scene(scene: Scene, rng: np.random.Generator, *, name: str, layout: bool) -> Scene:
    """Return a scene with random light and, if asked, random places and sizes of its boxes.

    Args:
        scene: the original scene; mark and patterns are kept.
        rng: source of the random numbers.
        name: name of the new scene.
        layout: whether to move and resize the boxes.

    Raises:
        ValueRangeError: no arrangement of the boxes was found.
    """
    boxes = _placed(scene, rng) if layout else scene.boxes
    light = varied_light(rng)
    if not scene.objects and not scene.lighting.lamps:
        return replace(scene, name=name, boxes=boxes, lighting=light)
    if scene.lighting.lamps:
        light = varied_lamps(scene.lighting, rng)
    objects = moved_objects(replace(scene, boxes=boxes), rng) if layout else scene.objects
    return replace(scene, name=name, boxes=boxes, objects=objects, lighting=light)


def _placed(scene: Scene, rng: np.random.Generator) -> tuple[BoxSpec, ...]:
    placed: list[BoxSpec] = []
    for _ in range(_TRIES):
        if len(placed) == len(scene.boxes):
            return tuple(placed)
        box = _drawn(scene, scene.boxes[len(placed)].pattern, rng)
        if _fits(box, placed, scene):
            placed.append(box)
        elif rng.random() < 0.01:  # restart: the first boxes may leave no space for the rest
            placed.clear()
    raise ValueRangeError(f"no room for {len(scene.boxes)} boxes in scene '{scene.name}'")


def _drawn(scene: Scene, pattern: int, rng: np.random.Generator) -> BoxSpec:
    high = rng.random() < _HIGH_SHARE
    heights = (_HIGH_M, _HEIGHTS_M[1]) if high else (_HEIGHTS_M[0], _HIGH_M)
    across, along = (side / 2 - _FROM_EDGE_M for side in scene.ground.size_m)
    return BoxSpec(
        pattern=pattern,
        position_m=(_rounded(rng, -across, across), _rounded(rng, -along, along)),
        yaw_deg=_rounded(rng, -90.0, 90.0),
        size_m=(_rounded(rng, *_SIDES_M), _rounded(rng, *_SIDES_M), _rounded(rng, *heights)),
    )


def _rounded(rng: np.random.Generator, low: float, high: float) -> float:
    return round(float(rng.uniform(low, high)), 2)


def _fits(box: BoxSpec, placed: list[BoxSpec], scene: Scene) -> bool:
    apart = all(math.dist(box.position_m, other.position_m) >= _APART_M for other in placed)
    kept_free_m = [scene.start_m, *(pad.position_m for pad in scene.pads)]
    if not apart or min(math.dist(box.position_m, at_m) for at_m in kept_free_m) < _FROM_PAD_M:
        return False
    if layout_problem(scene.helipad, (*placed, box), scene.ground) is not None:
        return False
    return traffic_problem(replace(scene, boxes=(box,), movers=()), scene.movers) is None


def varied(scene: Scene, seed: int, *, room: bool, movers: int) -> Scene:
    """Return a scene with the variations that a flight asks for.

    Args:
        scene: the original scene.
        seed: seed of the flight.
        room: whether the boxes' places and sizes, and the light, are random.
        movers: number of random movers to add.

    Raises:
        ValueRangeError: there is no space for the objects or the movers.
    """
    if room:
        rng = np.random.default_rng(child_seed(seed, 16))
        scene = varied_scene(scene, rng, name=scene.name, layout=True)
    return with_movers(scene, movers, seed) if movers else scene


def with_movers(scene: Scene, count: int, seed: int) -> Scene:
    """Return a scene with additional random people and carts.

    Their paths are straight, at least 1 m long, and away from boxes, mark and take-off point.

    Args:
        scene: the lab.
        count: number of movers to add.
        seed: seed of the flight.

    Raises:
        ValueRangeError: the scene has too many movers, or the boxes leave no space for them.
    """
    own = len(scene.movers)
    if own + count > MAX_MOVERS:
        raise ValueRangeError(
            f"scene '{scene.name}' has {own} movers and takes at most {MAX_MOVERS - own} more, "
            f"got {count}"
        )
    rng = np.random.default_rng(child_seed(seed, 10))
    kept_free_m = [scene.start_m, *(pad.position_m for pad in scene.pads)]
    drawn: list[MoverSpec] = []
    kinds = moving_kinds(scene)
    for _ in range(_TRIES):
        if len(drawn) == count:
            return replace(scene, movers=(*scene.movers, *drawn))
        mover = _drawn_mover(scene, rng)
        if mover is None:
            continue
        if kinds:
            mover = of_kind(mover, kinds[int(rng.integers(len(kinds)))])
        across, along, height = mover.size_m
        wide_m = (across + _MOVER_GAP_M, along + _MOVER_GAP_M, height)
        wide = replace(mover, size_m=wide_m, kind=None)
        near_m = min(mover.distance_m(*place) for place in kept_free_m)
        if near_m >= _MOVER_FROM_PAD_M and traffic_problem(scene, [wide]) is None:
            drawn.append(mover)
    raise ValueRangeError(
        f"no room for {count} more movers between the objects of scene '{scene.name}', whose "
        f"ground is {scene.ground.size_m[0]:g} x {scene.ground.size_m[1]:g} m: ask for fewer"
    )


def _drawn_mover(scene: Scene, rng: np.random.Generator) -> MoverSpec | None:
    half_x, half_y = (side / 2 - _MOVER_FROM_EDGE_M for side in scene.ground.size_m)
    ends = [(_rounded(rng, -half_x, half_x), _rounded(rng, -half_y, half_y)) for _ in range(2)]
    person, pauses = rng.random() < 0.6, rng.random() < 0.5
    height_m, pattern = _rounded(rng, 0.7, 1.6), int(rng.integers(1, PATTERN_COUNT + 1))
    speed_mps, yaw_deg = _rounded(rng, 0.2, 0.8), _rounded(rng, -90.0, 90.0)
    if math.dist(*ends) < _PATH_M:
        return None
    return MoverSpec(
        path_m=tuple(ends),
        speed_mps=speed_mps,
        shape="cylinder" if person else "box",
        pattern=pattern,
        size_m=(0.4, 0.4, 1.7) if person else (0.5, 0.35, height_m),
        yaw_deg=0.0 if person else yaw_deg,
        pauses_s=(0.5, 4.0) if pauses else None,
    )


def start_pose(scene: Scene, seed: int) -> Pose:
    """Return the pose of the body at its take-off point.

    Args:
        scene: the lab.
        seed: seed of the flight, used if the take-off point is random.

    Raises:
        ValueRangeError: the boxes leave no space for a random take-off point.
    """
    if scene.take_off.random:
        return _random_pose(scene, seed)
    return _standing(scene, *scene.start_m, math.radians(scene.take_off.yaw_deg))


def _standing(scene: Scene, x_m: float, y_m: float, yaw_rad: float) -> Pose:
    z = scene.surface_m(x_m, y_m) + ANAFI_AIRFRAME.body_size_m[2] / 2
    return Pose(x_m=x_m, y_m=y_m, z_m=z, yaw_rad=yaw_rad)


def _random_pose(scene: Scene, seed: int) -> Pose:
    generator = np.random.default_rng(child_seed(seed, 6))
    away = [
        *(box.footprint.distance_m for box in scene.boxes),
        *(item.footprint.distance_m for item in scene.placed),
        *(pad.footprint.distance_m for pad in scene.pads),
        *(mover.distance_m for mover in scene.movers),
    ]
    half_x, half_y = (side / 2 - _START_FROM_EDGE_M for side in scene.ground.size_m)
    plan = scene.ground.plan
    for _ in range(_START_TRIES):
        x, y = float(generator.uniform(-half_x, half_x)), float(generator.uniform(-half_y, half_y))
        if plan.outline_m and plan.margin_m(x, y) < _START_FROM_EDGE_M:
            continue
        if all(each(x, y) >= _START_FROM_BOX_M for each in away):
            return _standing(scene, x, y, float(generator.uniform(-math.pi, math.pi)))
    raise ValueRangeError(
        f"scene '{scene.name}': no free ground for a random take-off; remove or move an object"
    )
