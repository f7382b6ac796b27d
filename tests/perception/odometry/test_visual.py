"""The motion of the ground between two images."""

import math

import cv2
import numpy as np
import pytest

from perception.odometry.visual import GroundView, _reweighted, ground_motion
from sim_bridge.anafi import anafi_camera
from uav_bt.types import Pose2D, rotate_points
from uav_bt.types.arrays import Floats, Image

CAMERA = anafi_camera(320, 180)
STILL = Pose2D(x_m=0.0, y_m=0.0, yaw_rad=0.0)
GROUND = np.ones((180, 320), np.uint8)


def _textured() -> Image:
    rng = np.random.default_rng(3)
    blurred = cv2.GaussianBlur(rng.integers(0, 255, (180, 320), dtype=np.uint8), (0, 0), 2)
    return np.asarray(cv2.normalize(blurred, None, 0, 255, cv2.NORM_MINMAX), np.uint8)


def _views(*images: Floats | Image) -> list[GroundView]:
    level = {"camera": CAMERA, "gimbal_pitch_rad": math.radians(-30), "height_m": 1.5}
    return [GroundView(grey=np.asarray(image, np.uint8), **level) for image in images]


def test_points_close_together_or_that_move_in_two_ways_tell_no_motion() -> None:
    """Nearly half of the image is shifted: it may be the top of an object that counts as ground."""
    first, patch = _textured(), np.zeros((180, 320), dtype=np.uint8)
    patch[130:170, 130:190] = 1
    second = first.copy()
    second[:, 180:] = np.roll(first[:, 180:], 6, axis=0)
    assert ground_motion(*_views(first, first), STILL, patch) is None
    assert ground_motion(*_views(first, second), STILL, GROUND) is None
    assert ground_motion(*_views(first, first), STILL, GROUND) is not None


@pytest.mark.parametrize("contrast", [0.0, 1.6])
def test_the_noise_of_a_plain_floor_tells_no_motion_and_weak_texture_does(contrast: float) -> None:
    """Noise has corners, and tracked from where they are expected they agree with telemetry."""
    rng = np.random.default_rng(3)
    floor = 143.0 + contrast * (_textured() - 128.0) / np.std(_textured())
    noisy = [np.clip(floor + rng.normal(0.0, 2.0, floor.shape), 0, 255) for _ in range(2)]
    shown = ground_motion(*_views(*noisy), STILL, GROUND)
    assert (shown is None) == (contrast == 0.0)
    assert shown is None or math.hypot(shown.motion.x_m, shown.motion.y_m) < 0.005


def test_an_object_that_counts_as_ground_hides_no_weak_texture() -> None:
    """The corners of a chequered box are many times as strong as those of the floor."""
    image = np.asarray(128 + (_textured().astype(float) - 128) / 8, np.uint8)
    image[110:134, 30:54] = 255 * (np.indices((24, 24)).sum(axis=0) // 8 % 2)
    assert ground_motion(*_views(image, image), STILL, GROUND) is not None


@pytest.mark.parametrize("max_scale", [0.0, 0.02])
def test_the_fit_is_that_of_reweighted_least_squares(max_scale: float) -> None:
    rng = np.random.default_rng(4)
    there = rng.uniform((0.5, -1.5), (3.5, 1.5), (80, 2))
    noise_m = rng.normal(0.0, 0.01, (80, 2))
    here = rotate_points(there, 0.05) + np.array([0.12, -0.03]) + noise_m
    here[:15] += 0.2  # points that do not lie on the ground
    residual_m = there - rotate_points(here - (0.1, 0.0), -0.04)
    trust, scale_m, off_m = 1.0 / (1.0 + (there**2).sum(axis=1)) ** 2, 0.12, residual_m.copy()
    for _ in range(6):
        share = trust / (1.0 + ((off_m / scale_m) ** 2).sum(axis=1)) ** 2
        share = share / share.sum()
        a, b = here - share @ here, there - share @ there
        across, along = share @ (a[:, 1] * b[:, 0] - a[:, 0] * b[:, 1]), share @ (a * b).sum(axis=1)
        spread_m2, yaw_rad = share @ (b**2).sum(axis=1), math.atan2(across, along)
        scale = np.clip(math.hypot(across, along) / spread_m2, 1.0 - max_scale, 1.0 + max_scale)
        place_m = share @ here - scale * rotate_points(share @ there, yaw_rad)
        off_m = scale * there - rotate_points(here - place_m, -yaw_rad)
        scale_m = max(0.03, 0.6 * scale_m)
    x_m, y_m, turn_rad, spread_m, inliers = _reweighted(here, there, residual_m, max_scale)
    assert (x_m, y_m, turn_rad) == pytest.approx((*place_m, yaw_rad), rel=1e-9)
    assert (x_m, y_m, turn_rad) == pytest.approx((0.12, -0.03, 0.05), abs=0.01)
    assert spread_m == pytest.approx(math.sqrt(spread_m2), rel=1e-9)
    assert inliers == np.count_nonzero(np.hypot(*off_m.T) < 0.03) > 55
