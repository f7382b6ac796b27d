"""Images of generated rooms with roles and depth, from cameras at many heights and pitches."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from enum import Enum
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.segmentation.training.run import IGNORED
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.views import render_views
from uav_bt.errors import ValueRangeError
from uav_bt.lab.classes import GROUND, MARK, OBSTACLE, OUTSIDE
from uav_bt.lab.shipped import load_lab
from uav_bt.types.arrays import Image

IMAGE_PX: Final = (448, 252)
TRUTH_PX: Final = (224, 112)
HEIGHTS_M: Final = (0.5, 2.3)
PITCHES_DEG: Final = (-60.0, 5.0)
FLIGHT_HEIGHTS_M: Final = (1.0, 1.7)
FLIGHT_PITCHES_DEG: Final = (-35.0, -20.0)
DOWN_HEIGHTS_M: Final = (0.3, 2.3)  # a landing is looked for from above, and flown down to 0.2 m
DOWN_PITCHES_DEG: Final = (-90.0, -60.0)
STRAIGHT_DOWN_DEG: Final = (-90.0, -85.0)  # of the views that `LandHere` uses
ABOVE_M: Final = (0.3, 1.0)  # above the top of furniture that fills the view
ABOVE_PITCHES_DEG: Final = (-90.0, -50.0)
FURNITURE_M: Final = (0.3, 1.3)  # height of such furniture
CLEAR_M: Final = 0.25  # between the camera and any surface
TRIES: Final = 20_000
# Ids of the network's roles: outside, ground, obstacle. A mark has no label.
ROLE_IDS: Final = {OUTSIDE: 0, GROUND: 1, OBSTACLE: 2, MARK: IGNORED}


class ViewKind(Enum):
    """Where the camera is and where it points."""

    MIXED = "mixed"  # half as in a flight, the others wide, steep, and close above furniture
    LEVEL = "level"  # as in a flight
    DOWN = "down"  # within 5 degrees of straight down, as before a landing


@dataclass(frozen=True, kw_only=True, eq=False)
class RoomView:
    """One image of a room."""

    rgb: Image
    roles: Image  # (h, w) uint8; 0 outside, 1 ground, 2 obstacle, 255 without a label
    depth_m: NDArray[np.float32]  # (h, w), along the optical axis
    pose: CameraPose


def draw_poses(
    scene: Scene, rng: np.random.Generator, count: int, kind: ViewKind = ViewKind.MIXED
) -> list[CameraPose]:
    """Return camera poses that keep clear of walls and objects."""
    poses: list[CameraPose] = []
    for _ in range(TRIES):
        if len(poses) == count:
            return poses
        x_m, y_m, z_m, pitch_deg = _PLACES[kind](scene, rng)
        if _is_free(scene, x_m, y_m, z_m):
            yaw_rad, pitch_rad = float(rng.uniform(-math.pi, math.pi)), math.radians(pitch_deg)
            poses.append(
                CameraPose(x_m=x_m, y_m=y_m, z_m=z_m, yaw_rad=yaw_rad, pitch_rad=pitch_rad)
            )
    raise ValueRangeError(f"scene '{scene.name}': the objects leave no room for a camera")


_Place = tuple[float, float, float, float]  # x, y and z in metres, pitch in degrees
_Range = tuple[float, float]


def _somewhere(
    scene: Scene, rng: np.random.Generator, heights_m: _Range, pitches_deg: _Range
) -> _Place:
    half = np.array(scene.ground.size_m) / 2 - CLEAR_M
    x_m, y_m = rng.uniform(-half, half).tolist()
    return x_m, y_m, float(rng.uniform(*heights_m)), float(rng.uniform(*pitches_deg))


def _level(scene: Scene, rng: np.random.Generator) -> _Place:
    if rng.random() < 0.5:
        return _somewhere(scene, rng, FLIGHT_HEIGHTS_M, FLIGHT_PITCHES_DEG)
    return _somewhere(scene, rng, HEIGHTS_M, PITCHES_DEG)


def _above_furniture(scene: Scene, rng: np.random.Generator) -> _Place:
    low, high = FURNITURE_M
    tops = [each for each in scene.ground_plan.standing if low <= each.height_m <= high]
    if not tops:
        return _somewhere(scene, rng, DOWN_HEIGHTS_M, DOWN_PITCHES_DEG)
    chosen = tops[int(rng.integers(len(tops)))]
    outline = chosen.footprint
    ahead, side = rng.uniform(-0.9, 0.9, 2)
    x_m, y_m = outline.to_world(float(ahead) * outline.half_x_m, float(side) * outline.half_y_m)
    z_m = chosen.height_m + float(rng.uniform(*ABOVE_M))
    return x_m, y_m, z_m, float(rng.uniform(*ABOVE_PITCHES_DEG))


def _mixed(scene: Scene, rng: np.random.Generator) -> _Place:
    share = rng.random()
    if share < 0.5:
        return _somewhere(scene, rng, FLIGHT_HEIGHTS_M, FLIGHT_PITCHES_DEG)
    if share < 0.72:
        return _somewhere(scene, rng, HEIGHTS_M, PITCHES_DEG)
    if share < 0.9:
        # Half of the steep views are those of a landing.
        straight = rng.random() < 0.5
        pitches_deg = STRAIGHT_DOWN_DEG if straight else DOWN_PITCHES_DEG
        return _somewhere(scene, rng, DOWN_HEIGHTS_M, pitches_deg)
    return _above_furniture(scene, rng)


_PLACES: Final[Mapping[ViewKind, Callable[[Scene, np.random.Generator], _Place]]] = {
    ViewKind.MIXED: _mixed,
    ViewKind.LEVEL: _level,
    ViewKind.DOWN: lambda scene, rng: _somewhere(scene, rng, DOWN_HEIGHTS_M, STRAIGHT_DOWN_DEG),
}


def _is_free(scene: Scene, x_m: float, y_m: float, z_m: float) -> bool:
    return all(
        z_m > block.top_m + CLEAR_M
        or z_m < block.base_m - CLEAR_M
        or block.footprint.distance_m(x_m, y_m) > CLEAR_M
        for standing in scene.ground_plan.standing
        for block in standing.blocks
    )


def _flown(rng: np.random.Generator) -> float:
    return math.radians(float(rng.uniform(-32.0, -22.0)))


def draw_views(
    scene: Scene, count: int, seed: int, *, kind: ViewKind = ViewKind.MIXED
) -> Iterator[RoomView]:
    """Render a room from random poses; the same arguments give the same views."""
    rng = np.random.default_rng(seed)
    poses = draw_poses(scene, rng, count, kind)
    if kind is ViewKind.LEVEL:
        poses = [replace(pose, z_m=max(pose.z_m, 1.0), pitch_rad=_flown(rng)) for pose in poses]
    roles_of = np.full(256, IGNORED, np.uint8)
    for role, number in ROLE_IDS.items():
        for class_id in load_lab(scene.lab).classes.of_role(role):
            roles_of[class_id] = number
    for view in render_views(
        scene,
        poses,
        size_px=IMAGE_PX,
        truth_size_px=TRUTH_PX,
        profile=Profile.named("lab"),
        vary_light=True,
        seed=seed,
    ):
        yield RoomView(rgb=view.image, roles=roles_of[view.ids], depth_m=view.depth, pose=view.pose)
