"""Faults that an ANAFI reports and that must be fixed before an indoor flight."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from typing import Any, Final

from uav_bt.types import DroneFault

_LOG: Final = logging.getLogger(__name__)

_CALIBRATE: Final = "calibrate it with FreeFlight"
_RESTART: Final = "restart the drone; if that does not help, it needs repair"
_OUTDOORS: Final = frozenset({"gps", "GPS"})  # not needed indoors
_ZOOMED: Final = 1.01  # zoom level above which it is zoomed in; chosen: above float32 rounding
_AUTO_TRIGGER: Final = "rth.auto_trigger_mode"

# Faults in an event, by part of the drone; None: the part works.
Findings = Mapping[str, DroneFault | None]


class SelfReport:
    """Stores the faults in the drone's latest events.

    Args:
        return_home: whether the automatic return home is wanted; None accepts both.
    """

    def __init__(self, *, return_home: bool | None = None) -> None:
        self._return_home = return_home
        self._wrong: dict[str, DroneFault] = {}
        self._received: set[str] = set()

    def take(self, name: str, args: Mapping[str, Any]) -> None:
        """Process an event.

        Args:
            name: full name of the event.
            args: arguments of the event, enumerations as names.
        """
        self._received.add(name)
        reader = _READERS.get(name)
        for key, fault in (reader(args) if reader is not None else {}).items():
            if fault is None:
                self._wrong.pop(key, None)
            elif self._wrong.get(key) != fault:
                self._wrong[key] = fault
                _LOG.warning("the drone reports: %s: %s", fault.what, fault.found)

    @property
    def faults(self) -> tuple[DroneFault, ...]:
        """All present faults."""
        faults = tuple(self._wrong.values())
        # It is switched off before a take-off if the firmware has the setting.
        if self._return_home is False and _AUTO_TRIGGER not in self._received:
            faults += (_RETURNS_HOME,)
        return faults


_RETURNS_HOME: Final = DroneFault(
    what="return home",
    found="the site file requires it to be off, but this firmware cannot switch it off",
    remedy="update the firmware to 1.7 or later, or leave 'return_home' out of the site file",
)


def _light(args: Mapping[str, Any]) -> Findings:
    fault = DroneFault(
        what="light",
        found="too dark to hover without GPS",
        remedy="switch lights on, and put it on a floor with texture",
    )
    return {"light": fault if args["no_gps_too_dark"] else None}


def _magnetometer(args: Mapping[str, Any]) -> Findings:
    # The value 2 only recommends a calibration.
    fault = DroneFault(what="magnetometer", found="needs a calibration", remedy=_CALIBRATE)
    return {"magnetometer": fault if args["required"] == 1 else None}


def _sensor(args: Mapping[str, Any]) -> Findings:
    name = str(args["sensorName"])
    fault = DroneFault(what=name.replace("_", " "), found="does not work", remedy=_RESTART)
    return {f"sensor {name}": None if args["sensorState"] or name in _OUTDOORS else fault}


def _motors(args: Mapping[str, Any]) -> Findings:
    error = str(args["motorError"])
    motors = [str(index + 1) for index in range(4) if int(args["motorIds"]) >> index & 1]
    fault = DroneFault(
        what=f"motor {', '.join(motors)}" if motors else "motors",
        found=error,
        remedy="check that all propellers turn freely, and restart the drone",
    )
    return {"motors": None if error == "noError" else fault}


def _gimbal_calibration(args: Mapping[str, Any]) -> Findings:
    fault = DroneFault(what="gimbal", found="needs a calibration", remedy=_CALIBRATE)
    return {"gimbal calibration": fault if args["state"] == "required" else None}


def _gimbal_alert(args: Mapping[str, Any]) -> Findings:
    error = args["error"]
    fault = DroneFault(
        what="gimbal",
        found=f"reports an error ({error})",
        remedy="remove its protection, let it move freely, and restart the drone",
    )
    return {"gimbal alert": fault if error else None}


def _zoom(args: Mapping[str, Any]) -> Findings:
    level = float(args["level"])
    fault = DroneFault(
        what="camera",
        found=f"zoomed in, {level:.1f} times: the camera file does not describe its images",
        remedy="reset the zoom with FreeFlight",
    )
    return {"zoom": fault if level > _ZOOMED else None}


def _alert(args: Mapping[str, Any]) -> Findings:
    state = str(args["state"])
    # A low battery is detected by its charge.
    calm = state.lower() == "none" or "battery" in state
    fault = DroneFault(what="alert", found=state.replace("_", " "), remedy=_RESTART)
    return {"alert": None if calm else fault}


def _checklist(args: Mapping[str, Any]) -> Findings:
    name = str(args.get("check"))
    fault = DroneFault(
        what="take-off checklist",
        found=f"{name.replace('_', ' ')} prevents a take-off",
        remedy="see what FreeFlight says about it",
    )
    return {f"checklist {name}": fault if _on(args) and name not in _OUTDOORS else None}


def _alarm(args: Mapping[str, Any]) -> Findings:
    name = str(args.get("type"))
    fault = DroneFault(
        what="alarm", found=name.replace("_", " "), remedy="see what FreeFlight says about it"
    )
    return {f"alarm {name}": fault if _on(args) else None}


def _on(args: Mapping[str, Any]) -> bool:
    return str(args.get("state")) == "on"


_READERS: Final[Mapping[str, Callable[[Mapping[str, Any]], Findings]]] = {
    "ardrone3.PilotingState.HoveringWarning": _light,
    "ardrone3.PilotingState.AlertStateChanged": _alert,
    "ardrone3.SettingsState.MotorErrorStateChanged": _motors,
    "common.CalibrationState.MagnetoCalibrationRequiredState": _magnetometer,
    "common.CommonState.SensorsStatesListChanged": _sensor,
    "camera.zoom_level": _zoom,
    "gimbal.calibration_state": _gimbal_calibration,
    "gimbal.alert": _gimbal_alert,
    "alarms.takeoff_checklist": _checklist,
    "alarms.alarms": _alarm,
}
