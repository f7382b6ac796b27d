"""Take-off, landing, emergency stop, and the sticks (class ardrone3.Piloting)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from sim_bridge.loopback.codec import Values
from sim_bridge.loopback.firmware.states import States
from sim_bridge.loopback.firmware.travel import Ending, Leg, Travel
from sim_bridge.loopback.twin_world import TwinWorld
from sim_bridge.loopback.world import WorldState
from sim_bridge.twin.reference import Pace
from uav_bt.types import CutMotors, FlyingState, Hover, Land, TakeOff, Velocity
from uav_bt.types.pose import clamp, limit_length

AIRBORNE: Final = (FlyingState.HOVERING, FlyingState.FLYING)
EXPIRY_S: Final = 0.5  # s after which old stick positions count as centred; clients send at 20 Hz

# Steady speed at a tilt of 45 degrees, m/s; a tilt of 40 degrees gives the ANAFI's 15 m/s.
_SPEED_PER_TILT_MPS: Final = 15.0 / math.tan(math.radians(40.0))
_DRAG_PER_S: Final = 9.81 / _SPEED_PER_TILT_MPS  # share of the speed lost per second
# Time for which an emergency stop is published even on the ground, because clients wait for it, s.
_EMERGENCY_S: Final = 0.5
_EVENT: Final = "ardrone3.PilotingState.FlyingStateChanged"


class Flight:
    """Flies the body: by take-off, landing and sticks, and on trips that others ask for."""

    def __init__(self, world: TwinWorld, states: States) -> None:
        self.world = world
        self.states = states
        self.travel = Travel(world)
        self.may_take_off = True  # False while the battery is critical
        self.handlers = {
            "ardrone3.Piloting.TakeOff": self._take_off,
            "ardrone3.Piloting.UserTakeOff": self._user_take_off,
            "ardrone3.Piloting.Landing": self._land,
            "ardrone3.Piloting.Emergency": self._stop_motors,
            "ardrone3.Piloting.PCMD": self._pcmd,
        }
        self._emergency_until_s = 0.0
        self._ignores_sticks = False  # whether the present trip is not interrupted by them
        self._sticks: Velocity | None = None  # steady velocity of the sticks; None: they rest
        self._sticks_s = 0.0  # time of the last stick positions
        self._speed_mps = (0.0, 0.0)  # present speed from the sticks: forward, right
        self._steered_s = 0.0

    @property
    def ceiling_m(self) -> float:
        """The altitude limit above the take-off point: the lower of client's and world's, m."""
        highest_m: float = self.states.value("ardrone3.PilotingSettingsState.MaxAltitudeChanged")
        return min(highest_m, self.world.ceiling_m)

    @property
    def pace(self) -> Pace:
        """The speed limits: the client's, within those of the body."""
        tilt_rad, climb_mps, turn_radps = self._settings()
        limits = self.world.pace
        return Pace(
            speed_mps=min(_steady_mps(tilt_rad), limits.speed_mps),
            climb_mps=min(climb_mps, limits.climb_mps),
            yaw_rate_radps=min(turn_radps, limits.yaw_rate_radps),
        )

    def land(self) -> None:
        """Land at the present position."""
        self.interrupt()
        self.world.move(Land())

    def hover(self) -> None:
        """Stop at the present position."""
        self.interrupt()
        self.world.move(Hover())

    def interrupt(self) -> None:
        """End the sticks' movement or the trip, for another one."""
        self._sticks = None
        self.travel.interrupt()

    def travel_on(
        self, legs: Sequence[Leg], pace: Pace, ending: Ending, *, ignores_sticks: bool = False
    ) -> None:
        """Start a trip in place of the present movement, which the sticks may interrupt or not."""
        self.interrupt()
        self._ignores_sticks = ignores_sticks
        self.travel.start(legs, pace, ending)

    def update(self, state: WorldState) -> None:
        """Steer by the sticks until they expire, and publish the flying state."""
        if self._sticks is not None:
            if state.flying not in AIRBORNE:
                self._sticks = None
            elif state.captured_s - self._sticks_s > EXPIRY_S:
                self.hover()
            else:
                self._steer(self._sticks, state)
        if state.captured_s >= self._emergency_until_s:
            name = state.flying.value.replace("_", "")
            ramping = state.flying is FlyingState.TAKING_OFF and not state.lifting
            self.states.set(_EVENT, state="motor_ramping" if ramping else name)

    def _take_off(self, _values: Values, state: WorldState) -> None:
        if state.flying is FlyingState.LANDING or (
            state.flying is FlyingState.LANDED and self.may_take_off
        ):
            self.world.move(TakeOff())

    def _user_take_off(self, values: Values, state: WorldState) -> None:
        # A real drone waits with spinning motors until it is thrown; this one takes off at once.
        if values["state"]:
            self._take_off(values, state)
        elif state.flying is FlyingState.TAKING_OFF and not state.lifting:
            self.land()

    def _land(self, _values: Values, state: WorldState) -> None:
        if state.flying not in (FlyingState.LANDED, FlyingState.EMERGENCY):
            self.land()

    def _stop_motors(self, _values: Values, state: WorldState) -> None:
        self.interrupt()
        self.world.move(CutMotors())
        self.states.set(_EVENT, state="emergency")
        self._emergency_until_s = state.captured_s + _EMERGENCY_S

    def _pcmd(self, values: Values, state: WorldState) -> None:
        if state.flying not in AIRBORNE:
            return
        velocity = self._velocity(values)
        if velocity == Velocity():
            if self._sticks is not None:
                self.hover()
            return
        if self._sticks is None:
            if self.travel.running and self._ignores_sticks:
                return
            self.interrupt()
            self._speed_mps = (state.velocity.forward_mps, state.velocity.right_mps)
            self._steered_s = state.captured_s
        self._sticks, self._sticks_s = velocity, state.captured_s
        self._steer(velocity, state)

    def _settings(self) -> tuple[float, float, float]:
        """Return the client's limits: tilt, rad; climb, m/s; rotation, rad/s."""
        value = self.states.value
        return (
            math.radians(value("ardrone3.PilotingSettingsState.MaxTiltChanged")),
            value("ardrone3.SpeedSettingsState.MaxVerticalSpeedChanged"),
            math.radians(value("ardrone3.SpeedSettingsState.MaxRotationSpeedChanged")),
        )

    def _velocity(self, values: Values) -> Velocity:
        """Return the steady velocity of stick positions, which are per cent of the settings."""
        tilt_rad, climb_mps, turn_radps = self._settings()
        limits, names = self.world.pace, ("roll", "pitch", "yaw", "gaz")
        roll, pitch, yaw, gaz = (clamp(values[name] / 100.0, 1.0) for name in names)
        if not values["flag"]:
            roll = pitch = 0.0
        forward_mps, right_mps = limit_length(
            _steady_mps(pitch * tilt_rad), _steady_mps(roll * tilt_rad), limits.speed_mps
        )
        return Velocity(
            forward_mps=forward_mps,
            right_mps=right_mps,
            down_mps=-clamp(gaz * climb_mps, limits.climb_mps),
            yaw_rate_radps=clamp(yaw * turn_radps, limits.yaw_rate_radps),
        )

    def _steer(self, velocity: Velocity, state: WorldState) -> None:
        """Approach the steady velocity of the sticks as drag allows, below the ceiling."""
        gained = 1.0 - math.exp(-_DRAG_PER_S * (state.captured_s - self._steered_s))
        self._steered_s = state.captured_s
        forward_mps, right_mps = self._speed_mps
        forward_mps += gained * (velocity.forward_mps - forward_mps)
        right_mps += gained * (velocity.right_mps - right_mps)
        self._speed_mps = (forward_mps, right_mps)
        down_mps = velocity.down_mps
        if state.altitude_m >= self.ceiling_m:
            down_mps = max(0.0, down_mps)
        self.world.move(
            replace(velocity, forward_mps=forward_mps, right_mps=right_mps, down_mps=down_mps)
        )


def _steady_mps(tilt_rad: float) -> float:
    """Return the speed at which drag balances a tilt."""
    return _SPEED_PER_TILT_MPS * math.tan(tilt_rad)
