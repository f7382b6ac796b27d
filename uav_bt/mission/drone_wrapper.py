"""A drone around another one; a wrapper overrides some members and inherits the others."""

from __future__ import annotations

from uav_bt import protocols
from uav_bt.types import Airframe, CameraModel, Command, Observation


class DroneWrapper:
    """Hands out the members of an inner drone; derive from it and override some."""

    def __init__(self, drone: protocols.Drone) -> None:
        """Keep the drone, which is not connected."""
        self.inner = self._drone = drone

    @property
    def clock(self) -> protocols.Clock:
        """The inner drone's clock."""
        return self._drone.clock

    @property
    def camera(self) -> CameraModel:
        """The inner drone's camera."""
        return self._drone.camera

    @property
    def airframe(self) -> Airframe:
        """The inner drone's airframe."""
        return self._drone.airframe

    @property
    def referee(self) -> protocols.Referee | None:
        """The inner drone's referee; None on a real drone."""
        return self._drone.referee

    @property
    def sight(self) -> protocols.Sight | None:
        """The inner drone's perception without images; None if it sends images."""
        return self._drone.sight if isinstance(self._drone, protocols.Imageless) else None

    @property
    def stills(self) -> protocols.StillCamera | None:
        """The inner drone's own photographs; None if it takes none."""
        return self._drone.stills if isinstance(self._drone, protocols.Photographing) else None

    @property
    def scene(self) -> protocols.Scene | None:
        """The inner drone's scene; None on a real drone."""
        return self._drone.scene

    @property
    def live(self) -> bool:
        """Whether the inner drone is a real one."""
        return self._drone.live

    @property
    def tick_s(self) -> float | None:
        """The inner drone's tick, seconds; None if the mission sets it."""
        return self._drone.tick_s

    def connect(self) -> None:
        """Connect the inner drone.

        Raises:
            DroneError: the drone cannot be reached.
        """
        self._drone.connect()

    def observe(self) -> Observation:
        """Return the inner drone's observation."""
        return self._drone.observe()

    def send(self, command: Command) -> Command:
        """Send a command to the inner drone."""
        return self._drone.send(command)

    def disconnect(self) -> None:
        """Disconnect the inner drone."""
        self._drone.disconnect()
