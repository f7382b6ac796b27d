"""Handwritten records that contain only a test's frames and states."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tests.paper_lab import CARPET, CLASSES, paper_map
from uav_bt.record import channels, messages
from uav_bt.record.channels import SCHEMA_VERSION, START
from uav_bt.record.record_file import RecordFile
from uav_bt.record.values import dump, encode
from uav_bt.types import Attitude, BodyVelocity, CameraModel, DroneState, FlyingState, Frame
from uav_bt.types.camera import ClassMap, FrameNote

LAB_CLASSES: Final = dump([encode(each) for each in CLASSES]).decode()


class SeesGround:
    """A segmenter for which all below some rows is ground; counts its frames."""

    def __init__(self, first_row: int = 0) -> None:
        self.first_row, self.asked = first_row, 0

    def segment(self, frame: Frame) -> ClassMap:
        self.asked += 1
        ids = np.zeros((112, 224), np.uint8)
        ids[self.first_row :] = CARPET
        return paper_map(ids, frame.captured_s)


def frame(image: NDArray[np.uint8], index: int, captured_s: float, **changes: float) -> Frame:
    """Return a frame from 1.5 m above the ground; `yaw_rad` may be given, too."""
    yaw_rad = changes.pop("yaw_rad", 0.0)
    pose = {"gimbal_pitch_rad": -0.5, "altitude_m": 1.1, "height_m": 1.5} | changes
    pose.setdefault("height_above_ground_m", pose["height_m"])
    attitude = Attitude(yaw_rad=yaw_rad)
    return Frame(image=image, index=index, captured_s=captured_s, attitude=attitude, **pose)


def state(captured_s: float, forward_mps: float = 0.5) -> DroneState:
    return DroneState(
        captured_s=captured_s,
        flying=FlyingState.FLYING,
        velocity=BodyVelocity(forward_mps=forward_mps),
    )


def write_record(
    path: Path,
    camera: CameraModel,
    frames: Sequence[Frame],
    states: Sequence[DroneState],
    *,
    finished: bool = True,
    facts: Mapping[str, str] | None = None,
) -> Path:
    """Write a record of frames (lossless) and states, and return its path.

    `facts` are further metadata.
    """
    file = RecordFile(path)
    file.metadata(
        START,
        {
            "schema_version": str(SCHEMA_VERSION),
            "start_ns": "0",
            "start_s": "0.0",
            "camera_model": dump(encode(camera)).decode(),
            "classes": LAB_CLASSES,
            **(facts or {}),
        },
    )
    for item in sorted((*states, *frames), key=lambda one: one.captured_s):
        at_ns = round(1e9 * item.captured_s)
        if isinstance(item, DroneState):
            file.write(channels.STATE, at_ns, dump(encode(item)))
        else:
            file.write(channels.CAMERA_FRAME, at_ns, dump(encode(item, FrameNote)))
            image = messages.camera_image(item.image, at_ns, "lossless")
            file.write(channels.CAMERA_IMAGE, at_ns, image)
    file.finish() if finished else file.abandon()
    return path


def camera_file(path: Path, camera: CameraModel) -> Path:
    """Write a camera file by hand, as a calibration would, and return its path."""
    size = f"width_px: {camera.width_px}\nheight_px: {camera.height_px}\n"
    lens = f"K: {camera.matrix.tolist()}\ndistortion: {list(camera.distortion)}\n"
    path.write_text(size + lens, encoding="utf-8")
    return path
