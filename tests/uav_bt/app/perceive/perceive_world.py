"""A small lab, drawn, as pictures, as a video and as footage, for the tests of perceiving."""

from __future__ import annotations

import math
from fractions import Fraction
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.footage.file import Footage, write_footage
from sim_bridge.anafi import anafi_camera
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.scene import BoxSpec, Helipad, Scene
from sim_bridge.twin.views import render_views
from uav_bt.display.video.video_file import VideoFile
from uav_bt.types import CameraModel

SIZE = (320, 180)
PITCH_RAD = math.radians(-30.0)
SPEED_MPS = 0.5
RATE = 10

Image = NDArray[np.uint8]


def flight(count: int = 4) -> list[Image]:
    """Fly towards a box at half a metre a second, 1.5 m above the carpet."""
    scene = Scene(
        name="small",
        helipad=Helipad(position_m=(0.3, -0.9)),
        boxes=(BoxSpec(pattern=5, position_m=(1.0, 0.1), size_m=(0.5, 0.5, 1.9)),),
    )
    poses = [
        CameraPose(
            x_m=-1.0 + SPEED_MPS * index / RATE,
            y_m=0.0,
            z_m=1.5,
            yaw_rad=0.0,
            pitch_rad=PITCH_RAD,
        )
        for index in range(count)
    ]
    return [view.image for view in render_views(scene, poses, size_px=SIZE)]


def write_pictures(folder: Path, images: list[Image]) -> Path:
    folder.mkdir()
    for index, image in enumerate(images):
        assert cv2.imwrite(str(folder / f"{index}.png"), image[..., ::-1])
    return folder


def write_video(path: Path, images: list[Image]) -> Path:
    height_px, width_px = images[0].shape[:2]
    film = VideoFile(path, size_px=(width_px, height_px), frames_per_s=Fraction(RATE))
    for image in images:
        film.write(image)
    film.close()
    return path


def write_flight(path: Path, images: list[Image], *, size_px: tuple[int, int] = (160, 128)) -> Path:
    """Write the flight's footage, its frames resized as footage is."""
    count = len(images)
    times_s = 5.0 + np.arange(count) / RATE
    zeros = np.zeros(count)
    footage = Footage(
        frames=np.stack([cv2.resize(one, size_px, interpolation=cv2.INTER_AREA) for one in images]),
        index=np.arange(count, dtype=np.int64),
        captured_s=times_s,
        gimbal_pitch_rad=np.full(count, PITCH_RAD),
        attitude_rad=np.zeros((count, 3)),
        altitude_m=np.full(count, 1.1),
        height_m=np.full(count, 1.5),
        height_above_carpet_m=np.full(count, 1.5),
        state_s=times_s,
        state_attitude_rad=np.zeros((count, 3)),
        velocity_mps=np.stack([np.full(count, SPEED_MPS), zeros, zeros], axis=1),
        camera=camera().resized(*size_px),
    )
    write_footage(path, footage)
    return path


def camera() -> CameraModel:
    return anafi_camera(*SIZE)
