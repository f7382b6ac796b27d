"""Telemetry: collects the drone's events into one `DroneState`."""

from __future__ import annotations

import logging
import math
import re
import threading
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final

from sim_bridge.olympe.config import OlympeConfig
from sim_bridge.olympe.self_report import SelfReport
from uav_bt.types import (
    Attitude,
    BodyVelocity,
    DroneState,
    FlyingState,
    MeasurementTimes,
    MoveBy,
    MovementState,
    MovementStatus,
    rotate,
)

STANDING_M: Final = 0.05  # height of the body's centre on the ground

_LOG: Final = logging.getLogger(__name__)

Args = Mapping[str, Any]

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
_NO_MOVES: Final = frozenset(set(FlyingState) - {FlyingState.HOVERING, FlyingState.FLYING})
_MOVE_ENDED: Final = "ardrone3.PilotingEvent.moveByEnd"
PILOT: Final = "SkyController"  # piloting source of the pilot; this program is "Controller"
_EXTENDED_MOVES: Final = (1, 7)  # first firmware version that accepts speeds of a movement
_REFUSALS: Final = frozenset({"busy", "notAvailable", "unknown"})
Displacement = tuple[float, float, float, float]  # forward, right, down in metres; yaw in radians


@dataclass(frozen=True)
class _Entry:
    """An open movement: sent, but not ended."""

    id: int | None  # None: a halt that replaces a movement
    wanted: Displacement


class MoveLedger:
    """Stores the movements that were sent until the drone reports their end.

    The end events carry no id, only distances. The firmware ends every relative movement with one
    event, and a second command ends the first one with "interrupted" (ARSDK,
    ardrone3.PilotingEvent.moveByEnd). Commands and events cross in transit, so the open movements
    are kept in order.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._open: deque[_Entry] = deque()
        self.status: MovementStatus | None = None  # status of the latest `MoveBy`

    def begin(self, move: MoveBy) -> bool:
        """Record a movement that is sent; return False if it was sent already."""
        with self._lock:
            if self.status is not None and self.status.id == move.id:
                return False
            wanted = (move.forward_m, move.right_m, move.down_m, move.yaw_rad)
            self._open.append(_Entry(move.id, wanted))
            self.status = MovementStatus(id=move.id, state=MovementState.RUNNING)
            return True

    def halt(self) -> bool:
        """Record a movement by zero, which ends the latest one; return False if none is running."""
        with self._lock:
            if not self._open or self._open[-1].id is None:
                return False
            self._open.append(_Entry(None, (0.0, 0.0, 0.0, 0.0)))
            return True

    def ended(self, error: str, flown: Displacement) -> None:
        """Handle the drone's end event: ok, interrupted, busy, notAvailable or unknown."""
        with self._lock:
            if not self._open:
                return
            if error in _REFUSALS:
                self._close(self._open.pop(), MovementState.REJECTED)
            elif error == "interrupted":
                self._close(self._open.popleft(), MovementState.INTERRUPTED)
            else:
                # A command or an event may have been lost, so the nearest displacement is selected.
                done = min(self._open, key=lambda entry: math.dist(entry.wanted, flown))
                while self._open[0] is not done:
                    self._close(self._open.popleft(), MovementState.INTERRUPTED)
                self._close(self._open.popleft(), MovementState.DONE)

    def drop(self) -> None:
        """Close all open movements as interrupted, after a landing."""
        with self._lock:
            while self._open:
                self._close(self._open.popleft(), MovementState.INTERRUPTED)

    def _close(self, entry: _Entry, state: MovementState) -> None:
        if entry.id is not None and self.status is not None and self.status.id == entry.id:
            self.status = MovementStatus(id=entry.id, state=state)


@dataclass(frozen=True, kw_only=True)
class Known:
    """The latest values in the units of the drone's events."""

    measured: MeasurementTimes = field(default_factory=lambda: MeasurementTimes.all_at(-math.inf))
    flying: FlyingState = FlyingState.LANDED
    attitude: Attitude = field(default_factory=Attitude)
    speed_mps: tuple[float, float, float] = (0.0, 0.0, 0.0)  # north, east, down
    altitude_m: float = 0.0
    ground_m: float | None = None  # height above the surface below; only some firmware sends it
    gimbal_pitch_rad: float = 0.0
    battery: float | None = None
    link: float | None = None
    source: str | None = None  # piloting source; None without a remote control
    firmware: tuple[int, ...] = ()

    @property
    def has_extended_moves(self) -> bool:
        """Whether the firmware accepts speeds of a movement."""
        return self.firmware[:2] >= _EXTENDED_MOVES


def _flying(args: Args) -> dict[str, Any]:
    state = _FLYING.get(args["state"])
    if state is None:
        _LOG.warning("the drone reports an unknown flying state: %s", args["state"])
        return {}
    return {"flying": state}


def _attitude(args: Args) -> dict[str, Any]:
    angles = {f"{axis}_rad": args[axis] for axis in ("roll", "pitch", "yaw")}
    return {"attitude": Attitude(**angles)}


def _firmware(args: Args) -> dict[str, Any]:
    parts = re.findall(r"[0-9]+", str(args["software"]))
    return {"firmware": tuple(int(part) for part in parts)}


_READERS: Final[Mapping[str, Callable[[Args], dict[str, Any]]]] = {
    "ardrone3.PilotingState.FlyingStateChanged": _flying,
    "ardrone3.PilotingState.AttitudeChanged": _attitude,
    "ardrone3.PilotingState.SpeedChanged": lambda a: {
        "speed_mps": (a["speedX"], a["speedY"], a["speedZ"])
    },
    "ardrone3.PilotingState.AltitudeChanged": lambda a: {"altitude_m": a["altitude"]},
    "ardrone3.PilotingState.AltitudeAboveGroundChanged": lambda a: {"ground_m": a["altitude"]},
    "common.CommonState.BatteryStateChanged": lambda a: {"battery": a["percent"] / 100.0},
    # 1 to 5 in the lower bits (ARSDK).
    "common.CommonState.LinkSignalQuality": lambda a: {"link": min(1.0, (a["value"] & 0x0F) / 5.0)},
    "common.SettingsState.ProductVersionChanged": _firmware,
    "gimbal.attitude": lambda a: {"gimbal_pitch_rad": math.radians(a["pitch_absolute"])},
    "skyctrl.CoPilotingState.pilotingSource": lambda a: {"source": a["source"]},
}
# Events with a measurement, and the quantity whose time they set. Other events do not change the
# age of the state: a remote control sends 20 per second, even without its drone.
_MEASURES: Final = {
    "ardrone3.PilotingState.AttitudeChanged": "attitude_s",
    "ardrone3.PilotingState.SpeedChanged": "velocity_s",
    "ardrone3.PilotingState.AltitudeChanged": "altitude_s",
    "ardrone3.PilotingState.AltitudeAboveGroundChanged": "height_s",
    "gimbal.attitude": "gimbal_s",
}


class Telemetry:
    """Receives events on the SDK's threads; returns states on the mission's thread."""

    def __init__(self, config: OlympeConfig, now: Callable[[], float]) -> None:
        self._now = now
        self._above_ground_m = config.take_off_surface_m + STANDING_M
        self._report = SelfReport(return_home=config.return_home)
        self._lock = threading.Lock()
        self.moves = MoveLedger()
        self.known = Known()  # replaced as a whole
        self.lent = True  # whether the pilot has control without having taken it

    def take(self, name: str, args: Args) -> None:
        """Process an event, with enumerations as names."""
        with self._lock:
            changes = _READERS[name](args) if name in _READERS else {}
            if name in _MEASURES:
                measured = {_MEASURES[name]: self._now()}
                changes["measured"] = replace(self.known.measured, **measured)
            self.known = replace(self.known, **changes)
            if changes.get("flying") in _NO_MOVES:
                self.moves.drop()
            if changes.get("source", PILOT) != PILOT:
                self.lent = False
            if name == _MOVE_ENDED:
                self.moves.ended(args["error"], (args["dX"], args["dY"], args["dZ"], args["dPsi"]))
            self._report.take(name, args)

    def state(self) -> DroneState:
        """Return the newest value of each quantity, with the arrival time of its event."""
        with self._lock:
            known, lent, faults = self.known, self.lent, self._report.faults
        height_m, measured = known.ground_m, known.measured
        if height_m is None:
            height_m = known.altitude_m + STANDING_M
            measured = replace(measured, height_s=measured.altitude_s)
        north, east, down = known.speed_mps
        ahead, right = rotate(north, east, -known.attitude.yaw_rad)
        velocity = BodyVelocity(forward_mps=ahead, right_mps=right, down_mps=down)
        return DroneState(
            captured_s=measured.oldest_s,
            flying=known.flying,
            attitude=known.attitude,
            velocity=velocity,
            altitude_m=known.altitude_m,
            height_m=max(0.0, height_m),
            height_above_ground_m=known.altitude_m + self._above_ground_m,
            gimbal_pitch_rad=known.gimbal_pitch_rad,
            battery=known.battery,
            link=known.link,
            movement=self.moves.status,
            pilot_has_control=known.source == PILOT and not lent,
            faults=faults,
            measured=measured,
        )
