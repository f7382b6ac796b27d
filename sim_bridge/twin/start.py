"""Where a flight begins: on the pad, at a given place, or somewhere drawn from the seed."""

from __future__ import annotations

import math

import numpy as np

from sim_bridge.twin.model import HULL_HALF_M
from sim_bridge.twin.noise import child_seed
from sim_bridge.twin.scene import CARPET_SIZE_M, Scene
from uav_bt.errors import ValueRangeError
from uav_bt.types import Pose

_EDGE_M = 0.5  # from the carpet's edge
_BOX_M = 0.5  # from the body's centre to the nearest box or pad
_TRIES = 10_000


def start_pose(scene: Scene, seed: int) -> Pose:
    """Return the body's pose when it stands at its take-off point.

    Args:
        scene: the lab.
        seed: the flight's seed, used when the scene asks for a random place.

    Raises:
        ValueRangeError: the boxes leave no room for a random start.
    """
    if scene.take_off.random:
        return _random_pose(scene, seed)
    x, y = scene.take_off.position_m or scene.helipad.position_m
    return _standing(scene, x, y, math.radians(scene.take_off.yaw_deg))


def _standing(scene: Scene, x_m: float, y_m: float, yaw_rad: float) -> Pose:
    z = scene.surface_m(x_m, y_m) + HULL_HALF_M[2]
    return Pose(x_m=x_m, y_m=y_m, z_m=z, yaw_rad=yaw_rad)


def _random_pose(scene: Scene, seed: int) -> Pose:
    generator = np.random.default_rng(child_seed(seed, 6))
    taken = [box.footprint for box in scene.boxes] + [scene.helipad.footprint]
    half_x, half_y = CARPET_SIZE_M[0] / 2 - _EDGE_M, CARPET_SIZE_M[1] / 2 - _EDGE_M
    for _ in range(_TRIES):
        x, y = float(generator.uniform(-half_x, half_x)), float(generator.uniform(-half_y, half_y))
        if all(footprint.distance_m(x, y) >= _BOX_M for footprint in taken):
            return _standing(scene, x, y, float(generator.uniform(-math.pi, math.pi)))
    raise ValueRangeError(
        f"scene '{scene.name}': no free carpet for a random take-off; remove or move a box"
    )
