"""Frames that arrive in time and show nothing, or nothing new."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from perception.camera.frame_watch import FrameWatch
from uav_bt.testing import blank_frame, pinhole
from uav_bt.types import Attitude, BodyVelocity, DroneState, FlyingState, Frame

CAMERA = pinhole(160, 90)
STATE = DroneState(captured_s=0.0, flying=FlyingState.HOVERING)
SCENE = cv2.resize(
    np.random.default_rng(1).integers(40, 200, (9, 16, 3), dtype=np.uint8),
    (160, 90),
    interpolation=cv2.INTER_CUBIC,
)


def frame(image: NDArray[np.uint8], index: int, **changes: object) -> Frame:
    blank = blank_frame(CAMERA, STATE, index=index, captured_s=index * 0.1)
    return replace(blank, image=image, **changes)  # type: ignore[arg-type]


def noisy(index: int, sigma: float = 4.0) -> NDArray[np.uint8]:
    noise = np.random.default_rng(index).normal(0.0, sigma, SCENE.shape)
    return np.clip(SCENE + noise, 0, 255).astype(np.uint8)


def test_a_lab_can_be_flown_by() -> None:
    watch = FrameWatch()
    assert [watch(frame(noisy(i), i), STATE) for i in range(20)] == [None] * 20


@pytest.mark.parametrize(
    ("image", "why"),
    [
        (np.zeros_like(SCENE), "dark"),
        (np.full_like(SCENE, 255), "overexposed"),
        (np.full_like(SCENE, 90), "lens covered"),
        (noisy(1, sigma=80.0), "all noise"),
        (cv2.GaussianBlur(SCENE, (0, 0), 9) // 12, "dark"),
    ],
)
def test_an_image_that_shows_nothing_is_named(image: NDArray[np.uint8], why: str) -> None:
    complaint = FrameWatch()(frame(image, 0), STATE)
    assert complaint is not None
    assert why in complaint


def test_a_dark_image_in_which_something_is_seen_can_be_flown_by() -> None:
    """The mean tells little: most of the image may be a black floor."""
    corner = np.full_like(SCENE, 8)
    corner[:45, :50] = 60
    assert FrameWatch()(frame(corner, 0), STATE) is None


def test_a_noisy_camera_does_not_show_the_same_image_twice() -> None:
    watch = FrameWatch()
    for index in range(10):
        assert watch(frame(noisy(index), index), STATE) is None
    reasons = {watch(frame(noisy(9), index), STATE) for index in range(10, 20)}
    assert reasons == {"the video is frozen"}
    assert watch(frame(noisy(20), 20), STATE) is None  # it goes on


@pytest.mark.parametrize(
    ("heading_step", "gimbal_step", "speed_mps", "frozen"),
    [(0.0, 0.0, 0.0, False), (0.02, 0.0, 0.0, True), (0.0, 0.02, 0.0, True), (0.0, 0.0, 0.3, True)],
)
def test_an_image_must_change_when_the_camera_moves(
    heading_step: float,
    gimbal_step: float,
    speed_mps: float,
    frozen: bool,  # noqa: FBT001
) -> None:
    """An image without noise may stay the same while the drone hovers, and no longer."""
    watch = FrameWatch()
    moving = replace(STATE, velocity=BodyVelocity(forward_mps=speed_mps))
    said = [
        watch(
            frame(
                SCENE,
                index,
                attitude=Attitude(yaw_rad=heading_step * index),
                gimbal_pitch_rad=gimbal_step * index,
            ),
            moving,
        )
        for index in range(20)
    ]
    assert said[-1] == ("the video is frozen" if frozen else None)
