"""Images of the twin with the telemetry of a flight, their truth, and what networks see in them.

The places are drawn like those of a flight (`sim_bridge.twin.views.sample_flight_poses`), landings
left out. The telemetry is what the profile's own sensors report there: one set of sensors is flown
through all images of a scene, twenty seconds apart, so that the altimeter's slow error and the
noise of height and attitude are those of a flight; the body is tilted as a flying one, which moves
the lens. The twin's gimbal reports its pitch without error, so here it has none; what an error of
it costs is one of the tables.
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
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.flying_body import CONTROL_STEP_S, Motion
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
MAP_SIZE_PX: Final = (224, 112)  # of the class maps, and so of metric depth in flight

_APART_S = 20.0  # between images: the altimeter's correlation time, and no scale is remembered
_TILT_STD_RAD = 0.035  # of a flying body: 0.34 m/s2 of acceleration, gusts and movements


@dataclass(frozen=True, kw_only=True)
class ImagePlan:
    """Which images depth is measured on, and by whose masks."""

    # A third of all images looks past the boxes: this many show more than the paper's 661 edges.
    views: DepthViewPlan = field(
        default_factory=lambda: DepthViewPlan(scenes=TESTING_SCENES, views=170, seed=21)
    )
    masks: Masks = "unet"  # what a flight has; "exact" shows the geometry alone

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
    """A frame as a flight delivers it, what perception made of it, and the truth at map size."""

    frame: Frame  # with every eighth pixel: enough to see that it is not black
    video: CameraModel  # at the size of the video
    camera: CameraModel  # the same at map size
    masks: dict[Masks, ClassMap]
    relative: DepthMap | None  # None without a network
    ids: NDArray[np.uint8]  # (112, 224) exact
    depth_m: NDArray[np.float32]  # (112, 224) exact, along the optical axis
    truth: CameraView  # where the lens really is


def take_images(
    plan: ImagePlan,
    segmenter: Segmenter,
    network: DepthEstimator | None,
    *,
    advance: Advance = silent,
) -> Iterator[SampleImage]:
    """Take the images of a plan; the same plan gives the same images.

    Args:
        plan: which.
        segmenter: the masks of a flight.
        network: relative depth; None for methods that need none.
        advance: called after every image.

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
        telemetry = _telemetry(profile, seed, scene.helipad.size_m[2])
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
    exact = ClassMap(ids=np.ascontiguousarray(view.ids), captured_s=frame.captured_s)
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
    """Return what makes frames: pose, image and number in, frame out, one flight's sensors."""
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
            height_above_carpet_m=sensed.height_above_carpet_m,
        )

    return frame_of
