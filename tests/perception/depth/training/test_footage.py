"""The camera's movement: from telemetry, and measured on the ground."""

from dataclasses import replace

import numpy as np
import pytest

from perception.depth.training.footage import CameraTrack, shrink
from tests.perception.depth.depth_flight import KnownFlight, known_flight


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
    track = CameraTrack(flight.footage)
    for origin, target in ((2, 6), (6, 2), (3, 9)):
        found, true = track.motion(origin, target), flight.motion(origin, target)
        assert _turn_error_rad(found, true) < 1e-4
        np.testing.assert_allclose(found[:, 3], true[:, 3], atol=2e-3)


def test_smoothing_keeps_the_turn_and_loses_noise(noisy: KnownFlight, flight: KnownFlight) -> None:
    raw, exact = (
        np.array([frame.attitude.yaw_rad for frame in each.footage.frames])
        for each in (noisy, flight)
    )
    smooth = CameraTrack(noisy.footage).yaw_rad
    assert np.std(smooth - exact) < 0.75 * np.std(raw - exact)


def test_the_ground_tells_the_movement_better_than_noisy_telemetry(noisy: KnownFlight) -> None:
    track = CameraTrack(noisy.footage)
    told, measured = [], []
    for origin, target in ((1, 4), (2, 6), (3, 7), (8, 4), (9, 5)):
        true = noisy.motion(origin, target)
        found = track.measured_motion(origin, target)
        assert found is not None
        told.append(_turn_error_rad(track.motion(origin, target), true))
        measured.append(_turn_error_rad(found, true))
        np.testing.assert_allclose(found[:, 3], true[:, 3], atol=0.02)
    assert np.mean(measured) < 0.003
    assert np.mean(measured) < 0.5 * np.mean(told)


def test_without_texture_nothing_is_measured(flight: KnownFlight) -> None:
    plain = np.full((256, 320, 3), 90, np.uint8)
    frames = tuple(replace(frame, image=plain) for frame in flight.footage.frames)
    assert CameraTrack(replace(flight.footage, frames=frames)).measured_motion(2, 6) is None
