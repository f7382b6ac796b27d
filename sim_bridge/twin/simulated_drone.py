"""Base of the simulated drones: the clock, the orders, and the delivery of frames."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Final

from sim_bridge.anafi import ANAFI_AIRFRAME, anafi_camera
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.referee import TwinReferee
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.simulation import Capture, Simulation
from uav_bt.errors import DroneError, ValueRangeError
from uav_bt.types import Command, Velocity, clamp, limit_length

_TIME_SLACK_S: Final = 1e-6  # rounding error of a sum of control steps, s


@dataclass(frozen=True, kw_only=True)
class Running:
    """Objects that exist while connected."""

    simulation: Simulation
    referee: TwinReferee


class SimulatedDrone:
    """A drone in the twin's physics; a subclass adds perception.

    Time passes only in `clock.sleep_until`, which advances the physics in steps of 10 ms.

    Its parameters are those of `TwinDrone`.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        profile: Profile,
        seed: int,
        image_size_px: tuple[int, int],
        realtime: bool,
    ) -> None:
        if seed < 0:
            raise ValueRangeError(f"the seed must be zero or a positive number, got {seed}")
        self.scene = scene
        self.profile = profile
        self.camera = anafi_camera(*image_size_px)
        self.airframe = ANAFI_AIRFRAME
        self.clock = SimulatedClock(self, realtime=realtime)
        self.live = False  # a simulated drone needs no check before it takes off
        self.tick_s = None  # None: the mission sets the length of a tick
        self._seed = seed
        self._flight: Running | None = None

    @property
    def referee(self) -> TwinReferee | None:
        """The referee; None before connecting."""
        return self._flight.referee if self._flight is not None else None

    @property
    def simulation(self) -> Simulation:
        """The running simulation.

        Raises:
            DroneError: not connected.
        """
        if self._flight is None:
            raise DroneError("the drone is not connected; call connect() first")
        return self._flight.simulation

    @property
    def pilot_has_control(self) -> bool:
        """Whether a pilot flies; tests set it. Commands are then ignored."""
        return self.simulation.pilot_has_control

    @pilot_has_control.setter
    def pilot_has_control(self, value: bool) -> None:
        self.simulation.pilot_has_control = value

    def disturb(
        self,
        *,
        wind_mps2: tuple[float, float] = (0.0, 0.0),
        drift_mps: tuple[float, float] = (0.0, 0.0),
    ) -> None:
        """Apply a steady disturbance from now on, for tests; without arguments, remove it.

        Args:
            wind_mps2: acceleration by the wind, world x and y.
            drift_mps: velocity that the drone does not measure, world x and y.

        Raises:
            DroneError: not connected.
        """
        self.simulation.disturb(wind_mps2=wind_mps2, drift_mps=drift_mps)

    def send(self, command: Command) -> Command:
        """Send a command and return it as sent, with speeds limited to those of the profile.

        Raises:
            DroneError: not connected.
        """
        if isinstance(command.movement, Velocity):
            command = replace(command, movement=self._limited(command.movement))
        self.simulation.enqueue(command)
        return command

    def _limited(self, order: Velocity) -> Velocity:
        profile = self.profile
        forward_mps, right_mps = limit_length(
            order.forward_mps, order.right_mps, profile.max_speed_mps
        )
        return Velocity(
            forward_mps=forward_mps,
            right_mps=right_mps,
            down_mps=clamp(order.down_mps, profile.max_climb_mps),
            yaw_rate_radps=clamp(order.yaw_rate_radps, profile.max_yaw_rate_radps),
        )

    def delivered(self, time_s: float) -> Capture | None:
        """Return the newest capture that has been delivered by a time; None before the first."""
        limit_s = time_s - self.profile.video_latency_s + _TIME_SLACK_S
        frames = reversed(self.simulation.frames)
        return next((capture for capture in frames if capture.time_s <= limit_s), None)


class SimulatedClock:
    """Clock of the flight. Time passes only in `sleep_until`."""

    def __init__(self, drone: SimulatedDrone, *, realtime: bool) -> None:
        self._drone = drone
        self._realtime = realtime
        self._wall_start_s: float | None = None

    def now(self) -> float:
        """Return the time since connecting, s; 0 before.

        Raises:
            DroneError: not connected.
        """
        return self._drone.simulation.now_s

    def sleep_until(self, time_s: float) -> None:
        """Advance the physics to a time, rounded up to 10 ms; a past time has no effect.

        Raises:
            DroneError: not connected.
        """
        simulation = self._drone.simulation
        if self._realtime and self._wall_start_s is None:
            self._wall_start_s = time.monotonic() - simulation.now_s
        simulation.run_until(time_s)
        if self._wall_start_s is not None:
            elapsed = time.monotonic() - self._wall_start_s
            time.sleep(max(0.0, simulation.now_s - elapsed))  # noqa: TID251 - a clock, too
