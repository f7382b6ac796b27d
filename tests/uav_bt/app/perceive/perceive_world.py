"""A small drawn lab as images, video and record, for the tests of `net perceive`."""

from __future__ import annotations

import math
from fractions import Fraction
from pathlib import Path

import cv2

from sim_bridge.anafi import anafi_camera
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.objects import BoxSpec, Helipad
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.views import render_views
from tests.worlds.footage import frame, state, write_record
from uav_bt.display.video.video_file import VideoFile
from uav_bt.types import CameraModel
from uav_bt.types.arrays import Image

SIZE = (320, 180)
PITCH_RAD = math.radians(-30.0)
SPEED_MPS = 0.5
RATE = 10


def flight(count: int = 4) -> list[Image]:
    """Fly towards a box at half a metre a second, 1.5 m above the ground."""
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


def write_images(folder: Path, images: list[Image]) -> Path:
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


def write_flight(path: Path, images: list[Image]) -> Path:
    """Write the flight's record, which begins at second 5."""
    frames = [
        frame(image, index, 5.0 + index / RATE, gimbal_pitch_rad=PITCH_RAD)
        for index, image in enumerate(images)
    ]
    states = [state(one.captured_s, SPEED_MPS) for one in frames]
    return write_record(path, camera(), frames, states)


def camera() -> CameraModel:
    return anafi_camera(*SIZE)
