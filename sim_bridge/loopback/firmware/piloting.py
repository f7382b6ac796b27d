"""Take-off, landing, emergency stop, and the sticks (class ardrone3.Piloting)."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Final

from sim_bridge.loopback.firmware.core import SPEED_PER_TILT_MPS, Core, Part
from sim_bridge.loopback.firmware.publisher import Values
from sim_bridge.loopback.firmware.settings import Settings
from sim_bridge.loopback.world import WorldLimits, WorldState
from uav_bt.types import CutMotors, FlyingState, Hover, Land, TakeOff, Velocity
from uav_bt.types.pose import clamp, limit_length

AIRBORNE: Final = (FlyingState.HOVERING, FlyingState.FLYING)

_EVENT: Final = "ardrone3.PilotingState.FlyingStateChanged"
# Time for which an emergency stop is published even on the ground, because clients wait for it, s.
_EMERGENCY_S: Final = 0.5
_NAMES: Final = {
    FlyingState.LANDED: "landed",
    FlyingState.TAKING_OFF: "takingoff",
    FlyingState.HOVERING: "hovering",
    FlyingState.FLYING: "flying",
    FlyingState.LANDING: "landing",
    FlyingState.EMERGENCY: "emergency",
}


class Flight(Part):
    """Handles take-off, landing and emergency stop."""

    def __init__(self, core: Core) -> None:
        super().__init__(core)
        self.handlers = {
            "ardrone3.Piloting.TakeOff": self._take_off,
            "ardrone3.Piloting.UserTakeOff": self._user_take_off,
            "ardrone3.Piloting.Landing": self._land,
            "ardrone3.Piloting.Emergency": self._stop_motors,
        }
        self._emergency_until_s = 0.0
        self.may_take_off = True  # False while the battery is critical

    def update(self, state: WorldState) -> None:
        """Publish the flying state."""
        if state.time_s < self._emergency_until_s:
            return
        name = _NAMES[state.flying]
        if state.flying is FlyingState.TAKING_OFF and not state.lifting:
            name = "motor_ramping"
        self._core.publisher.state(_EVENT, state=name)

    def land(self) -> None:
        """Land at the present position."""
        self._core.interrupt()
        self._core.world.move(Land())

    def _take_off(self, _values: Values, state: WorldState) -> None:
        if state.flying is FlyingState.LANDING or (
            state.flying is FlyingState.LANDED and self.may_take_off
        ):
            self._core.world.move(TakeOff())

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
        self._core.interrupt()
        self._core.world.move(CutMotors())
        self._core.publisher.state(_EVENT, state="emergency")
        self._emergency_until_s = state.time_s + _EMERGENCY_S


EXPIRY_S: Final = 0.5  # s after which old stick positions count as centred; clients send at 20 Hz
# Drag: share of the speed lost per second. A tilt causes an acceleration until drag balances it
# at `SPEED_PER_TILT_MPS` times the tangent of the tilt.
_DRAG_PER_S: Final = 9.81 / SPEED_PER_TILT_MPS
_SPEED: Final = "ardrone3.SpeedSettingsState"
_TILT: Final = "ardrone3.PilotingSettingsState.MaxTiltChanged"


@dataclass(frozen=True, kw_only=True)
class Sticks:
    """Percentages from -100 to 100: right, forward, clockwise and up are positive."""

    roll: int = 0
    pitch: int = 0
    yaw: int = 0
    gaz: int = 0

    @property
    def centred(self) -> bool:
        """Whether all sticks are centred."""
        return not (self.roll or self.pitch or self.yaw or self.gaz)


def velocity_of(sticks: Sticks, settings: Settings, limits: WorldLimits) -> Velocity:
    """Return the velocity that stick positions command.

    Roll and pitch are shares of the largest tilt, and a tilt gives a speed. Yaw and gaz are shares
    of the largest rates.

    Args:
        sticks: the stick positions, per cent.
        settings: largest tilt and rates, set by a client.
        limits: limits of the body.
    """
    tilt_rad = math.radians(settings.value(_TILT))

    def speed(percent: int) -> float:
        return SPEED_PER_TILT_MPS * math.tan(percent / 100.0 * tilt_rad)

    forward_mps, right_mps = limit_length(
        speed(sticks.pitch), speed(sticks.roll), limits.max_speed_mps
    )
    climb = sticks.gaz / 100.0 * settings.value(f"{_SPEED}.MaxVerticalSpeedChanged")
    turn = sticks.yaw / 100.0 * math.radians(settings.value(f"{_SPEED}.MaxRotationSpeedChanged"))
    return Velocity(
        forward_mps=forward_mps,
        right_mps=right_mps,
        down_mps=-clamp(climb, limits.max_climb_mps),
        yaw_rate_radps=clamp(turn, limits.max_yaw_rate_radps),
    )


class Piloting(Part):
    """Follows the sticks unless another movement has priority.

    Args:
        core: shared state of the parts.
        claim: returns whether deflected sticks may move the drone now; ends other movements.
    """

    def __init__(self, core: Core, claim: Callable[[], bool]) -> None:
        super().__init__(core)
        self.handlers = {"ardrone3.Piloting.PCMD": self._pcmd}
        self._claim = claim
        self._sticks = Sticks()
        self._received_s = -math.inf
        self._steering = False
        self._speed_mps = (0.0, 0.0)  # present speed from the sticks: forward, right
        self._steered_s = 0.0

    def release(self) -> None:
        """Stop following the sticks, for another movement."""
        self._steering = False
        self._sticks = Sticks()

    def update(self, state: WorldState) -> None:
        """Hover when the stick positions expire; keep below the altitude limit."""
        if not self._steering:
            return
        if state.flying not in AIRBORNE:
            self.release()
        elif state.time_s - self._received_s > EXPIRY_S:
            self._hover()
        else:
            self._steer(state)

    def _pcmd(self, values: Values, state: WorldState) -> None:
        moving = bool(values["flag"])
        sticks = Sticks(
            roll=_percent(values["roll"]) if moving else 0,
            pitch=_percent(values["pitch"]) if moving else 0,
            yaw=_percent(values["yaw"]),
            gaz=_percent(values["gaz"]),
        )
        self._received_s = state.time_s
        if state.flying not in AIRBORNE:
            return
        if sticks.centred:
            if self._steering:
                self._hover()
        elif self._steering or self._claim():
            if not self._steering:
                self._speed_mps = (state.velocity.forward_mps, state.velocity.right_mps)
                self._steered_s = state.time_s
            self._steering, self._sticks = True, sticks
            self._steer(state)

    def _hover(self) -> None:
        self.release()
        self._core.world.move(Hover())

    def _steer(self, state: WorldState) -> None:
        order = velocity_of(self._sticks, self._core.settings, self._core.world.limits)
        if state.altitude_m >= self._core.ceiling_m and order.down_mps < 0.0:
            order = replace(order, down_mps=0.0)
        gained = 1.0 - math.exp(-_DRAG_PER_S * (state.time_s - self._steered_s))
        self._steered_s = state.time_s
        forward_mps, right_mps = self._speed_mps
        forward_mps += gained * (order.forward_mps - forward_mps)
        right_mps += gained * (order.right_mps - right_mps)
        self._speed_mps = (forward_mps, right_mps)
        self._core.world.move(replace(order, forward_mps=forward_mps, right_mps=right_mps))


def _percent(value: int) -> int:
    return max(-100, min(100, value))
