"""Pictures of the twin with their exact class ids."""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import ValueRangeError
from uav_bt.learning.scenes import TRAINING_SCENES

Image = NDArray[np.uint8]


@dataclass(frozen=True, kw_only=True)
class ViewPlan:
    """Which pictures of the twin are taken."""

    scenes: tuple[str, ...] = TRAINING_SCENES  # names or files
    views: int = 60  # pictures a scene
    size_px: tuple[int, int] = (1152, 648)  # width and height; the teacher's
    truth_size_px: tuple[int, int] | None = None  # of the exact ids; the pictures' when None
    profile: str = "lab"  # whose noise, blur and exposure error the pictures get
    facing_pad: float = 0.25  # share that looks towards the helipad, which a random yaw rarely does
    seed: int = 0

    def __post_init__(self) -> None:
        if not self.scenes or self.views < 1:
            raise ValueRangeError(
                f"pictures need a scene and a positive count, got {self.scenes}, {self.views}"
            )
        if not 0.0 <= self.facing_pad <= 1.0:
            raise ValueRangeError(f"facing_pad must lie within 0 and 1, got {self.facing_pad}")


def twin_views(plan: ViewPlan) -> Iterator[tuple[str, Image, Image]]:
    """Take the pictures of a plan; the same plan gives the same pictures.

    Yields:
        A file name, the picture (H, W, 3) RGB, and its exact class ids (h, w).

    Raises:
        SceneError: a scene is missing or malformed.
        MissingDependencyError: OpenGL does not work here.
    """
    # Imported here: reading picks or training from photographs needs no simulator.
    from sim_bridge.twin.profile import Profile  # noqa: PLC0415
    from sim_bridge.twin.scene_file import load_scene  # noqa: PLC0415
    from sim_bridge.twin.views import render_views, sample_flight_poses  # noqa: PLC0415

    for name in plan.scenes:
        scene = load_scene(name)
        # By name, so that a scene's pictures do not depend on which others are in the plan.
        seed = (plan.seed << 32) + zlib.crc32(scene.name.encode())
        generator = np.random.default_rng(seed)
        poses = [
            _towards(pose, scene.helipad.position_m, generator)
            if generator.random() < plan.facing_pad
            else pose
            for pose in sample_flight_poses(scene, generator, plan.views)
        ]
        views = render_views(
            scene,
            poses,
            size_px=plan.size_px,
            truth_size_px=plan.truth_size_px,
            profile=Profile.named(plan.profile),
            seed=seed,
        )
        for index, view in enumerate(views):
            yield f"{scene.name}-{index:05d}.png", view.image, view.ids


def _towards(pose: Any, target_m: tuple[float, float], generator: np.random.Generator) -> Any:
    from sim_bridge.anafi import CAMERA_FORWARD_M  # noqa: PLC0415

    centre_x = pose.x_m - CAMERA_FORWARD_M * math.cos(pose.yaw_rad)
    centre_y = pose.y_m - CAMERA_FORWARD_M * math.sin(pose.yaw_rad)
    straight = math.atan2(target_m[1] - centre_y, target_m[0] - centre_x)
    yaw = straight + generator.normal(0.0, 0.3)
    return replace(
        pose,
        x_m=centre_x + CAMERA_FORWARD_M * math.cos(yaw),
        y_m=centre_y + CAMERA_FORWARD_M * math.sin(yaw),
        yaw_rad=yaw,
    )
