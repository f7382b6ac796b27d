"""Images of the twin with telemetry, ground truth, and outputs of the networks.

The poses are sampled like those of a flight, without landings. One set of sensors passes through
all images of a scene, 20 s apart, so that the altimeter's slow error and the noise of height and
attitude are those of a flight. The body is tilted as in flight, which moves the lens. The twin's
gimbal reports its pitch without error.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from sim_bridge.anafi import CAMERA_FORWARD_M, anafi_camera
from sim_bridge.twin.body import CONTROL_STEP_S, Motion
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.noise import child_seed
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.sensors import Sensors
from sim_bridge.twin.views import render_views
from uav_bt.learning.views import DepthViewPlan, scene_seed
from uav_bt.progress import Advance, silent
from uav_bt.protocols import DepthEstimator, Segmenter
from uav_bt.types import ClassMap, DepthMap, Frame
from uav_bt.types.arrays import Image

Masks = Literal["unet", "exact"]
"""Of the network, as in flight, or exact ones, to measure only the geometry."""

MAP_SIZE_PX: Final = (224, 112)  # size of class maps, and so of metric depth in flight
VIDEO: Final = anafi_camera(640, 360)
MAP_CAMERA: Final = VIDEO.resized(*MAP_SIZE_PX)

_APART_S: Final = 20.0  # between images: the altimeter's correlation time; no scale is kept
_TILT_STD_RAD: Final = 0.035  # in flight: 0.34 m/s2 of acceleration, wind and movements


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
        poses = plan.poses(scene, seed)
        start_z_m = max((pad.size_m[2] for pad in scene.pads), default=0.0)
        telemetry = _telemetry(profile, seed, start_z_m)
        drawn = render_views(scene, poses, truth_size_px=MAP_SIZE_PX, profile=profile, seed=seed)
        for view in drawn:
            done += 1
            frame = telemetry(view.pose, view.image, done)
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


def _telemetry(
    profile: Profile, seed: int, start_z_m: float
) -> Callable[[CameraPose, Image, int], Frame]:
    """Return a function from pose, image and number to a frame, with one flight's sensors."""
    sensors = Sensors(profile, seed, start_z_m=start_z_m)
    tilts = np.random.default_rng(child_seed(seed, 31))

    def frame_of(pose: CameraPose, image: Image, number: int) -> Frame:
        roll, pitch = (float(tilt) for tilt in tilts.normal(0.0, _TILT_STD_RAD, 2))
        level_m = CAMERA_FORWARD_M * math.cos(pitch)
        motion = Motion(
            x_m=pose.x_m - level_m * math.cos(pose.yaw_rad),
            y_m=pose.y_m - level_m * math.sin(pose.yaw_rad),
            z_m=pose.z_m - CAMERA_FORWARD_M * math.sin(pitch),
            vx_mps=0.0,
            vy_mps=0.0,
            vz_mps=0.0,
            roll_rad=roll,
            pitch_rad=pitch,
            yaw_rad=pose.yaw_rad,
            yaw_rate_radps=0.0,
        )
        for _ in range(round(_APART_S / CONTROL_STEP_S)):
            estimate = sensors.estimate(motion, airborne=True)
        sensed = sensors.telemetry(motion, estimate, surface_m=0.0)
        return Frame(
            image=image,
            index=number,
            captured_s=number * _APART_S,
            gimbal_pitch_rad=pose.pitch_rad,
            attitude=sensed.attitude,
            altitude_m=sensed.altitude_m,
            height_m=sensed.height_m,
            height_above_ground_m=sensed.height_above_ground_m,
        )

    return frame_of
