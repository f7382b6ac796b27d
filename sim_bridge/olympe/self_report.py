"""What an ANAFI reports about itself that should be mended before it flies indoors."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping
from typing import Any, Final

from uav_bt.types import DroneFault

_LOG: Final = logging.getLogger(__name__)

_CALIBRATE: Final = "calibrate it with FreeFlight"
_RESTART: Final = "restart the drone; if that does not help, it needs repair"
_OUTDOORS: Final = frozenset({"gps", "GPS"})  # nobody needs it indoors
_ZOOMED: Final = 1.01  # zoom level; chosen: float32 rounds 1.0 by far less. Above: zoomed in.
_AUTO_TRIGGER: Final = "rth.auto_trigger_mode"

# The faults that an event reports, by the part of the drone; None: that part works.
Findings = Mapping[str, DroneFault | None]


class SelfReport:
    """Keeps the faults of the drone, as of its latest events.

    Args:
        return_home: whether its automatic return home is wanted; None where that does not matter.
    """

    def __init__(self, *, return_home: bool | None = None) -> None:
        self._return_home = return_home
        self._wrong: dict[str, DroneFault] = {}
        self._received: set[str] = set()

    def take(self, name: str, args: Mapping[str, Any]) -> None:
        """Take an event.

        Args:
            name: its full name.
            args: its arguments, enumerations as names.
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
        """All that is wrong."""
        faults = tuple(self._wrong.values())
        # It is switched off before a take-off, on firmware that knows how.
        if self._return_home is False and _AUTO_TRIGGER not in self._received:
            faults += (_RETURNS_HOME,)
        return faults


_RETURNS_HOME: Final = DroneFault(
    what="return home",
    found="this firmware does not let a program switch it off, as the site file wants",
    remedy="update the firmware to 1.7 or later, or leave 'return_home' out of the site file",
)


def _light(args: Mapping[str, Any]) -> Findings:
    fault = DroneFault(
        what="light",
        found="too dark to hover without GPS",
        remedy="switch lights on, and let it stand above a floor with texture",
    )
    return {"light": fault if args["no_gps_too_dark"] else None}


def _magnetometer(args: Mapping[str, Any]) -> Findings:
    # 2 only recommends a calibration.
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
        remedy="see that all propellers turn freely, and restart the drone",
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
        remedy="take its protection off, let it move freely, and restart the drone",
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
    # A low battery is checked by its charge.
    calm = state.lower() == "none" or "battery" in state
    fault = DroneFault(what="alert", found=state.replace("_", " "), remedy=_RESTART)
    return {"alert": None if calm else fault}


def _checklist(args: Mapping[str, Any]) -> Findings:
    name = str(args.get("check"))
    fault = DroneFault(
        what="take-off checklist",
        found=f"{name.replace('_', ' ')} keeps it from taking off",
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
