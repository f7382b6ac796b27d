"""Drones around others: a camera file replaces the camera model, and a rehearsal pretends."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from sim_bridge.olympe import AnafiConfig
from sim_bridge.twin import TwinConfig
from uav_bt import app
from uav_bt.app.drone_of_flight import CalibratedDrone, RehearsedDrone
from uav_bt.errors import DroneError, FileError, ValueRangeError
from uav_bt.protocols import Drone
from uav_bt.testing import ScriptedDrone
from uav_bt.types import (
    Command,
    CutMotors,
    DroneState,
    FlyingState,
    GimbalTo,
    Hover,
    Land,
    MoveBy,
    Movement,
    MovementState,
    Release,
    TakeOff,
    Velocity,
)

# --- a camera file --------------------------------------------------------------------------------


def camera_file(folder: Path, *, height_px: int = 720) -> Path:
    path = folder / "camera.yaml"
    content = {
        "width_px": 1280,
        "height_px": height_px,
        "K": [[900.0, 0.0, 630.0], [0.0, 905.0, 350.0], [0.0, 0.0, 1.0]],
        "distortion": [-0.1, 0.0, 0.0, 0.0, 0.0],
    }
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return path


def twin() -> Drone:
    return TwinConfig(profile="ideal", image_size_px=(160, 90)).create()


def test_a_camera_file_is_scaled_to_the_frames_and_straightens_each_once(tmp_path: Path) -> None:
    """It has no distortion, since the frames are rectified; the lens position is the drone's."""
    bent = twin()
    straight = app.make_drone(
        app.FlightOptions(camera=camera_file(tmp_path), image_size_px=(160, 90), profile="ideal")
    )
    assert isinstance(straight, CalibratedDrone)
    bent.connect()
    straight.connect()
    try:
        camera = straight.camera
        assert (camera.width_px, camera.height_px) == (160, 90)
        assert camera.fx_px == pytest.approx(900.0 / 8)
        assert camera.distortion == ()
        assert camera.forward_offset_m == bent.camera.forward_offset_m
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


# --- rehearsals -----------------------------------------------------------------------------------


class Stage:
    """A rehearsal with a drone in a person's hands, which stays on the ground."""

    def __init__(self) -> None:
        self.held = ScriptedDrone()
        self.held.live = True
        self.drone = RehearsedDrone(self.held)
        self.drone.connect()

    def play(self, movement: Movement, seconds: float) -> DroneState:
        """Send a movement for some time and return the last state."""
        for _ in range(round(10 * seconds)):
            self.drone.observe()
            self.drone.send(Command(movement=movement))
            self.held.clock.advance(0.1)
        return self.drone.observe().state


@pytest.fixture
def stage() -> Stage:
    stage = Stage()
    assert stage.play(TakeOff(), 3.5).flying is FlyingState.HOVERING
    return stage


def test_the_drone_gets_only_camera_directions(stage: Stage) -> None:
    assert isinstance(stage.drone, Drone)
    assert stage.drone.live
    assert stage.held.commands == []
    for movement in (MoveBy(id=1, forward_m=1.0), Velocity(forward_mps=1.0), Land(), CutMotors()):
        command = Command(movement=movement, gimbal=GimbalTo(pitch_rad=-0.5))
        assert stage.drone.send(command) == command
    pointed = Command(movement=Release(), gimbal=GimbalTo(pitch_rad=-0.5))
    assert stage.held.commands == [pointed] * 4


def test_a_pretended_flight_has_heights_and_ends(stage: Stage) -> None:
    assert stage.play(Hover(), 0.2).altitude_m == pytest.approx(1.0)
    up = stage.play(MoveBy(id=1, down_m=-0.5), 2.0)
    assert up.movement is not None
    assert (up.movement.id, up.movement.state) == (1, MovementState.DONE)
    assert up.altitude_m == pytest.approx(1.5)
    sinking = stage.play(Velocity(down_mps=0.5), 1.0)
    assert sinking.flying is FlyingState.FLYING
    assert sinking.altitude_m == pytest.approx(1.0, abs=0.06)
    running = stage.play(MoveBy(id=5, yaw_rad=math.pi), 1.0)
    assert running.movement is not None
    assert running.movement.state is MovementState.RUNNING
    hovering = stage.play(Hover(), 0.2)
    assert hovering.movement is not None
    assert hovering.movement.state is MovementState.INTERRUPTED
    assert hovering.flying is FlyingState.HOVERING
    down = stage.play(Land(), 3.5)
    assert (down.flying, down.altitude_m) == (FlyingState.LANDED, 0.0)
    for movement in (Hover(), MoveBy(id=9, forward_m=1.0), Velocity(forward_mps=1.0), Land()):
        assert stage.play(movement, 0.3).flying is FlyingState.LANDED


def test_a_site_without_limits_leaves_those_of_the_options_to_the_drone() -> None:
    config, limits = AnafiConfig(), app.Limits(speed_mps=2.0)
    drone: Any = app.make_drone(app.FlightOptions(drone=config, site=app.Site(), limits=limits))
    assert drone._config.speed_limit_mps == 2.0
