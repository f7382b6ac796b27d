"""Helpers of the twin's tests: flights without images, and the truth about them."""

from __future__ import annotations

from sim_bridge.twin.drone import TwinDrone
from uav_bt.types import Command, Movement, Observation, Truth


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
