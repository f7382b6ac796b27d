"""Images of the twin with ground truth, and the split of scenes for training and testing."""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.camera.ground_plane import CameraView, ground_depth
from perception.depth.training.footage import LABEL_SIZE_PX, shrink
from sim_bridge.anafi import CAMERA_FORWARD_M, anafi_camera
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.views import render_views, sample_flight_poses
from uav_bt.errors import ValueRangeError
from uav_bt.types.arrays import Image

TRAINING_SCENES: Final = ("train-a", "train-b", "train-c", "train-d")
VALIDATION_SCENES: Final = ("val-a", "val-b")  # for selection and tuning
TESTING_SCENES: Final = ("test-a", "test-b")  # for reports, never for selection


def scene_seed(seed: int, scene: Scene) -> int:
    """Return the seed of a scene's images, independent of other scenes in the plan."""
    return (seed << 32) + zlib.crc32(scene.name.encode())


# --- class ids ------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class ViewPlan:
    """Plan of images of the twin."""

    scenes: tuple[str, ...] = TRAINING_SCENES  # names or files
    views: int = 60  # images per scene
    size_px: tuple[int, int] = (1152, 648)  # width and height, those of the teacher
    truth_size_px: tuple[int, int] | None = None  # size of the exact ids; None: as the images
    profile: str = "lab"  # source of noise, blur and exposure error
    facing_pad: float = 0.25  # share that faces the mark, which is rare with a random yaw
    lowered: float = 0.0  # share with a lowered camera, as near the ground's edge
    seed: int = 0

    def __post_init__(self) -> None:
        if not self.scenes or self.views < 1:
            raise ValueRangeError(
                f"images need a scene and a positive count, got {self.scenes}, {self.views}"
            )
        for name in ("facing_pad", "lowered"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueRangeError(f"{name} must lie within 0 and 1, got {getattr(self, name)}")


def twin_views(plan: ViewPlan) -> Iterator[tuple[str, Image, Image]]:
    """Render the images of a plan; the same plan gives the same images.

    Yields:
        A file name, the image (H, W, 3) RGB, and the exact class ids (h, w).
    """
    for name in plan.scenes:
        scene = load_scene(name)
        seed = scene_seed(plan.seed, scene)
        generator = np.random.default_rng(seed)
        poses = [
            _towards(pose, scene.helipad.position_m, generator)
            if generator.random() < plan.facing_pad and scene.helipad is not None
            else pose
            for pose in sample_flight_poses(scene, generator, plan.views, lowered=plan.lowered)
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


def _towards(
    pose: CameraPose, target_m: tuple[float, float], generator: np.random.Generator
) -> CameraPose:
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


# --- depth ----------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class DepthViewPlan:
    """Plan of images for the measurement of depth."""

    scenes: tuple[str, ...] = VALIDATION_SCENES
    views: int = 40  # images per scene
    profile: str = "lab"  # source of noise, blur and exposure error
    min_pitch_rad: float = -0.8  # steeper images are omitted: landings do not use depth
    seed: int = 11

    def poses(self, scene: Scene, seed: int) -> list[CameraPose]:
        """Return the camera poses in a scene."""
        drawn = sample_flight_poses(scene, np.random.default_rng(seed), 2 * self.views)
        return [pose for pose in drawn if pose.pitch_rad >= self.min_pitch_rad][: self.views]


@dataclass(frozen=True, kw_only=True, eq=False)
class DepthViews:
    """Images with exact depth, ids and ground plane at the output size of the network."""

    rgb: Image  # (N, 256, 320, 3)
    depth_m: NDArray[np.float32]  # (N, 128, 160)
    ids: Image  # (N, 128, 160)
    ground_m: NDArray[np.float32]  # (N, 128, 160)


def depth_views(plan: DepthViewPlan) -> DepthViews:
    """Render the images of a plan; the same plan gives the same images."""
    camera = anafi_camera(640, 360).resized(*LABEL_SIZE_PX)
    images, depths, ids, grounds = [], [], [], []
    for name in plan.scenes:
        scene = load_scene(name)
        seed = scene_seed(plan.seed, scene)
        for view in render_views(
            scene,
            plan.poses(scene, seed),
            truth_size_px=LABEL_SIZE_PX,
            profile=Profile.named(plan.profile),
            seed=seed,
        ):
            images.append(shrink(view.image))
            depths.append(view.depth)
            ids.append(view.ids)
            level = CameraView(camera=camera, pitch_rad=view.pose.pitch_rad, height_m=view.pose.z_m)
            grounds.append(ground_depth(level))
    return DepthViews(
        rgb=np.stack(images),
        depth_m=np.stack(depths),
        ids=np.stack(ids),
        ground_m=np.stack(grounds).astype(np.float32),
    )
