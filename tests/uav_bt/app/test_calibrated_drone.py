"""A camera file replaces the drone's camera model."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml

from sim_bridge.twin import TwinConfig
from uav_bt import app
from uav_bt.app.drone_of_flight import CalibratedDrone
from uav_bt.errors import DroneError, FileError, ValueRangeError
from uav_bt.protocols import Drone


def camera_file(folder: Path, *, height_px: int = 720, bend: float = -0.1) -> Path:
    path = folder / "camera.yaml"
    content = {
        "width_px": 1280,
        "height_px": height_px,
        "K": [[900.0, 0.0, 630.0], [0.0, 905.0, 350.0], [0.0, 0.0, 1.0]],
        "distortion": [bend, 0.0, 0.0, 0.0, 0.0],
    }
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return path


def twin() -> Drone:
    return TwinConfig(profile="ideal", image_size_px=(160, 90)).create()


def test_the_files_camera_is_scaled_to_the_frames(tmp_path: Path) -> None:
    """It has no distortion, since the frames are rectified; the lens position is the drone's."""
    inner = twin()
    drone = CalibratedDrone(inner, camera_file(tmp_path))
    drone.connect()
    try:
        camera = drone.camera
        assert (camera.width_px, camera.height_px) == (160, 90)
        assert camera.fx_px == pytest.approx(900.0 / 8)
        assert camera.distortion == ()
        assert camera.forward_offset_m == inner.camera.forward_offset_m
        assert drone.clock is inner.clock
        assert drone.referee is inner.referee
    finally:
        drone.disconnect()


def test_each_frame_is_straightened_once(tmp_path: Path) -> None:
    bent, straight = twin(), CalibratedDrone(twin(), camera_file(tmp_path))
    bent.connect()
    straight.connect()
    try:
        raw, first, again = bent.observe(), straight.observe(), straight.observe()
        assert raw.frame is not None
        assert first.frame is not None
        assert again.frame is first.frame
        assert first.frame.index == raw.frame.index
        assert first.frame.image.shape == raw.frame.image.shape
        assert not np.array_equal(first.frame.image, raw.frame.image)
        assert first.state == raw.state
        assert straight.referee is not None
        assert straight.referee.class_ids(first.frame, 32, 18).shape == (18, 32)
    finally:
        bent.disconnect()
        straight.disconnect()


def test_a_camera_of_another_aspect_flies_nothing(tmp_path: Path) -> None:
    drone = CalibratedDrone(twin(), camera_file(tmp_path, height_px=960))
    with pytest.raises(ValueRangeError, match="1280x960"):
        drone.connect()
    with pytest.raises(DroneError, match="not connected"):
        drone.observe()
    absent = CalibratedDrone(twin(), tmp_path / "absent.yaml")
    with pytest.raises(FileError, match="no such camera file"):
        absent.connect()


def test_flights_take_a_camera_file(tmp_path: Path) -> None:
    options = app.FlightOptions(camera=camera_file(tmp_path), image_size_px=(160, 90))
    drone = app.make_drone(options)

    assert isinstance(drone, CalibratedDrone)
    assert drone.scene is not None
    assert not isinstance(app.make_drone(app.FlightOptions()), CalibratedDrone)
