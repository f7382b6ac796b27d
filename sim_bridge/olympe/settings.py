"""Settings of the drone, changed for a flight and restored after it."""

from __future__ import annotations

import logging
import math
import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from sim_bridge.olympe.config import OlympeConfig
from sim_bridge.olympe.orders import Order
from sim_bridge.olympe.speed import FullSticks

_LOG: Final = logging.getLogger(__name__)

# Timeout of the drone's reports of its settings, before the first flight and after the last one.
# During a flight nothing waits for a report. Chosen: a report usually takes milliseconds.
LIMIT_S: Final = 2.0
_WIRE_PRECISION: Final = 1e-6  # relative error: events carry float32 (ARSDK), 24-bit mantissa


@dataclass(frozen=True)
class _Setting:
    """A setting of the drone."""

    command: str
    event: str  # event that reports the setting
    argument: str = "current"  # argument of the command
    reported: str = "current"  # argument of the event
    optional: bool = False  # True: some firmware lacks it, which causes no warning


def _limit(group: str, name: str) -> _Setting:
    return _Setting(
        f"ardrone3.{group}Settings.{name}", f"ardrone3.{group}SettingsState.{name}Changed"
    )


_TILT: Final = _limit("Piloting", "MaxTilt")  # degrees
_ALTITUDE: Final = _limit("Piloting", "MaxAltitude")  # m above the take-off point
_CLIMB: Final = _limit("Speed", "MaxVerticalSpeed")  # m/s
_ROTATION: Final = _limit("Speed", "MaxRotationSpeed")  # degrees per second
_BANKED_TURN: Final = replace(
    _limit("Piloting", "BankedTurn"), argument="value", reported="state", optional=True
)
_RETURN_HOME: Final = _Setting("rth.set_auto_trigger_mode", "rth.auto_trigger_mode", "mode", "mode")
_Values = Mapping[_Setting, Any]


class BorrowedSettings:
    """Sets the limits of a flight, stores the former values, and restores these.

    An event contains the value of a setting, but not the time of its change. So a former value is
    known only if the drone reported it before the change.

    Events arrive on a thread of the SDK; commands are sent on another thread.
    """

    def __init__(
        self, config: OlympeConfig, send: Callable[[Order], None], now: Callable[[], float]
    ) -> None:
        self._send = send
        self._now = now
        self._wanted: dict[_Setting, float | str] = {
            _TILT: math.degrees(config.tilt_limit_rad),
            _ALTITUDE: config.altitude_limit_m,
            _CLIMB: config.climb_limit_mps,
            _ROTATION: math.degrees(config.yaw_rate_limit_radps),
            _BANKED_TURN: 0,  # a banked turn would move the drone sideways
        }
        if config.return_home is not None:
            self._wanted[_RETURN_HOME] = "on" if config.return_home else "off"
        self._by_event = {setting.event: setting for setting in self._wanted}
        self._changed = threading.Condition()  # guards all attributes below
        self._reported: dict[_Setting, Any] = {}
        self._before: dict[_Setting, Any] = {}  # former values; None: not reported
        self._check_s = math.inf  # deadline of the drone's confirmation

    def take(self, name: str, args: Mapping[str, Any]) -> None:
        """Process an event, with enumerations as names."""
        setting = self._by_event.get(name)
        if setting is not None:
            with self._changed:
                self._reported[setting] = args[setting.reported]
                self._changed.notify_all()

    def full_sticks(self) -> FullSticks:
        """Return the meaning of full sticks, as the drone reports it; without report, as wanted."""
        with self._changed:
            tilt_deg, climb_mps, rotation_degps = (
                float(self._reported.get(setting) or self._wanted[setting])
                for setting in (_TILT, _CLIMB, _ROTATION)
            )
        return FullSticks(math.radians(tilt_deg), climb_mps, math.radians(rotation_degps))

    def await_reports(self) -> None:
        """Wait until the drone has reported its present values, for at most `LIMIT_S`."""
        needed = {setting for setting in self._wanted if not setting.optional}
        with self._changed:
            self._changed.wait_for(lambda: needed <= self._reported.keys(), LIMIT_S)

    def change(self, tilt_rad: float) -> None:
        """Send the values of the flight once, without waiting."""
        with self._changed:
            self._wanted[_TILT] = math.degrees(tilt_rad)
            self._before = {setting: self._reported.get(setting) for setting in self._wanted}
            self._check_s = self._now() + LIMIT_S
        self._write(self._wanted)

    def check(self) -> None:
        """Warn once about settings that the drone has not confirmed within `LIMIT_S`."""
        with self._changed:
            if self._now() >= self._check_s:
                self._check_s = math.inf
                self._warn_of_unconfirmed(self._wanted)

    def restore(self, *, connected: bool) -> None:
        """Send the former values and wait for the answers, for at most `LIMIT_S`.

        A warning names the settings whose former value is unknown, or all if the drone is gone.
        """
        with self._changed:
            before, self._before, self._check_s = self._before, {}, math.inf
            wanted, known = self._wanted, set(self._reported)
            changed = {each: old for each, old in before.items() if not _is_same(old, wanted[each])}
            former = {each: old for each, old in changed.items() if connected and old is not None}
            for setting in former:
                del self._reported[setting]  # only later reports are answers
        self._write(former)
        with self._changed:
            self._changed.wait_for(lambda: not self._unconfirmed(former), LIMIT_S)
            self._warn_of_unconfirmed(former)
        left = [
            each.command.rpartition(".")[2]
            for each in changed
            if each not in former and (not each.optional or each in known)
        ]
        if left:
            _LOG.warning(
                "the drone keeps this flight's %s: check them with FreeFlight before the next "
                "flight",
                ", ".join(left),
            )

    def _write(self, values: _Values) -> None:
        for setting, value in values.items():
            self._send(Order(setting.command, {setting.argument: value}))

    def _unconfirmed(self, asked: _Values) -> list[_Setting]:
        """Return the settings whose latest report differs from the wanted value."""
        reported = self._reported
        return [each for each, value in asked.items() if not _is_same(reported.get(each), value)]

    def _warn_of_unconfirmed(self, asked: _Values) -> None:
        for setting in self._unconfirmed(asked):
            if not setting.optional:
                what = f"{setting.command} = {asked[setting]}"
                found = self._reported.get(setting)
                _LOG.warning(
                    "the drone does not confirm %s (it reports %s) within %g s",
                    what,
                    found,
                    LIMIT_S,
                )


def _is_same(reported: Any, value: Any) -> bool:
    if isinstance(reported, float) and isinstance(value, float):
        return math.isclose(reported, value, rel_tol=_WIRE_PRECISION)
    return bool(reported == value)
