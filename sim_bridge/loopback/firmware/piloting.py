"""Stick positions (PCMD): percentages that come many times a second, and expire."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Final

from sim_bridge.loopback.firmware.flight import AIRBORNE
from sim_bridge.loopback.firmware.part import Core, Part
from sim_bridge.loopback.firmware.publisher import Handler, Values
from sim_bridge.loopback.firmware.settings import Settings
from sim_bridge.loopback.world import WorldLimits, WorldState
from uav_bt.types import Hover, Velocity

EXPIRY_S: Final = 0.5  # s after which old stick positions count as centred; clients send at 20 Hz
# m/s of steady flight at 45 degrees of tilt: at 40 degrees it makes the ANAFI's 15 m/s.
_SPEED_PER_TILT_MPS: Final = 15.0 / math.tan(math.radians(40.0))
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
        """Whether all are centred."""
        return not (self.roll or self.pitch or self.yaw or self.gaz)


def velocity_of(sticks: Sticks, settings: Settings, limits: WorldLimits) -> Velocity:
    """Return the velocity that stick positions ask for.

    Roll and pitch are shares of the greatest tilt, and a tilt makes a speed; yaw and gaz are shares
    of the greatest rates.

    Args:
        sticks: the percentages.
        settings: the greatest tilt and rates, as set by a client.
        limits: what the body can do.
    """
    tilt_rad = math.radians(settings.value(_TILT))

    def speed(percent: int) -> float:
        return _SPEED_PER_TILT_MPS * math.tan(percent / 100.0 * tilt_rad)

    forward, right = speed(sticks.pitch), speed(sticks.roll)
    flat = math.hypot(forward, right)
    share = min(1.0, limits.max_speed_mps / flat) if flat else 1.0
    climb = sticks.gaz / 100.0 * settings.value(f"{_SPEED}.MaxVerticalSpeedChanged")
    turn = sticks.yaw / 100.0 * math.radians(settings.value(f"{_SPEED}.MaxRotationSpeedChanged"))
    return Velocity(
        forward_mps=forward * share,
        right_mps=right * share,
        down_mps=-_clamp(climb, limits.max_climb_mps),
        yaw_rate_radps=_clamp(turn, limits.max_yaw_rate_radps),
    )


class Piloting(Part):
    """Follows the sticks where nothing else moves the drone, or where they interrupt it.

    Args:
        core: what the parts share.
        claim: whether pushed sticks may move the drone now; ends what else moves it.
    """

    def __init__(self, core: Core, claim: Callable[[], bool]) -> None:
        super().__init__(core)
        self._claim = claim
        self._sticks = Sticks()
        self._received_s = -math.inf
        self._steering = False

    def handlers(self) -> Mapping[str, Handler]:
        """Return the commands it handles, by name."""
        return {"ardrone3.Piloting.PCMD": self._pcmd}

    def release(self) -> None:
        """Let something else move the drone."""
        self._steering = False
        self._sticks = Sticks()

    def update(self, state: WorldState) -> None:
        """Hover once stick positions have expired; keep below the greatest altitude."""
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
            self._steering, self._sticks = True, sticks
            self._steer(state)

    def _hover(self) -> None:
        self.release()
        self._core.world.move(Hover())

    def _steer(self, state: WorldState) -> None:
        order = velocity_of(self._sticks, self._core.settings, self._core.world.limits)
        if state.altitude_m >= self._core.ceiling_m and order.down_mps < 0.0:
            order = replace(order, down_mps=0.0)
        self._core.world.move(order)


def _percent(value: int) -> int:
    return max(-100, min(100, value))


def _clamp(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))
