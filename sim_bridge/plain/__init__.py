"""A simulated drone without images, for mission tests and many flights.

Physics, autopilot, telemetry, movers and noise are the twin's. Class maps, depth and the motion
over the ground come from ray casting, with the errors of the networks. OpenGL is not needed.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

from sim_bridge.twin import SimulatedConfig

if TYPE_CHECKING:
    from sim_bridge.plain.drone import PlainDrone

__all__ = ["PlainConfig"]


@dataclass(frozen=True, kw_only=True)
class PlainConfig(SimulatedConfig):
    """Settings of a flight without images; the entry point `plain` registers this class."""

    def create(self) -> PlainDrone:
        """Return a drone. Its `connect` builds the scene.

        Raises:
            InputError: the scene or the profile is unusable.
        """
        from sim_bridge.plain import drone  # noqa: PLC0415  (imports MuJoCo)

        return self.make(drone.PlainDrone, drone.SIZE_PX)
