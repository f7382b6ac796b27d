"""Frames that arrive in time and show nothing, or nothing new."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from perception.camera.frame_watch import FrameWatch
from tests.worlds import values
from uav_bt.types import Attitude, BodyVelocity, DroneState, FlyingState, Frame

FROZEN = "the video is frozen"
STATE = DroneState(captured_s=0.0, flying=FlyingState.HOVERING)
TILES = np.random.default_rng(1).integers(40, 200, (9, 16, 3), dtype=np.uint8)
SCENE = cv2.resize(TILES, (160, 90), interpolation=cv2.INTER_CUBIC)


def frame(
    image: NDArray[np.uint8], index: int, pitch_rad: float = 0.0, yaw_rad: float = 0.0
) -> Frame:
    more = {"captured_s": index * 0.1, "index": index, "attitude": Attitude(yaw_rad=yaw_rad)}
    return values.frame(image, pitch_rad, **more)


def noisy(index: int, sigma: float = 4.0) -> NDArray[np.uint8]:
    noise = np.random.default_rng(index).normal(0.0, sigma, SCENE.shape)
    return np.clip(SCENE + noise, 0, 255).astype(np.uint8)


def test_an_image_that_shows_nothing_is_named() -> None:
    for image, why in (
        (np.zeros_like(SCENE), "dark"),
        (np.full_like(SCENE, 255), "overexposed"),
        (np.full_like(SCENE, 90), "lens covered"),
        (noisy(1, sigma=80.0), "all noise"),
        (cv2.GaussianBlur(SCENE, (0, 0), 9) // 12, "dark"),
    ):
        assert why in (FrameWatch()(frame(image, 0), STATE) or "")
    corner = np.full_like(SCENE, 8)  # most of an image may be a black floor: the mean tells little
    corner[:45, :50] = 60
    assert FrameWatch()(frame(corner, 0), STATE) is None


def test_a_noisy_camera_does_not_show_the_same_image_twice() -> None:
    watch = FrameWatch()
    for index in range(10):
        assert watch(frame(noisy(index), index), STATE) is None
    reasons = {watch(frame(noisy(9), index), STATE) for index in range(10, 20)}
    assert reasons == {FROZEN}
    assert watch(frame(noisy(20), 20), STATE) is None  # it goes on


@pytest.mark.parametrize("rates", [(0.0, 0.0, 0.0), (0.2, 0.0, 0.0), (0.0, 0.2, 0.0), (0, 0, 0.3)])
def test_an_image_must_change_when_the_camera_moves(rates: tuple[float, float, float]) -> None:
    """An image without noise may stay the same while the drone hovers, and no longer."""
    yaw_radps, pitch_radps, speed_mps = rates
    moving = replace(STATE, velocity=BodyVelocity(forward_mps=speed_mps))
    watch, said = FrameWatch(), None
    for index in range(20):
        turned = (pitch_radps * index * 0.1, yaw_radps * index * 0.1)
        said = watch(frame(SCENE, index, *turned), moving)
    assert said == (FROZEN if any(rates) else None)
