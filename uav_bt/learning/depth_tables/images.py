"""Images of the twin with telemetry, ground truth, and outputs of the networks.

The poses are sampled like those of a flight (`sim_bridge.twin.views.sample_flight_poses`), without
landings. The telemetry comes from the sensors of the profile. One set of sensors passes through all
images of a scene, 20 s apart, so that the altimeter's slow error and the noise of height and
attitude are those of a flight. The body is tilted as in flight, which moves the lens. The twin's
gimbal reports its pitch without error; one of the tables shows the effect of such an error.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from perception.camera.ground_plane import CameraView
from sim_bridge.anafi import CAMERA_FORWARD_M, anafi_camera
from sim_bridge.twin.body import CONTROL_STEP_S, Motion
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.noise import child_seed
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.sensors import Sensors
from sim_bridge.twin.views import View, render_views
from uav_bt.errors import UnknownNameError, ValueRangeError
from uav_bt.learning.views import TESTING_SCENES, DepthViewPlan, scene_seed
from uav_bt.progress import Advance, silent
from uav_bt.protocols import DepthEstimator, Segmenter
from uav_bt.types import CameraModel, ClassMap, DepthMap, Frame
from uav_bt.types.arrays import Image

Masks = Literal["unet", "exact"]
MASKS: Final[tuple[Masks, ...]] = ("unet", "exact")
MAP_SIZE_PX: Final = (224, 112)  # size of class maps, and so of metric depth in flight

_APART_S = 20.0  # time between images: the altimeter's correlation time; no scale is kept
_TILT_STD_RAD = 0.035  # tilt in flight: 0.34 m/s2 of acceleration, wind and movements


@dataclass(frozen=True, kw_only=True)
class ImagePlan:
    """Images and masks for the measurement of depth."""

    # A third of the images look past the boxes; this number shows more than the paper's 661 edges.
    views: DepthViewPlan = field(
        default_factory=lambda: DepthViewPlan(scenes=TESTING_SCENES, views=170, seed=21)
    )
    masks: Masks = "unet"  # as in flight; "exact" measures only the geometry

    def __post_init__(self) -> None:
        if self.masks not in MASKS:
            raise UnknownNameError("masks", self.masks, MASKS)
        if not self.views.scenes or self.views.views < 1:
            raise ValueRangeError(
                "images need a scene and a positive count, got "
                f"{self.views.scenes}, {self.views.views}"
            )


@dataclass(frozen=True, kw_only=True, eq=False)
class SampleImage:
    """A frame of a flight, the outputs of perception, and the ground truth at map size."""

    frame: Frame  # with every eighth pixel, enough to check that it is not black
    video: CameraModel  # intrinsics at the size of the video
    camera: CameraModel  # intrinsics at map size
    masks: dict[Masks, ClassMap]
    relative: DepthMap | None  # None without a network
    ids: NDArray[np.uint8]  # (112, 224) exact class ids
    depth_m: NDArray[np.float32]  # (112, 224) exact depth along the optical axis
    truth: CameraView  # true pose of the lens

    @property
    def exact(self) -> ClassMap:
        """The exact class map."""
        classes = next(iter(self.masks.values())).classes
        return ClassMap(ids=self.ids, classes=classes, captured_s=self.frame.captured_s)


def take_images(
    plan: ImagePlan,
    segmenter: Segmenter,
    network: DepthEstimator | None,
    *,
    advance: Advance = silent,
) -> Iterator[SampleImage]:
    """Render the images of a plan; the same plan gives the same images.

    Args:
        plan: the images.
        segmenter: source of the masks in flight.
        network: source of relative depth; None for methods without a network.
        advance: called after each image.

    Raises:
        SceneError: a scene is missing or malformed.
        MissingDependencyError: OpenGL does not work here.
    """
    views, profile = plan.views, Profile.named(plan.views.profile)
    total = views.views * len(views.scenes)
    video = anafi_camera(640, 360)
    done = 0
    for name in views.scenes:
        scene = load_scene(name)
        seed = scene_seed(views.seed, scene)
        poses = views.poses(scene, seed)
        start_z_m = max((pad.size_m[2] for pad in scene.pads), default=0.0)
        telemetry = _telemetry(profile, seed, start_z_m)
        drawn = render_views(scene, poses, truth_size_px=MAP_SIZE_PX, profile=profile, seed=seed)
        for view in drawn:
            done += 1
            frame = telemetry(view.pose, view.image, done)
            yield _perceived(view, frame, video, segmenter, network)
            advance("images", done, total)


def _perceived(
    view: View,
    frame: Frame,
    video: CameraModel,
    segmenter: Segmenter,
    network: DepthEstimator | None,
) -> SampleImage:
    seen = segmenter.segment(frame)
    if seen.ids.shape != MAP_SIZE_PX[::-1]:
        raise ValueRangeError(
            f"depth is measured at {MAP_SIZE_PX[0]}x{MAP_SIZE_PX[1]} pixels; the masks are "
            f"{seen.ids.shape[1]}x{seen.ids.shape[0]}"
        )
    camera = video.resized(*MAP_SIZE_PX)
    exact = ClassMap(
        ids=np.ascontiguousarray(view.ids), classes=seen.classes, captured_s=frame.captured_s
    )
    return SampleImage(
        frame=replace(frame, image=frame.image[::8, ::8].copy()),
        video=video,
        camera=camera,
        masks={"unet": seen, "exact": exact},
        relative=None if network is None else network.estimate(frame),
        ids=exact.ids,
        depth_m=view.depth,
        truth=CameraView(camera=camera, pitch_rad=view.pose.pitch_rad, height_m=view.pose.z_m),
    )


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
