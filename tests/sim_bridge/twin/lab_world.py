"""Helper of the twin's tests: flights without images."""

from __future__ import annotations

from sim_bridge.twin.drone import TwinDrone
from uav_bt.types import Command, Movement, Observation


def fly(drone: TwinDrone, movement: Movement, duration_s: float) -> Observation:
    """Send a movement at each tick for a time, without images; return the last observation."""
    end = drone.clock.now() + duration_s
    while drone.clock.now() < end - 1e-6:
        drone.send(Command(movement=movement))
        drone.clock.sleep_until(drone.clock.now() + 0.1)
    return drone.observe()
