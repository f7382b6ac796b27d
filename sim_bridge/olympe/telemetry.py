"""The drone's events, as one `DroneState`."""

from __future__ import annotations

import logging
import math
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

from sim_bridge.olympe.moves import MoveLedger
from uav_bt.types import Attitude, BodyVelocity, DroneState, FlyingState

STANDING_M: Final = 0.05  # the body's centre above what the drone stands on

_LOG: Final = logging.getLogger(__name__)

_FLYING: Final = {
    "landed": FlyingState.LANDED,
    "motor_ramping": FlyingState.TAKING_OFF,
    "usertakeoff": FlyingState.TAKING_OFF,
    "takingoff": FlyingState.TAKING_OFF,
    "hovering": FlyingState.HOVERING,
    "flying": FlyingState.FLYING,
    "landing": FlyingState.LANDING,
    "emergency_landing": FlyingState.LANDING,
    "emergency": FlyingState.EMERGENCY,
}
_NO_MOVES: Final = frozenset(
    {FlyingState.LANDED, FlyingState.LANDING, FlyingState.EMERGENCY, FlyingState.TAKING_OFF}
)
_CALM: Final = frozenset({"none", "NONE"})
_BEST_LINK: Final = 5.0  # ARSDK, common.CommonState.LinkSignalQuality: 1 to 5 in the lower bits
_LINK_BITS: Final = 0x0F


@dataclass(frozen=True, kw_only=True)
class _Known:
    """The latest values, in the drone's terms."""

    received_s: float = -math.inf
    flying: FlyingState = FlyingState.LANDED
    attitude: Attitude = field(default_factory=Attitude)
    north_mps: float = 0.0
    east_mps: float = 0.0
    down_mps: float = 0.0
    altitude_m: float = 0.0
    ground_m: float | None = None  # only some firmware has the event
    gimbal_pitch_rad: float = 0.0
    battery: float = 1.0
    link: float = 1.0
    pilot_has_control: bool = False


class Telemetry:
    """Takes events on the SDK's threads, gives states on the mission's.

    Args:
        now: the clock.
        take_off_surface_m: height of what it takes off from above the carpet, m.
    """

    def __init__(self, now: Callable[[], float], *, take_off_surface_m: float = 0.0) -> None:
        self._now = now
        self._above_carpet_m = take_off_surface_m + STANDING_M
        self._lock = threading.Lock()
        self._known = _Known()
        self._moves = MoveLedger()
        self._handlers: dict[str, Callable[[Mapping[str, Any]], dict[str, Any]]] = {
            "ardrone3.PilotingState.FlyingStateChanged": self._flying,
            "ardrone3.PilotingState.AttitudeChanged": _attitude,
            "ardrone3.PilotingState.SpeedChanged": _speed,
            "ardrone3.PilotingState.AltitudeChanged": lambda a: {"altitude_m": a["altitude"]},
            "ardrone3.PilotingState.AltitudeAboveGroundChanged": lambda a: {
                "ground_m": a["altitude"]
            },
            "ardrone3.PilotingState.AlertStateChanged": _alert,
            "ardrone3.PilotingEvent.moveByEnd": self._move_ended,
            "common.CommonState.BatteryStateChanged": lambda a: {"battery": a["percent"] / 100.0},
            "common.CommonState.LinkSignalQuality": _link,
            "gimbal.attitude": lambda a: {"gimbal_pitch_rad": math.radians(a["pitch_absolute"])},
            "skyctrl.CoPilotingState.pilotingSource": lambda a: {
                "pilot_has_control": a["source"] == "SkyController"
            },
        }

    def take(self, name: str, args: Mapping[str, Any]) -> None:
        """Take an event.

        Args:
            name: its full name.
            args: its arguments, enumerations as names.
        """
        with self._lock:
            handler = self._handlers.get(name)
            changes = handler(args) if handler is not None else {}
            self._known = replace(self._known, received_s=self._now(), **changes)

    def state(self) -> DroneState:
        """Return the state as of the newest event."""
        with self._lock:
            known, movement = self._known, self._moves.status
        height_m = known.altitude_m + STANDING_M if known.ground_m is None else known.ground_m
        return DroneState(
            captured_s=known.received_s,
            flying=known.flying,
            attitude=known.attitude,
            velocity=self._velocity(known),
            altitude_m=known.altitude_m,
            height_m=max(0.0, height_m),
            height_above_carpet_m=known.altitude_m + self._above_carpet_m,
            gimbal_pitch_rad=known.gimbal_pitch_rad,
            battery=known.battery,
            link=known.link,
            movement=movement,
            pilot_has_control=known.pilot_has_control,
        )

    def with_moves(self, change: Callable[[MoveLedger], None]) -> None:
        """Change the ledger of movements while no event does."""
        with self._lock:
            change(self._moves)

    @property
    def moving(self) -> bool:
        """Whether the latest `MoveBy` is under way and wanted."""
        with self._lock:
            return self._moves.moving

    def _flying(self, args: Mapping[str, Any]) -> dict[str, Any]:
        state = _FLYING.get(args["state"])
        if state is None:
            _LOG.warning("the drone reports an unknown flying state: %s", args["state"])
            return {}
        if state in _NO_MOVES:
            self._moves.drop()
        return {"flying": state}

    def _move_ended(self, args: Mapping[str, Any]) -> dict[str, Any]:
        self._moves.ended(args["error"], (args["dX"], args["dY"], args["dZ"], args["dPsi"]))
        return {}

    @staticmethod
    def _velocity(known: _Known) -> BodyVelocity:
        cosine, sine = math.cos(known.attitude.yaw_rad), math.sin(known.attitude.yaw_rad)
        return BodyVelocity(
            forward_mps=cosine * known.north_mps + sine * known.east_mps,
            right_mps=cosine * known.east_mps - sine * known.north_mps,
            down_mps=known.down_mps,
        )


def _attitude(args: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "attitude": Attitude(roll_rad=args["roll"], pitch_rad=args["pitch"], yaw_rad=args["yaw"])
    }


def _speed(args: Mapping[str, Any]) -> dict[str, Any]:
    return {"north_mps": args["speedX"], "east_mps": args["speedY"], "down_mps": args["speedZ"]}


def _link(args: Mapping[str, Any]) -> dict[str, Any]:
    return {"link": min(1.0, (int(args["value"]) & _LINK_BITS) / _BEST_LINK)}


def _alert(args: Mapping[str, Any]) -> dict[str, Any]:
    if args["state"] not in _CALM:
        _LOG.warning("the drone raises an alert: %s", args["state"])
    return {}
