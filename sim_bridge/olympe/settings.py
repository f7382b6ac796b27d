"""The drone's own limits, changed for a flight and restored after it."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

_LOG: Final = logging.getLogger(__name__)

Send = Callable[..., Any]  # a command's name and arguments to the SDK's expectation of an answer


@dataclass(frozen=True, kw_only=True)
class Setting:
    """A setting of the drone."""

    command: str
    argument: str  # of the command
    event: str  # that reports it
    reported: str  # the argument of the event


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
ROTATION: Final = _current("Speed", "MaxRotationSpeed")  # degrees a second
BANKED_TURN: Final = Setting(
    command="ardrone3.PilotingSettings.BankedTurn",
    argument="value",
    event="ardrone3.PilotingSettingsState.BankedTurnChanged",
    reported="state",
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
    """Changes settings, remembers how they were, and puts them back.

    Args:
        send: sends a command.
        limit_s: how long the drone may take to confirm, s.
    """

    def __init__(self, send: Send, limit_s: float) -> None:
        self._send = send
        self._limit_s = limit_s
        self._reported: dict[Setting, Any] = {}
        self._before: dict[Setting, Any] = {}

    def take(self, name: str, args: Mapping[str, Any]) -> None:
        """Take an event of the drone.

        Args:
            name: its full name.
            args: its arguments, enumerations as names.
        """
        setting = _BY_EVENT.get(name)
        if setting is not None:
            self._reported[setting] = args[setting.reported]

    def change(self, wanted: Mapping[Setting, Any]) -> None:
        """Change settings and wait until the drone has confirmed them; warn where it has not."""
        for setting in wanted:
            if setting in self._reported:
                self._before.setdefault(setting, self._reported[setting])
        self._write(wanted)

    def restore(self) -> None:
        """Put the settings back as they were before the first change."""
        before, self._before = self._before, {}
        self._write(before)

    def _write(self, values: Mapping[Setting, Any]) -> None:
        asked = {
            setting: self._send(setting.command, **{setting.argument: value})
            for setting, value in values.items()
        }
        for setting, answer in asked.items():
            answer.wait(_timeout=self._limit_s)
            # Not all firmware knows banked turns.
            if not answer.success() and setting is not BANKED_TURN:
                _LOG.warning("the drone does not confirm %s = %s", setting.command, values[setting])
