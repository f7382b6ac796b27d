"""The camera track of a whole flight, fitted to telemetry and to the ground."""

from __future__ import annotations

import numpy as np

from perception.odometry.camera_track import CameraTrack, camera_track
from perception.odometry.track_fit import fitted_track
from tests.perception.depth.depth_flight import KnownFlight, known_flight


def _errors_rad(flight: KnownFlight, track: CameraTrack) -> float:
    errors = []
    for origin, target in ((1, 5), (2, 8), (3, 9), (4, 10)):
        true, found = flight.motion(origin, target), track.motion(origin, target)
        trace = np.trace(found[:, :3] @ true[:, :3].T)
        errors.append(np.arccos(np.clip((trace - 1.0) / 2.0, -1.0, 1.0)))
    return float(np.mean(errors))


def test_the_fit_turns_as_the_ground_does() -> None:
    flight = known_flight(yaw_noise_rad=0.012, seed=3)
    reported = camera_track(flight.footage)
    fitted = fitted_track(flight.footage, reported)
    assert _errors_rad(flight, fitted) < 0.6 * _errors_rad(flight, reported)
    moved = [fitted.motion(2, 8)[:, 3], flight.motion(2, 8)[:, 3]]
    np.testing.assert_allclose(moved[0], moved[1], atol=0.02)


def test_without_ground_in_view_the_track_is_telemetrys() -> None:
    flight = known_flight(6)
    blank = flight.footage.frames.copy()
    blank[:] = 127
    footage = type(flight.footage)(**{**vars(flight.footage), "frames": blank})
    reported = camera_track(footage)
    fitted = fitted_track(footage, reported)
    np.testing.assert_allclose(fitted.yaw_rad, reported.yaw_rad, atol=1e-6)
    np.testing.assert_allclose(fitted.position_m, reported.position_m, atol=1e-3)
