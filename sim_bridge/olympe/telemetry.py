"""Telemetry: collects the drone's events into one `DroneState`."""

from __future__ import annotations

import logging
import math
import re
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

from sim_bridge.olympe.moves import MoveLedger
from sim_bridge.olympe.self_report import SelfReport
from uav_bt.types import (
    Attitude,
    BodyVelocity,
    DroneFault,
    DroneState,
    FlyingState,
    MeasurementTimes,
    rotate,
)

STANDING_M: Final = 0.05  # height of the body's centre on the ground, m

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
_BEST_LINK: Final = 5.0  # ARSDK, common.CommonState.LinkSignalQuality: 1 to 5 in the lower bits
_LINK_BITS: Final = 0x0F
# Events with a measurement, and the quantity whose time they set. Other events do not change the
# age of the state: a remote control sends 20 per second, even without its drone.
_MEASURES: Final = {
    "ardrone3.PilotingState.AttitudeChanged": "attitude_s",
    "ardrone3.PilotingState.SpeedChanged": "velocity_s",
    "ardrone3.PilotingState.AltitudeChanged": "altitude_s",
    "ardrone3.PilotingState.AltitudeAboveGroundChanged": "height_s",
    "gimbal.attitude": "gimbal_s",
}
_PILOT: Final = "SkyController"  # piloting source of the pilot; this program is "Controller"
_EXTENDED_MOVES: Final = (1, 7)  # first firmware version that accepts speeds of a movement


@dataclass(frozen=True, kw_only=True)
class _Known:
    """The latest values in the units of the drone's events."""

    measured: MeasurementTimes = field(default_factory=lambda: MeasurementTimes.all_at(-math.inf))
    flying: FlyingState = FlyingState.LANDED
    attitude: Attitude = field(default_factory=Attitude)
    north_mps: float = 0.0
    east_mps: float = 0.0
    down_mps: float = 0.0
    altitude_m: float = 0.0
    ground_m: float | None = None  # height above the surface below; only some firmware sends it
    gimbal_pitch_rad: float = 0.0
    battery: float | None = None
    link: float | None = None
    source: str | None = None  # piloting source; None without a remote control
    firmware: tuple[int, ...] = ()


class Telemetry:
    """Receives events on the SDK's threads; returns states on the mission's thread.

    Args:
        now: the clock.
        take_off_surface_m: height of the take-off surface above the ground, m.
        return_home: whether the automatic return home is wanted; None accepts both.
    """

    def __init__(
        self,
        now: Callable[[], float],
        *,
        take_off_surface_m: float = 0.0,
        return_home: bool | None = None,
    ) -> None:
        self._now = now
        self._report = SelfReport(return_home=return_home)
        self._lent = True  # whether the pilot has control without having taken it
        self._above_ground_m = take_off_surface_m + STANDING_M
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
            "ardrone3.PilotingEvent.moveByEnd": self._move_ended,
            "common.CommonState.BatteryStateChanged": lambda a: {"battery": a["percent"] / 100.0},
            "common.CommonState.LinkSignalQuality": _link,
            "gimbal.attitude": lambda a: {"gimbal_pitch_rad": math.radians(a["pitch_absolute"])},
            "common.SettingsState.ProductVersionChanged": _firmware,
            "skyctrl.CoPilotingState.pilotingSource": self._source_changed,
        }

    def take(self, name: str, args: Mapping[str, Any]) -> None:
        """Process an event.

        Args:
            name: full name of the event.
            args: arguments of the event, enumerations as names.
        """
        with self._lock:
            handler = self._handlers.get(name)
            changes = handler(args) if handler is not None else {}
            quantity = _MEASURES.get(name)
            if quantity is not None:
                changes["measured"] = replace(self._known.measured, **{quantity: self._now()})
            self._known = replace(self._known, **changes)
            self._report.take(name, args)

    def state(self) -> DroneState:
        """Return the newest value of each quantity, with the arrival time of its event."""
        with self._lock:
            known, movement, lent = self._known, self._moves.status, self._lent
            faults: tuple[DroneFault, ...] = self._report.faults
        height_m, measured = known.ground_m, known.measured
        if height_m is None:
            height_m = known.altitude_m + STANDING_M
            measured = replace(measured, height_s=measured.altitude_s)
        forward_mps, right_mps = rotate(known.north_mps, known.east_mps, -known.attitude.yaw_rad)
        return DroneState(
            captured_s=measured.oldest_s,
            flying=known.flying,
            attitude=known.attitude,
            velocity=BodyVelocity(
                forward_mps=forward_mps, right_mps=right_mps, down_mps=known.down_mps
            ),
            altitude_m=known.altitude_m,
            height_m=max(0.0, height_m),
            height_above_ground_m=known.altitude_m + self._above_ground_m,
            gimbal_pitch_rad=known.gimbal_pitch_rad,
            battery=known.battery,
            link=known.link,
            movement=movement,
            pilot_has_control=known.source == _PILOT and not lent,
            faults=faults,
            measured=measured,
        )

    @property
    def shares_sticks(self) -> bool:
        """Whether a remote control reports the piloting source."""
        return self._known.source is not None

    @property
    def has_sticks(self) -> bool:
        """Whether a remote control forwards this program's commands instead of its sticks."""
        return self._known.source not in (None, _PILOT)

    @property
    def lent(self) -> bool:
        """Whether the pilot has control because it was given, or has not been requested."""
        return self._lent

    def lend(self) -> None:
        """Record that control is given to the pilot until it is requested again."""
        with self._lock:
            self._lent = True

    @property
    def has_extended_moves(self) -> bool:
        """Whether the firmware accepts speeds of a movement."""
        return self._known.firmware[:2] >= _EXTENDED_MOVES

    def with_moves(self, change: Callable[[MoveLedger], None]) -> None:
        """Change the ledger of movements, protected from concurrent events."""
        with self._lock:
            change(self._moves)

    @property
    def moving(self) -> bool:
        """Whether the latest `MoveBy` is running and was not halted."""
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

    def _source_changed(self, args: Mapping[str, Any]) -> dict[str, Any]:
        if args["source"] != _PILOT:
            self._lent = False
        return {"source": args["source"]}

    def _move_ended(self, args: Mapping[str, Any]) -> dict[str, Any]:
        self._moves.ended(args["error"], (args["dX"], args["dY"], args["dZ"], args["dPsi"]))
        return {}


def _attitude(args: Mapping[str, Any]) -> dict[str, Any]:
    return {
        "attitude": Attitude(roll_rad=args["roll"], pitch_rad=args["pitch"], yaw_rad=args["yaw"])
    }


def _speed(args: Mapping[str, Any]) -> dict[str, Any]:
    return {"north_mps": args["speedX"], "east_mps": args["speedY"], "down_mps": args["speedZ"]}


def _link(args: Mapping[str, Any]) -> dict[str, Any]:
    return {"link": min(1.0, (int(args["value"]) & _LINK_BITS) / _BEST_LINK)}


def _firmware(args: Mapping[str, Any]) -> dict[str, Any]:
    parts = re.findall(r"[0-9]+", str(args["software"]))
    return {"firmware": tuple(int(part) for part in parts)}
