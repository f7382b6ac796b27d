"""Helpers of the twin's tests: flights without images, the truth about them, and camera poses."""

from __future__ import annotations

import math
from collections.abc import Callable

from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.drone import TwinDrone
from uav_bt.types import Command, Movement, Observation, Truth

MakeTwin = Callable[..., TwinDrone]


def fly(drone: TwinDrone, movement: Movement, duration_s: float) -> Observation:
    """Send a movement at each tick for a time, without images; return the last observation."""
    end = drone.clock.now() + duration_s
    while drone.clock.now() < end - 1e-6:
        drone.send(Command(movement=movement))
        drone.clock.sleep_until(drone.clock.now() + 0.1)
    return drone.observe()


def truth(drone: TwinDrone) -> Truth:
    """Return the truth about a connected drone."""
    assert drone.referee is not None
    return drone.referee.truth()


def lens(x_m: float, y_m: float, z_m: float, yaw_deg: float, pitch_deg: float) -> CameraPose:
    """Return the pose of a camera, angles in degrees."""
    yaw_rad, pitch_rad = math.radians(yaw_deg), math.radians(pitch_deg)
    return CameraPose(x_m=x_m, y_m=y_m, z_m=z_m, yaw_rad=yaw_rad, pitch_rad=pitch_rad)
