"""Images of the twin with ground truth, and scenes for training and testing."""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from sim_bridge.anafi import CAMERA_FORWARD_M, anafi_camera
from sim_bridge.twin.body import CONTROL_STEP_S, Motion
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.noise import child_seed
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.sensors import Sensors
from sim_bridge.twin.views import View, render_views, sample_flight_poses
from uav_bt.protocols import Advance, DepthEstimator, Segmenter, silent
from uav_bt.types import ClassMap, DepthMap, FlyingState, Frame
from uav_bt.types.arrays import Image

TRAINING_SCENES: Final = ("train-a", "train-b", "train-c", "train-d")
VALIDATION_SCENES: Final = ("val-a", "val-b")  # for selection and tuning
TESTING_SCENES: Final = ("test-a", "test-b")  # for reports, never for selection

_FACING_MARK: Final = 0.25  # share of images that face the mark


def scene_seed(seed: int, scene: Scene) -> int:
    """Return the seed of a scene's images, independent of other scenes in the plan."""
    return (seed << 32) + zlib.crc32(scene.name.encode())


@dataclass(frozen=True, kw_only=True)
class ViewPlan:
    """Plan of images of the twin."""

    scenes: tuple[str, ...] = TRAINING_SCENES  # names or files
    views: int = 60  # images per scene
    size_px: tuple[int, int] = (1152, 648)  # width and height, those of the teacher
    truth_size_px: tuple[int, int] | None = None  # size of the exact ids; None: as the images
    lowered: float = 0.0  # share with a lowered camera, as near the ground's edge
    seed: int = 0


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
            if generator.random() < _FACING_MARK and scene.helipad is not None
            else pose
            for pose in sample_flight_poses(scene, generator, plan.views, lowered=plan.lowered)
        ]
        views = render_views(
            scene,
            poses,
            size_px=plan.size_px,
            truth_size_px=plan.truth_size_px,
            profile=Profile.named("lab"),
            seed=seed,
        )
        for index, view in enumerate(views):
            yield f"{scene.name}-{index:05d}.png", view.image, view.ids


def _towards(
    pose: CameraPose, target_m: tuple[float, float], generator: np.random.Generator
) -> CameraPose:
    """Turn a drone about its centre towards a place, with an error of about 0.3 rad."""
    centre_x = pose.x_m - CAMERA_FORWARD_M * math.cos(pose.yaw_rad)
    centre_y = pose.y_m - CAMERA_FORWARD_M * math.sin(pose.yaw_rad)
    straight = math.atan2(target_m[1] - centre_y, target_m[0] - centre_x)
    yaw = straight + generator.normal(0.0, 0.3)
    x_m = centre_x + CAMERA_FORWARD_M * math.cos(yaw)
    y_m = centre_y + CAMERA_FORWARD_M * math.sin(yaw)
    return replace(pose, x_m=x_m, y_m=y_m, yaw_rad=yaw)


# --- depth as in flight ---------------------------------------------------------------------------
# Poses are sampled like those of a flight, without landings. One set of sensors passes through all
# images of a scene, 20 s apart, so that the altimeter's slow error and the noise of height and
# attitude are those of a flight. The body is tilted as in flight, which moves the lens. The twin's
# gimbal reports its pitch without error.

Masks = Literal["unet", "exact"]
"""Of the network, as in flight, or exact ones, to measure only the geometry."""

MAP_SIZE_PX: Final = (224, 112)  # size of class maps, and so of metric depth in flight
VIDEO: Final = anafi_camera(640, 360)

_MIN_PITCH_RAD: Final = -0.8  # steeper images are omitted: landings do not use depth
_APART_S: Final = 20.0  # between images: the altimeter's correlation time; no scale is kept
_AT_REST: Final = {"vx_mps": 0.0, "vy_mps": 0.0, "vz_mps": 0.0, "yaw_rate_radps": 0.0}
_TILT_STD_RAD: Final = 0.035  # in flight: 0.34 m/s2 of acceleration, wind and movements


@dataclass(frozen=True, kw_only=True)
class DepthViewPlan:
    """Plan of images for the measurement of depth."""

    scenes: tuple[str, ...] = VALIDATION_SCENES
    views: int = 40  # images per scene
    profile: str = "lab"  # source of noise, blur and exposure error
    seed: int = 11

    def poses(self, scene: Scene, seed: int) -> list[CameraPose]:
        """Return the camera poses in a scene."""
        drawn = sample_flight_poses(scene, np.random.default_rng(seed), 2 * self.views)
        return [pose for pose in drawn if pose.pitch_rad >= _MIN_PITCH_RAD][: self.views]


@dataclass(frozen=True, kw_only=True, eq=False)
class SampleImage:
    """A frame of a flight, the outputs of perception, and the ground truth at map size."""

    frame: Frame  # with every eighth pixel, enough to check that it is not black
    seen: ClassMap  # of the masks that were asked for
    relative: DepthMap | None  # None without a network
    exact: ClassMap
    depth_m: NDArray[np.float32]  # (112, 224) exact depth along the optical axis


def take_images(
    plan: DepthViewPlan,
    masks: Masks,
    segmenter: Segmenter,
    network: DepthEstimator | None,
    *,
    advance: Advance = silent,
) -> Iterator[SampleImage]:
    """Render the images of a plan; the same plan gives the same images."""
    profile = Profile.named(plan.profile)
    done, total = 0, plan.views * len(plan.scenes)
    for name in plan.scenes:
        scene = load_scene(name)
        seed = scene_seed(plan.seed, scene)
        start_z_m = max((pad.size_m[2] for pad in scene.pads), default=0.0)
        sensors = Sensors(profile, seed, start_z_m=start_z_m)
        tilts = np.random.default_rng(child_seed(seed, 31))
        poses = plan.poses(scene, seed)
        drawn = render_views(scene, poses, truth_size_px=MAP_SIZE_PX, profile=profile, seed=seed)
        for view in drawn:
            done += 1
            roll, pitch = tilts.normal(0.0, _TILT_STD_RAD, 2).tolist()
            frame = _frame(sensors, _motion(view.pose, roll, pitch), view, done)
            seen = segmenter.segment(frame)
            ids = np.ascontiguousarray(view.ids)
            exact = ClassMap(ids=ids, classes=seen.classes, captured_s=frame.captured_s)
            yield SampleImage(
                frame=replace(frame, image=frame.image[::8, ::8].copy()),
                seen=exact if masks == "exact" else seen,
                relative=None if network is None else network.estimate(frame),
                exact=exact,
                depth_m=view.depth,
            )
            advance("images", done, total)


def _motion(pose: CameraPose, roll_rad: float, pitch_rad: float) -> Motion:
    """Return the state of a hovering, tilted body whose lens is at a pose."""
    level_m = CAMERA_FORWARD_M * math.cos(pitch_rad)
    return Motion(
        x_m=pose.x_m - level_m * math.cos(pose.yaw_rad),
        y_m=pose.y_m - level_m * math.sin(pose.yaw_rad),
        z_m=pose.z_m - CAMERA_FORWARD_M * math.sin(pitch_rad),
        roll_rad=roll_rad,
        pitch_rad=pitch_rad,
        yaw_rad=pose.yaw_rad,
        **_AT_REST,
    )


def _frame(sensors: Sensors, motion: Motion, view: View, number: int) -> Frame:
    """Return a view as a frame with the telemetry of `_APART_S` after the last one."""
    for _ in range(round(_APART_S / CONTROL_STEP_S)):
        estimate = sensors.estimate(motion, airborne=True)
    sensed = sensors.telemetry(
        motion,
        estimate,
        surface_m=0.0,
        captured_s=number * _APART_S,
        flying=FlyingState.HOVERING,
        gimbal_pitch_rad=view.pose.pitch_rad,
    )
    return Frame(
        image=view.image,
        index=number,
        captured_s=sensed.captured_s,
        gimbal_pitch_rad=sensed.gimbal_pitch_rad,
        attitude=sensed.attitude,
        altitude_m=sensed.altitude_m,
        height_m=sensed.height_m,
        height_above_ground_m=sensed.height_above_ground_m,
    )
