"""The camera's movement: from telemetry, and measured on the ground."""

import cv2
import numpy as np
import pytest

from perception.depth.training.footage import camera_track, measured_motion, shrink
from perception.odometry.visual import GroundView, ground_motion
from tests.perception.depth.depth_flight import KnownFlight, known_flight
from uav_bt.types import Pose2D


def test_an_image_is_resized_and_never_cropped() -> None:
    picture = np.zeros((360, 640, 3), np.uint8)
    picture[:, 320:] = 200
    small = shrink(picture)
    assert small.shape == (256, 320, 3)
    assert (small[:, :160] == 0).all()
    assert (small[:, 160:] == 200).all()


@pytest.fixture(scope="module")
def flight() -> KnownFlight:
    return known_flight()


@pytest.fixture(scope="module")
def noisy() -> KnownFlight:
    """The same flight; its compass is off by more than half a degree."""
    return known_flight(yaw_noise_rad=0.012, seed=3)


def _turn_error_rad(found: np.ndarray, true: np.ndarray) -> float:
    trace = np.trace(found[:, :3] @ true[:, :3].T)
    return float(np.arccos(np.clip((trace - 1.0) / 2.0, -1.0, 1.0)))


def test_exact_telemetry_gives_the_exact_movement(flight: KnownFlight) -> None:
    track = camera_track(flight.footage)
    for origin, target in ((2, 6), (6, 2), (3, 9)):
        found, true = track.motion(origin, target), flight.motion(origin, target)
        assert _turn_error_rad(found, true) < 1e-4
        np.testing.assert_allclose(found[:, 3], true[:, 3], atol=2e-3)


def test_a_movement_and_its_opposite_cancel(flight: KnownFlight) -> None:
    track = camera_track(flight.footage)
    there, back = track.motion(2, 7), track.motion(7, 2)
    np.testing.assert_allclose(back[:, :3] @ there[:, :3], np.eye(3), atol=1e-9)
    np.testing.assert_allclose(back[:, :3] @ there[:, 3] + back[:, 3], 0.0, atol=1e-9)


def test_smoothing_keeps_the_turn_and_loses_noise(noisy: KnownFlight, flight: KnownFlight) -> None:
    raw = noisy.footage.attitude_rad[:, 2]
    exact = flight.footage.attitude_rad[:, 2]
    smooth = camera_track(noisy.footage).yaw_rad
    assert np.std(smooth - exact) < 0.75 * np.std(raw - exact)


def test_the_ground_tells_the_movement_better_than_noisy_telemetry(noisy: KnownFlight) -> None:
    track = camera_track(noisy.footage)
    told, measured = [], []
    for origin, target in ((1, 4), (2, 6), (3, 7), (8, 4), (9, 5)):
        true = noisy.motion(origin, target)
        found = measured_motion(noisy.footage, track, origin, target)
        assert found is not None
        told.append(_turn_error_rad(track.motion(origin, target), true))
        measured.append(_turn_error_rad(found, true))
        np.testing.assert_allclose(found[:, 3], true[:, 3], atol=0.02)
    assert np.mean(measured) < 0.003
    assert np.mean(measured) < 0.5 * np.mean(told)


def test_without_texture_telemetry_stays(flight: KnownFlight) -> None:
    footage = flight.footage
    grey = np.full(footage.frames.shape[1:3], 90, np.uint8)
    view = GroundView(grey=grey, camera=footage.camera, gimbal_pitch_rad=-0.5, height_m=1.5)
    still = Pose2D(x_m=0.0, y_m=0.0, yaw_rad=0.0)
    assert ground_motion(view, view, still) is None


def test_two_equal_pictures_show_no_movement(flight: KnownFlight) -> None:
    footage = flight.footage
    view = GroundView(
        grey=np.asarray(cv2.cvtColor(footage.frames[4], cv2.COLOR_RGB2GRAY), np.uint8),
        camera=footage.camera,
        gimbal_pitch_rad=float(footage.gimbal_pitch_rad[4]),
        height_m=1.5,
    )
    guess = Pose2D(x_m=0.02, y_m=-0.01, yaw_rad=0.01)
    found = ground_motion(view, view, guess)
    assert found is not None
    assert abs(found.motion.x_m) < 2e-3
    assert abs(found.motion.y_m) < 2e-3
    assert abs(found.motion.yaw_rad) < 1e-3
