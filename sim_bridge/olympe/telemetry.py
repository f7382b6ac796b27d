"""The drone's events as one `DroneState`, and which `MoveBy` an end event belongs to.

The drone's events carry no id, only distances. The firmware ends every relative movement with one
event, and a second command ends the first one with "interrupted" (ARSDK,
ardrone3.PilotingEvent.moveByEnd). Commands and events cross in transit, so those sent and not yet
ended are kept in order.
"""

from __future__ import annotations

import logging
import math
import threading
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

from uav_bt.types import (
    Attitude,
    BodyVelocity,
    DroneState,
    FlyingState,
    MoveBy,
    MovementState,
    MovementStatus,
    rotate,
)

Displacement = tuple[float, float, float, float]  # forward, right, down in metres; yaw in radians

_REFUSALS: Final = frozenset({"busy", "notAvailable", "unknown"})


@dataclass(frozen=True, kw_only=True)
class _Entry:
    """A movement that was sent and has not ended."""

    id: int | None  # None for the halt that replaces a movement which is no longer wanted
    wanted: Displacement


class MoveLedger:
    """Keeps the movements that were sent to the drone until it reports how they ended."""

    def __init__(self) -> None:
        self._open: deque[_Entry] = deque()
        self.status: MovementStatus | None = None  # of the latest `MoveBy`

    @property
    def moving(self) -> bool:
        """Whether the latest `MoveBy` is still under way and wanted."""
        return bool(self._open) and self._open[-1].id is not None

    def is_latest(self, move: MoveBy) -> bool:
        """Return whether a movement is the one sent last."""
        return self.status is not None and self.status.id == move.id

    def sent(self, move: MoveBy) -> None:
        """Note a movement that is sent to the drone."""
        wanted = (move.forward_m, move.right_m, move.down_m, move.yaw_rad)
        self._open.append(_Entry(id=move.id, wanted=wanted))
        self.status = MovementStatus(id=move.id, state=MovementState.RUNNING)

    def halted(self) -> None:
        """Note that a movement by zero is sent to the drone, which ends the one before."""
        self._open.append(_Entry(id=None, wanted=(0.0, 0.0, 0.0, 0.0)))

    def ended(self, error: str, flown: Displacement) -> None:
        """Handle the drone's end event.

        Args:
            error: the event's: ok, interrupted, busy, notAvailable or unknown.
            flown: the displacement that it reports.
        """
        if not self._open:
            return
        if error in _REFUSALS:
            self._close(self._open.pop(), MovementState.REJECTED)
        elif error == "interrupted":
            self._close(self._open.popleft(), MovementState.INTERRUPTED)
        else:
            # A later command or an earlier event may have been lost: distances show which it is.
            done = min(self._open, key=lambda entry: math.dist(entry.wanted, flown))
            while self._open[0] is not done:
                self._close(self._open.popleft(), MovementState.INTERRUPTED)
            self._close(self._open.popleft(), MovementState.DONE)

    def drop(self, state: MovementState = MovementState.INTERRUPTED) -> None:
        """Close all open movements: the drone landed, or reports nothing any more."""
        while self._open:
            self._close(self._open.popleft(), state)

    def _close(self, entry: _Entry, state: MovementState) -> None:
        if entry.id is not None and self.status is not None and self.status.id == entry.id:
            self.status = MovementStatus(id=entry.id, state=state)


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
        forward_mps, right_mps = rotate(known.north_mps, known.east_mps, -known.attitude.yaw_rad)
        return DroneState(
            captured_s=known.received_s,
            flying=known.flying,
            attitude=known.attitude,
            velocity=BodyVelocity(
                forward_mps=forward_mps, right_mps=right_mps, down_mps=known.down_mps
            ),
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
