"""The sticks: percentages that come many times a second, and count for nothing once they stop."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

from sim_bridge.loopback.firmware.flight import AIRBORNE
from sim_bridge.loopback.firmware.part import Handler, Values
from sim_bridge.loopback.firmware.settings import Settings
from sim_bridge.loopback.world import World, WorldLimits, WorldState
from uav_bt.types import Hover, Velocity

__all__ = ["EXPIRY_S", "Piloting", "Sticks", "velocity_of"]

EXPIRY_S: Final = 0.5  # s after which silent sticks count as centred; clients send every 25-50 ms
# m/s of steady flight at 45 degrees of tilt: at 40 degrees it makes the ANAFI's 15 m/s.
_SPEED_PER_TILT_MPS: Final = 15.0 / math.tan(math.radians(40.0))
_SPEED: Final = "ardrone3.SpeedSettingsState"
_TILT: Final = "ardrone3.PilotingSettingsState.MaxTiltChanged"
_ALTITUDE: Final = "ardrone3.PilotingSettingsState.MaxAltitudeChanged"


@dataclass(frozen=True, kw_only=True)
class Sticks:
    """Percentages from -100 to 100: right, forward, clockwise and up are positive."""

    roll: int = 0
    pitch: int = 0
    yaw: int = 0
    gaz: int = 0

    @property
    def centred(self) -> bool:
        """Whether nobody pushes."""
        return not (self.roll or self.pitch or self.yaw or self.gaz)


def velocity_of(sticks: Sticks, settings: Settings, limits: WorldLimits) -> Velocity:
    """Return the velocity that sticks ask for.

    Roll and pitch are shares of the greatest tilt, and a tilt makes a speed; yaw and gaz are shares
    of the greatest rates.

    Args:
        sticks: the percentages.
        settings: what the client has set as the greatest.
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


class Piloting:
    """Follows the sticks where nothing else moves the drone, or where they interrupt it."""

    def __init__(self, world: World, settings: Settings, claims: Callable[[], bool]) -> None:
        """Leave the sticks centred.

        Args:
            world: what flies.
            settings: the greatest tilt, speeds and altitude.
            claims: whether pushed sticks may move the drone now; ends what else moves it.
        """
        self._world = world
        self._settings = settings
        self._claims = claims
        self._sticks = Sticks()
        self._heard_s = -math.inf
        self._steering = False

    def handlers(self) -> Mapping[str, Handler]:
        """Return what obeys which command."""
        return {"ardrone3.Piloting.PCMD": self._pcmd}

    def release(self) -> None:
        """Let something else move the drone."""
        self._steering = False
        self._sticks = Sticks()

    def update(self, state: WorldState) -> None:
        """Hover once the sticks fall silent; keep below the greatest altitude."""
        if not self._steering:
            return
        if state.flying not in AIRBORNE:
            self.release()
        elif state.time_s - self._heard_s > EXPIRY_S:
            self.release()
            self._world.move(Hover())
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
        self._heard_s = state.time_s
        if state.flying not in AIRBORNE:
            return
        if sticks.centred:
            if self._steering:
                self.release()
                self._world.move(Hover())
        elif self._steering or self._claims():
            self._steering, self._sticks = True, sticks
            self._steer(state)

    def _steer(self, state: WorldState) -> None:
        order = velocity_of(self._sticks, self._settings, self._world.limits)
        ceiling = min(self._settings.value(_ALTITUDE), self._world.limits.ceiling_m)
        if state.altitude_m >= ceiling and order.down_mps < 0.0:
            order = Velocity(
                forward_mps=order.forward_mps,
                right_mps=order.right_mps,
                yaw_rate_radps=order.yaw_rate_radps,
            )
        self._world.move(order)


def _percent(value: int) -> int:
    return max(-100, min(100, value))


def _clamp(value: float, limit: float) -> float:
    return max(-limit, min(limit, value))
