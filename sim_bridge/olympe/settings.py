"""Settings of the drone, changed for a flight and restored after it."""

from __future__ import annotations

import logging
import math
import threading
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any, Final

_LOG: Final = logging.getLogger(__name__)
_WIRE_PRECISION: Final = 1e-6  # relative error: events carry float32 (ARSDK), 24-bit mantissa

Send = Callable[..., Any]  # sends a command by name and arguments; does not wait for an answer


@dataclass(frozen=True, kw_only=True)
class Setting:
    """A setting of the drone."""

    command: str
    argument: str  # argument of the command
    event: str  # event that reports the setting
    reported: str  # argument of the event
    optional: bool = False  # True: some firmware lacks it, which causes no warning


def _current(group: str, name: str) -> Setting:
    return Setting(
        command=f"ardrone3.{group}Settings.{name}",
        argument="current",
        event=f"ardrone3.{group}SettingsState.{name}Changed",
        reported="current",
    )


TILT: Final = _current("Piloting", "MaxTilt")  # degrees
ALTITUDE: Final = _current("Piloting", "MaxAltitude")  # m above the take-off point
CLIMB: Final = _current("Speed", "MaxVerticalSpeed")  # m/s
ROTATION: Final = _current("Speed", "MaxRotationSpeed")  # degrees per second
BANKED_TURN: Final = Setting(
    command="ardrone3.PilotingSettings.BankedTurn",
    argument="value",
    event="ardrone3.PilotingSettingsState.BankedTurnChanged",
    reported="state",
    optional=True,
)
RETURN_HOME: Final = Setting(
    command="rth.set_auto_trigger_mode",
    argument="mode",
    event="rth.auto_trigger_mode",
    reported="mode",
)
_ALL: Final = (TILT, ALTITUDE, CLIMB, ROTATION, BANKED_TURN, RETURN_HOME)
_BY_EVENT: Final = {setting.event: setting for setting in _ALL}


class BorrowedSettings:
    """Changes settings, stores their former values, and restores these.

    An event contains the value of a setting, but not the time of its change. So a former value is
    known only if the drone reported it before the change. A warning lists the settings that cannot
    be restored.

    Events arrive on a thread of the SDK; commands are sent on another thread.

    Args:
        send: sends a command.
        now: the clock, s.
        limit_s: timeout of the drone's report of a setting, s.
    """

    def __init__(self, send: Send, now: Callable[[], float], limit_s: float) -> None:
        self._send = send
        self._now = now
        self._limit_s = limit_s
        self._changed = threading.Condition()  # guards all attributes below
        self._reported: dict[Setting, Any] = {}
        self._before: dict[Setting, Any] = {}  # former values; None: not reported
        self._wanted: dict[Setting, Any] = {}  # values of the flight
        self._check_s = math.inf  # deadline of the drone's confirmation

    def take(self, name: str, args: Mapping[str, Any]) -> None:
        """Process an event of the drone.

        Args:
            name: full name of the event.
            args: arguments of the event, enumerations as names.
        """
        setting = _BY_EVENT.get(name)
        if setting is not None:
            with self._changed:
                self._reported[setting] = args[setting.reported]
                self._changed.notify_all()

    def await_reports(self, wanted: Collection[Setting]) -> None:
        """Wait until the drone has reported these settings, for at most `limit_s`."""
        needed = {setting for setting in wanted if not setting.optional}
        with self._changed:
            self._changed.wait_for(lambda: needed <= self._reported.keys(), self._limit_s)

    def change(self, wanted: Mapping[Setting, Any]) -> None:
        """Send new values once, without waiting for an answer; warn about unknown former values."""
        with self._changed:
            self._wanted = dict(wanted)
            self._before = {setting: self._reported.get(setting) for setting in wanted}
            self._check_s = self._now() + self._limit_s
            unknown = [
                setting
                for setting, value in self._before.items()
                if value is None and not setting.optional
            ]
        if unknown:
            _LOG.warning(
                "the drone has not reported its present %s, which therefore cannot be restored "
                "after the flight",
                _names(unknown),
            )
        self._write(wanted)

    def check(self) -> None:
        """Warn once about settings that the drone has not confirmed within `limit_s`."""
        with self._changed:
            if self._now() < self._check_s:
                return
            self._check_s = math.inf
            missing = self._unconfirmed(self._wanted)
        self._warn_of(missing)

    def restore(self) -> None:
        """Send the former values and wait for the answers, for at most `limit_s`."""
        former, left = self._end()
        self._write(former)
        with self._changed:
            self._changed.wait_for(lambda: not self._unconfirmed(former), self._limit_s)
            missing = self._unconfirmed(former)
        self._warn_of(missing)
        _warn_of_left(left)

    def give_up(self) -> None:
        """Warn about settings that are not restored because the drone cannot be reached."""
        former, left = self._end()
        _warn_of_left([*former, *left])

    def _end(self) -> tuple[dict[Setting, Any], list[Setting]]:
        """Return the former values of changed settings, and the settings without one."""
        with self._changed:
            before, self._before, self._check_s = self._before, {}, math.inf
            former = {
                setting: value
                for setting, value in before.items()
                if value is not None and not _is_same(value, self._wanted[setting])
            }
            left = [
                setting
                for setting, value in before.items()
                if value is None and (not setting.optional or setting in self._reported)
            ]
            for setting in former:  # only later reports are answers
                self._reported.pop(setting, None)
            return former, left

    def _write(self, values: Mapping[Setting, Any]) -> None:
        for setting, value in values.items():
            self._send(setting.command, **{setting.argument: value})

    def _unconfirmed(self, asked: Mapping[Setting, Any]) -> dict[Setting, str]:
        """Describe each setting whose latest report differs from the wanted value."""
        return {
            setting: f"{setting.command} = {value} (it reports {self._reported.get(setting)})"
            for setting, value in asked.items()
            if not _is_same(self._reported.get(setting), value)
        }

    def _warn_of(self, missing: Mapping[Setting, str]) -> None:
        for setting, what in missing.items():
            if not setting.optional:
                _LOG.warning("the drone does not confirm %s within %g s", what, self._limit_s)


def _is_same(reported: Any, value: Any) -> bool:
    if isinstance(reported, float) and isinstance(value, float):
        return math.isclose(reported, value, rel_tol=_WIRE_PRECISION)
    return bool(reported == value)


def _warn_of_left(settings: Collection[Setting]) -> None:
    if settings:
        _LOG.warning(
            "the drone keeps this flight's %s: check them with FreeFlight before the next flight",
            _names(settings),
        )


def _names(settings: Collection[Setting]) -> str:
    return ", ".join(setting.command.rpartition(".")[2] for setting in settings)
