"""Faults that an ANAFI reports and that must be fixed before an indoor flight."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple

from uav_bt.types import DroneFault

_LOG: Final = logging.getLogger(__name__)

Args = Mapping[str, Any]

_CALIBRATE: Final = "calibrate it with FreeFlight"
_RESTART: Final = "restart the drone; if that does not help, it needs repair"
_ASK: Final = "see what FreeFlight says about it"
_OUTDOORS: Final = frozenset({"gps", "GPS"})  # not needed indoors
_ZOOMED: Final = 1.01  # zoom level above which it is zoomed in; chosen: above float32 rounding
_AUTO_TRIGGER: Final = "rth.auto_trigger_mode"
_RETURNS_HOME: Final = DroneFault(
    what="return home",
    found="the site file requires it to be off, but this firmware cannot switch it off",
    remedy="update the firmware to 1.7 or later, or leave 'return_home' out of the site file",
)


class _Report(NamedTuple):
    """The fault that an event can report; its texts are formats of the event's arguments."""

    what: str
    found: str
    remedy: str
    is_wrong: Callable[[Args], bool]
    part: str = ""  # the argument that names the part, where each part has events of its own


def _is(name: str, value: object) -> Callable[[Args], bool]:
    return lambda args: bool(args[name] == value)


def _alerts(args: Args) -> bool:
    # A low battery is detected by its charge.
    return args["state"].lower() != "none" and "battery" not in args["state"]


def _fails(args: Args) -> bool:
    return not args["sensorState"] and args["sensorName"] not in _OUTDOORS


def _prevents(args: Args) -> bool:
    return args["state"] == "on" and args["check"] not in _OUTDOORS


_REPORTS: Final = {
    "ardrone3.PilotingState.HoveringWarning": _Report(
        "light",
        "too dark to hover without GPS",
        "switch lights on, and put it on a floor with texture",
        _is("no_gps_too_dark", 1),
    ),
    "ardrone3.PilotingState.AlertStateChanged": _Report("alert", "{state}", _RESTART, _alerts),
    "ardrone3.SettingsState.MotorErrorStateChanged": _Report(
        "motors",
        "{motorError} of {motors}",
        "check that all propellers turn freely, and restart the drone",
        lambda args: args["motorError"] != "noError",
    ),
    # The value 2 only recommends a calibration.
    "common.CalibrationState.MagnetoCalibrationRequiredState": _Report(
        "magnetometer", "needs a calibration", _CALIBRATE, _is("required", 1)
    ),
    "common.CommonState.SensorsStatesListChanged": _Report(
        "{sensorName}", "does not work", _RESTART, _fails, "sensorName"
    ),
    "camera.zoom_level": _Report(
        "camera",
        "zoomed in, {level:.1f} times: the camera file does not describe its images",
        "reset the zoom with FreeFlight",
        lambda args: args["level"] > _ZOOMED,
    ),
    "gimbal.calibration_state": _Report(
        "gimbal", "needs a calibration", _CALIBRATE, _is("state", "required")
    ),
    "gimbal.alert": _Report(
        "gimbal",
        "reports an error ({error})",
        "remove its protection, let it move freely, and restart the drone",
        lambda args: bool(args["error"]),
    ),
    "alarms.takeoff_checklist": _Report(
        "take-off checklist", "{check} prevents a take-off", _ASK, _prevents, "check"
    ),
    "alarms.alarms": _Report("alarm", "{type}", _ASK, _is("state", "on"), "type"),
}


class SelfReport:
    """Stores the faults in the drone's latest events."""

    def __init__(self, *, return_home: bool | None = None) -> None:
        # It is switched off before a take-off if the firmware has the setting.
        self._lacks_setting = return_home is False
        self._wrong: dict[tuple[str, str], DroneFault] = {}  # by event and part

    def take(self, name: str, args: Args) -> None:
        """Process an event, with enumerations as names."""
        if name == _AUTO_TRIGGER:
            self._lacks_setting = False
        if name not in _REPORTS:
            return
        report = _REPORTS[name]
        key = name, str(args.get(report.part))
        if not report.is_wrong(args):
            self._wrong.pop(key, None)
            return
        shown = {**args, "motors": _motors(int(args.get("motorIds", 0)))}
        what, found = (
            text.format(**shown).replace("_", " ") for text in (report.what, report.found)
        )
        fault = DroneFault(what=what, found=found, remedy=report.remedy)
        if self._wrong.get(key) != fault:
            self._wrong[key] = fault
            _LOG.warning("the drone reports: %s: %s", fault.what, fault.found)

    @property
    def faults(self) -> tuple[DroneFault, ...]:
        """All present faults."""
        faults = tuple(self._wrong.values())
        return (*faults, _RETURNS_HOME) if self._lacks_setting else faults


def _motors(bits: int) -> str:
    numbers = [str(index + 1) for index in range(4) if bits >> index & 1]
    return f"motor {', '.join(numbers)}" if numbers else "a motor"
