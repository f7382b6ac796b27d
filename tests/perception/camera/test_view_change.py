"""Images of another place than the image before."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from perception.camera.view_change import ViewChange, ViewChangeConfig
from uav_bt.errors import ValueRangeError
from uav_bt.types import Attitude, Frame

SIZE = (320, 180)


def place(seed: int) -> NDArray[np.uint8]:
    """Return a wide panorama of coarse and fine texture, (180, 1280, 3)."""
    rng = np.random.default_rng(seed)
    coarse = cv2.resize(rng.uniform(40, 200, (6, 40)), (1280, 180), interpolation=cv2.INTER_CUBIC)
    fine = cv2.resize(rng.uniform(-30, 30, (45, 320)), (1280, 180))
    grey = np.clip(coarse + fine, 0, 255).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=2)


def frame(image: NDArray[np.uint8], index: int, yaw_deg: float = 0.0, gap_s: float = 0.1) -> Frame:
    return Frame(
        image=image,
        index=index,
        captured_s=gap_s * index,
        gimbal_pitch_rad=-0.5,
        attitude=Attitude(yaw_rad=math.radians(yaw_deg)),
    )


def view(seed: int, left_px: int = 0) -> NDArray[np.uint8]:
    return np.ascontiguousarray(place(seed)[:, left_px : left_px + SIZE[0]])


def test_a_cut_to_another_place_is_seen_once() -> None:
    changed = ViewChange()
    images = [view(1), view(1, 4), view(2), view(2, 4)]
    assert [changed(frame(image, i)) for i, image in enumerate(images)] == [
        *(False, False, True, False)
    ]


def test_the_size_of_the_image_does_not_matter() -> None:
    changed = ViewChange()
    large = [cv2.resize(view(seed), (1280, 720)) for seed in (1, 1, 2)]
    assert [changed(frame(image, i)) for i, image in enumerate(large)] == [False, False, True]


@pytest.mark.parametrize("step_px", [20, 45, 70])
def test_a_fast_turn_is_no_other_place(step_px: int) -> None:
    """70 of 320 pixels are 15 degrees of the camera's 69, in a tenth of a second."""
    changed = ViewChange()
    assert not any(changed(frame(view(1, step_px * i), i)) for i in range(12))


def test_noise_and_light_are_no_other_place() -> None:
    changed = ViewChange()
    noise = np.random.default_rng(0).normal(0.0, 12.0, (8, *view(1).shape))
    for index in range(8):
        image = np.clip((0.6 + 0.1 * (index % 3)) * view(1) + noise[index], 0, 255).astype(np.uint8)
        assert not changed(frame(image, index))


def test_a_turn_in_the_telemetry_explains_another_view() -> None:
    changed = ViewChange()
    changed(frame(view(1), 0))
    assert not changed(frame(view(1, 900), 1, yaw_deg=40.0))
    tilted = replace(frame(view(1, 300), 2, yaw_deg=40.0), gimbal_pitch_rad=-1.5)
    assert not changed(tilted)


@pytest.mark.parametrize(("flown", "expected"), [(True, False), (False, True)])
def test_a_flight_goes_on_after_a_gap_without_video(*, flown: bool, expected: bool) -> None:
    changed = ViewChange()
    changed(frame(view(1), 0), flown=flown)
    assert changed(frame(view(2), 1, gap_s=1.0), flown=flown) == expected


def test_blank_images_separate_nothing() -> None:
    changed = ViewChange()
    dark, wall = np.zeros_like(view(1)), np.full_like(view(1), 120)
    images = [view(1), dark, view(1, 3), wall, view(1, 6), dark, view(2)]
    seen = [changed(frame(image, i)) for i, image in enumerate(images)]
    assert seen == [False] * 6 + [True]


def test_impossible_thresholds_are_refused() -> None:
    with pytest.raises(ValueRangeError, match="shares"):
        ViewChangeConfig(alike=1.5)
