"""Random variations of a scene: light, places of objects, movers and take-off pose."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Final

import numpy as np

from sim_bridge.anafi import ANAFI_AIRFRAME
from sim_bridge.twin.layout import MAX_MOVERS, LayoutError, leg_through, outside, overlaps
from sim_bridge.twin.movers import MoverSpec
from sim_bridge.twin.noise import child_seed
from sim_bridge.twin.objects import ObjectSpec, PlacedObject, object_names
from sim_bridge.twin.scene import Lighting, Scene
from sim_bridge.twin.shapes import PRINTED
from uav_bt.errors import ValueRangeError
from uav_bt.types import Pose

# Least distance between two objects (most gaps let the drone pass), and to mark and take-off point:
# of boxes in printed paper between centres, of the kinds of a lab between the circles around them.
_BOXES_APART_M: Final = 1.05
_BOX_FROM_PAD_M: Final = 0.95
_APART_M: Final = 0.75
_FROM_PAD_M: Final = 0.6
_FROM_EDGE_M: Final = 0.4  # least distance of a box's centre and of a path from the ground's edge
_SIDES_M: Final = (0.3, 0.5)
_HEIGHTS_M: Final = (0.6, 2.2)  # range of heights in the shipped scenes
_HIGH_SHARE: Final = 0.6  # share of boxes that reach the flight height, 1.5 m
_HIGH_M: Final = 1.5
_TRIES: Final = 16_000  # places of objects
_NARROWER: Final = 0.6  # factor of the gaps after every 4000 tries: a full hall
_NARROWED_EVERY: Final = 4000
_AMBIENTS: Final = (0.2, 0.5)
_BRIGHTER: Final = (0.6, 1.3)  # range of a lamp's brightness over its own
_MOVER_TRIES: Final = 4000
_MOVER_FROM_PAD_M: Final = 0.9  # least distance from the mark and take-off point
_MOVER_GAP_M: Final = 0.2  # free space between boxes beyond a mover's width
_PATH_M: Final = 1.0  # least length of a path
_START_FROM_M: Final = 0.5  # from the body's centre to the edge, the nearest object, or the mark
_START_TRIES: Final = 10_000


def _rounded(rng: np.random.Generator, low: float, high: float, digits: int = 2) -> float:
    return round(float(rng.uniform(low, high)), digits)


def varied_scene(scene: Scene, rng: np.random.Generator, *, name: str, layout: bool) -> Scene:
    """Return a scene with random light and, with `layout`, random places of its objects.

    `layout` also draws the sizes of boxes that are covered with printed paper.
    """
    objects = _moved(scene, rng) if layout else scene.objects
    return replace(scene, name=name, objects=objects, lighting=_varied_light(scene.lighting, rng))


def _varied_light(lighting: Lighting, rng: np.random.Generator) -> Lighting:
    """Return a random light without cast shadows; lamps keep their places."""
    if lighting.lamps:
        lamps = tuple(
            replace(lamp, brightness=round(lamp.brightness * rng.uniform(*_BRIGHTER), 3))
            for lamp in lighting.lamps
        )
        return replace(lighting, ambient=_rounded(rng, *_AMBIENTS, 3), lamps=lamps)
    azimuth = rng.uniform(0.0, 2.0 * math.pi)
    slant = rng.uniform(0.2, 0.9)
    x, y = slant * math.cos(azimuth), slant * math.sin(azimuth)
    return Lighting(ambient=_rounded(rng, 0.25, 0.6, 3), direction=(round(x, 3), round(y, 3), -1.0))


def _moved(scene: Scene, rng: np.random.Generator) -> tuple[ObjectSpec, ...]:
    """Return the objects of a scene at random places, as far apart as drone and paths need."""
    fixed = {item.name: item for item in scene.placed if item.at_wall is not None}
    placed = dict(fixed)
    wanted = dict(zip(object_names(scene.objects), scene.objects, strict=True))
    narrower = 1.0
    for number in range(1, _TRIES + 1):
        if len(placed) == len(wanted):
            break
        if number % _NARROWED_EVERY == 0:
            narrower *= _NARROWER
            placed = dict(fixed)
        name = next(each for each in wanted if each not in placed)
        spec = _drawn(scene, wanted[name], rng)
        item = PlacedObject(name=name, spec=spec, shape=scene.shape_of(spec))
        if _fits(scene, item, placed.values(), narrower):
            placed[name] = item
        elif rng.random() < 0.01:  # restart: the first objects may leave no space for the rest
            placed = dict(fixed)
    if len(placed) < len(wanted):
        raise ValueRangeError(f"no room for {len(wanted)} objects in scene '{scene.name}'")
    return tuple(placed[name].spec for name in wanted)


def _drawn(scene: Scene, spec: ObjectSpec, rng: np.random.Generator) -> ObjectSpec:
    """Return an object at a random place; a box in printed paper has another size, too."""
    printed = spec.is_printed
    high = printed and rng.random() < _HIGH_SHARE
    edge_m = _FROM_EDGE_M if printed else 0.0
    half_x, half_y = (side / 2 - edge_m for side in scene.ground.size_m)
    spec = replace(
        spec,
        position_m=(_rounded(rng, -half_x, half_x), _rounded(rng, -half_y, half_y)),
        yaw_deg=_rounded(rng, -90.0, 90.0),
    )
    if not printed:
        return spec
    heights = (_HIGH_M, _HEIGHTS_M[1]) if high else (_HEIGHTS_M[0], _HIGH_M)
    sides_m = _rounded(rng, *_SIDES_M), _rounded(rng, *_SIDES_M)
    return replace(spec, size_m=(*sides_m, _rounded(rng, *heights)))


def _fits(
    scene: Scene, item: PlacedObject, placed: Iterable[PlacedObject], narrower: float
) -> bool:
    printed, at_m = item.spec.is_printed, _place_m(item)
    apart_m = narrower * (_BOXES_APART_M if printed else _APART_M) + _reach_m(item)
    if any(math.dist(at_m, _place_m(other)) < apart_m + _reach_m(other) for other in placed):
        return False
    from_pad_m = (_BOX_FROM_PAD_M if printed else _FROM_PAD_M) + _reach_m(item)
    if min(math.dist(at_m, place_m) for place_m in _kept_free_m(scene)) < from_pad_m:
        return False
    if any(overlaps(item.standing, pad.standing) for pad in scene.pads):
        return False
    paths_free = all(leg_through(mover, item.footprint) is None for mover in scene.movers)
    return paths_free and outside(scene.ground, item.footprint) is None


def _place_m(item: PlacedObject) -> tuple[float, float]:
    return item.pose.x_m, item.pose.y_m


def _reach_m(item: PlacedObject) -> float:
    """Return the radius of the circle around an object; of a box distances count to its centre."""
    length_m, width_m, _ = item.shape.kind.size_m
    if item.spec.is_printed:
        return 0.0
    return length_m / 2 if item.footprint.round else math.hypot(length_m, width_m) / 2


def _kept_free_m(scene: Scene) -> list[tuple[float, float]]:
    """Return take-off point and mark."""
    return [scene.start_m, *(pad.position_m for pad in scene.pads)]


def varied(scene: Scene, seed: int, *, room: bool, movers: int) -> Scene:
    """Return a scene as a flight asks for it: a random room, and a number of random movers."""
    if room:
        rng = np.random.default_rng(child_seed(seed, 16))
        scene = varied_scene(scene, rng, name=scene.name, layout=True)
    return with_movers(scene, movers, seed) if movers else scene


def with_movers(scene: Scene, count: int, seed: int) -> Scene:
    """Return a scene with additional random people and carts.

    Their paths are straight, at least 1 m long, and away from objects, mark and take-off point.
    """
    own = len(scene.movers)
    if own + count > MAX_MOVERS:
        raise ValueRangeError(
            f"scene '{scene.name}' has {own} movers and takes at most {MAX_MOVERS - own} more, "
            f"got {count}"
        )
    rng = np.random.default_rng(child_seed(seed, 10))
    drawn: list[MoverSpec] = []
    kinds = _moving_kinds(scene)
    for _ in range(_MOVER_TRIES):
        if len(drawn) == count:
            break
        mover = _drawn_mover(scene, rng)
        if mover is None:
            continue
        if kinds:
            kind = kinds[int(rng.integers(len(kinds)))]
            mover = scene.of_its_kind(replace(mover, kind=kind, size_m=MoverSpec.size_m))
        if _has_room(scene, mover):
            drawn.append(mover)
    if len(drawn) < count:
        raise ValueRangeError(
            f"no room for {count} more movers between the objects of scene '{scene.name}', whose "
            f"ground is {scene.ground.size_m[0]:g} x {scene.ground.size_m[1]:g} m: ask for fewer"
        )
    return replace(scene, movers=(*scene.movers, *drawn))


def _has_room(scene: Scene, mover: MoverSpec) -> bool:
    """Return whether a mover may move there, with a gap between it and the objects."""
    length_m, width_m, height_m = mover.size_m
    wide_m = (length_m + _MOVER_GAP_M, width_m + _MOVER_GAP_M, height_m)
    try:
        scene.check_movers([replace(mover, size_m=wide_m, kind=None)])
    except LayoutError:
        return False
    return min(mover.distance_m(*at_m) for at_m in _kept_free_m(scene)) >= _MOVER_FROM_PAD_M


def _moving_kinds(scene: Scene) -> list[str]:
    """Return the kinds of the lab that move; none in a lab without kinds."""
    moving = [name for name, kind in scene.room.objects.items() if kind.moves]
    if scene.room.objects and not moving:
        raise ValueRangeError(
            f"no kind of the lab '{scene.lab}' moves: give one 'moves: true' in its lab file"
        )
    return moving


def _drawn_mover(scene: Scene, rng: np.random.Generator) -> MoverSpec | None:
    half_x, half_y = (side / 2 - _FROM_EDGE_M for side in scene.ground.size_m)
    ends = [(_rounded(rng, -half_x, half_x), _rounded(rng, -half_y, half_y)) for _ in range(2)]
    person, pauses = rng.random() < 0.6, rng.random() < 0.5
    papers = sum(kind.startswith(PRINTED) for kind in scene.place.shapes)
    height_m, pattern = _rounded(rng, 0.7, 1.6), int(rng.integers(1, papers + 1))
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
    """Return the pose of the body at its take-off point, which the seed draws if it is random."""
    if scene.take_off.random:
        return _random_pose(scene, seed)
    return _standing(scene, *scene.start_m, math.radians(scene.take_off.yaw_deg))


def _standing(scene: Scene, x_m: float, y_m: float, yaw_rad: float) -> Pose:
    z = scene.surface_m(x_m, y_m) + ANAFI_AIRFRAME.body_size_m[2] / 2
    return Pose(x_m=x_m, y_m=y_m, z_m=z, yaw_rad=yaw_rad)


def _random_pose(scene: Scene, seed: int) -> Pose:
    generator = np.random.default_rng(child_seed(seed, 6))
    away = [
        *(item.footprint.distance_m for item in scene.standing.values()),
        *(mover.distance_m for mover in scene.movers),
    ]
    half_x, half_y = (side / 2 - _START_FROM_M for side in scene.ground.size_m)
    for _ in range(_START_TRIES):
        x, y = float(generator.uniform(-half_x, half_x)), float(generator.uniform(-half_y, half_y))
        if scene.ground.outline_m and scene.ground.margin_m(x, y) < _START_FROM_M:
            continue
        if all(each(x, y) >= _START_FROM_M for each in away):
            return _standing(scene, x, y, float(generator.uniform(-math.pi, math.pi)))
    raise ValueRangeError(
        f"scene '{scene.name}': no free ground for a random take-off; remove or move an object"
    )
