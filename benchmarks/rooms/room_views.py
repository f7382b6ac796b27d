"""Images of generated rooms with roles and depth, from cameras at many heights and pitches."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.segmentation.training.run import IGNORED
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.views import render_views
from uav_bt.errors import ValueRangeError
from uav_bt.lab.roles import GROUND, MARK, OBSTACLE, OUTSIDE
from uav_bt.lab.shipped import load_lab
from uav_bt.types.arrays import Image

IMAGE_PX: Final = (448, 252)
TRUTH_PX: Final = (224, 112)
HEIGHTS_M: Final = (0.5, 2.3)
PITCHES_DEG: Final = (-60.0, 5.0)
CLEAR_M: Final = 0.25  # between the camera and any surface
TRIES: Final = 20_000
# Ids of the network's roles: outside, ground, obstacle. A mark has no label.
ROLE_IDS: Final = {OUTSIDE: 0, GROUND: 1, OBSTACLE: 2, MARK: IGNORED}


@dataclass(frozen=True, kw_only=True, eq=False)
class RoomView:
    """One image of a room.

    Attributes:
        rgb: (H, W, 3) uint8.
        roles: (h, w) uint8; 0 outside, 1 ground, 2 obstacle, 255 without a label.
        depth_m: (h, w) float32, along the optical axis.
        pose: Pose of the camera.
    """

    rgb: Image
    roles: Image
    depth_m: NDArray[np.float32]
    pose: CameraPose


def draw_poses(scene: Scene, rng: np.random.Generator, count: int) -> list[CameraPose]:
    """Return camera poses that keep clear of walls and objects.

    Half of them are those of a flight: 1.0 to 1.7 m high, 20 to 35 degrees down.

    Args:
        scene: The room.
        rng: Source of the random numbers.
        count: Number of poses.

    Raises:
        ValueRangeError: The objects leave no room.
    """
    half = [side / 2 - CLEAR_M for side in scene.ground.size_m]
    poses: list[CameraPose] = []
    for _ in range(TRIES):
        if len(poses) == count:
            return poses
        usual = rng.random() < 0.5
        x, y = rng.uniform(-np.array(half), half)
        z = rng.uniform(1.0, 1.7) if usual else rng.uniform(*HEIGHTS_M)
        pitch = rng.uniform(-35.0, -20.0) if usual else rng.uniform(*PITCHES_DEG)
        if _is_free(scene, float(x), float(y), float(z)):
            poses.append(
                CameraPose(
                    x_m=float(x),
                    y_m=float(y),
                    z_m=float(z),
                    yaw_rad=float(rng.uniform(-math.pi, math.pi)),
                    pitch_rad=math.radians(float(pitch)),
                )
            )
    raise ValueRangeError(f"scene '{scene.name}': the objects leave no room for a camera")


def _is_free(scene: Scene, x_m: float, y_m: float, z_m: float) -> bool:
    return all(
        z_m > block.top_m + CLEAR_M
        or z_m < block.base_m - CLEAR_M
        or block.footprint.distance_m(x_m, y_m) > CLEAR_M
        for item in scene.placed
        for block in item.standing.blocks
    )


def draw_views(
    scene: Scene, count: int, seed: int, *, profile: str = "lab", level: bool = False
) -> Iterator[RoomView]:
    """Render a room from random poses; the same arguments give the same views.

    Args:
        scene: The room.
        count: Number of views.
        seed: Seed of poses, light and noise.
        profile: Source of blur, noise and exposure error.
        level: Whether all poses are those of a flight.
    """
    rng = np.random.default_rng(seed)
    poses = draw_poses(scene, rng, count)
    if level:
        poses = [
            replace(
                pose,
                z_m=max(pose.z_m, 1.0),
                pitch_rad=math.radians(float(rng.uniform(-32.0, -22.0))),
            )
            for pose in poses
        ]
    roles_of = np.full(256, IGNORED, np.uint8)
    for role, number in ROLE_IDS.items():
        for class_id in load_lab(scene.lab).classes.of_role(role):
            roles_of[class_id] = number
    for view in render_views(
        scene,
        poses,
        size_px=IMAGE_PX,
        truth_size_px=TRUTH_PX,
        profile=Profile.named(profile),
        vary_light=True,
        seed=seed,
    ):
        yield RoomView(rgb=view.image, roles=roles_of[view.ids], depth_m=view.depth, pose=view.pose)
