"""Settings that a client may change: taken within their bounds, and told back."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from sim_bridge.loopback.firmware.announcer import Announcer
from sim_bridge.loopback.firmware.part import Handler, Values
from sim_bridge.loopback.world import WorldState

__all__ = ["SETTINGS", "Setting", "Settings"]


@dataclass(frozen=True, kw_only=True)
class Setting:
    """A command and the event that answers it."""

    command: str
    event: str
    takes: Mapping[str, str]  # the event's argument, and the command's that it takes
    start: Mapping[str, Any]  # all the event's arguments at first; `min` and `max` are bounds


def _bounded(
    where: str, name: str, argument: str, current: float, bounds: tuple[float, float]
) -> Setting:
    return Setting(
        command=f"{where}.{name}",
        event=f"{where}State.{name}Changed",
        takes={"current": argument},
        start={"current": current, "min": bounds[0], "max": bounds[1]},
    )


def _plain(command: str, event: str, argument: str, value: Any, told: str = "") -> Setting:
    told = told or argument
    return Setting(command=command, event=event, takes={told: argument}, start={told: value})


_PILOTING: Final = "ardrone3.PilotingSettings"
_SPEED: Final = "ardrone3.SpeedSettings"
_NETWORK: Final = "ardrone3.NetworkSettings"
_PICTURE: Final = "ardrone3.PictureSettings"

# Bounds and first values are an ANAFI's, as its documentation and its settings page have them.
SETTINGS: Final = (
    _bounded(_PILOTING, "MaxAltitude", "current", 30.0, (0.5, 4000.0)),
    _bounded(_PILOTING, "MaxTilt", "current", 20.0, (5.0, 40.0)),
    _bounded(_PILOTING, "MaxDistance", "value", 100.0, (10.0, 4000.0)),
    _bounded(_PILOTING, "MinAltitude", "current", 0.0, (0.0, 0.0)),
    _plain(
        f"{_PILOTING}.NoFlyOverMaxDistance",
        f"{_PILOTING}State.NoFlyOverMaxDistanceChanged",
        "shouldNotFlyOver",
        0,
    ),
    _plain(f"{_PILOTING}.BankedTurn", f"{_PILOTING}State.BankedTurnChanged", "value", 1, "state"),
    _plain(
        f"{_PILOTING}.SetMotionDetectionMode",
        f"{_PILOTING}State.MotionDetection",
        "enable",
        1,
        "enabled",
    ),
    _bounded(_SPEED, "MaxVerticalSpeed", "current", 1.0, (0.1, 4.0)),
    _bounded(_SPEED, "MaxRotationSpeed", "current", 40.0, (10.0, 200.0)),
    _bounded(_SPEED, "MaxPitchRollRotationSpeed", "current", 200.0, (80.0, 300.0)),
    _plain(f"{_SPEED}.HullProtection", f"{_SPEED}State.HullProtectionChanged", "present", 0),
    _plain(f"{_SPEED}.Outdoor", f"{_SPEED}State.OutdoorChanged", "outdoor", 1),
    Setting(
        command=f"{_NETWORK}.wifiSecurity",
        event=f"{_NETWORK}State.wifiSecurity",
        takes={"type": "type", "key": "key", "keyType": "keyType"},
        start={"type": "open", "key": "", "keyType": "plain"},
    ),
    Setting(
        command=f"{_PICTURE}.VideoAutorecordSelection",
        event=f"{_PICTURE}State.VideoAutorecordChanged",
        takes={"enabled": "enabled", "mass_storage_id": "mass_storage_id"},
        start={"enabled": 0, "mass_storage_id": 0},
    ),
    _plain("common.Settings.ProductName", "common.SettingsState.ProductNameChanged", "name", ""),
    _plain("common.Settings.Country", "common.SettingsState.CountryChanged", "code", "FR"),
    _plain(
        "common.Settings.AutoCountry", "common.SettingsState.AutoCountryChanged", "automatic", 0
    ),
    _plain(
        "common.WifiSettings.OutdoorSetting",
        "common.WifiSettingsState.outdoorSettingsChanged",
        "outdoor",
        0,
    ),
    _plain(
        "common.Common.CurrentDateTime",
        "common.CommonState.CurrentDateTimeChanged",
        "datetime",
        "19700101T000000+0000",
    ),
    _plain("common.Common.CurrentDate", "common.CommonState.CurrentDateChanged", "date", ""),
    _plain("common.Common.CurrentTime", "common.CommonState.CurrentTimeChanged", "time", ""),
    _plain(
        "ardrone3.GPSSettings.HomeType",
        "ardrone3.GPSSettingsState.HomeTypeChanged",
        "type",
        "TAKEOFF",
    ),
    _plain("piloting_style.set_style", "piloting_style.style", "style", "standard"),
    _plain("precise_home.set_mode", "precise_home.mode", "mode", "disabled"),
    _plain("rth.set_preferred_home_type", "rth.preferred_home_type", "type", "takeoff"),
    Setting(
        command="rth.set_delay",
        event="rth.delay",
        takes={"delay": "delay"},
        start={"delay": 60, "min": 0, "max": 120},
    ),
    Setting(
        command="ardrone3.GPSSettings.ReturnHomeDelay",
        event="ardrone3.GPSSettingsState.ReturnHomeDelayChanged",
        takes={"delay": "delay"},
        start={"delay": 60},
    ),
    Setting(
        command="rth.set_min_altitude",
        event="rth.min_altitude",
        takes={"current": "altitude"},
        start={"current": 20.0, "min": 20.0, "max": 100.0},
    ),
    Setting(
        command="rth.set_ending_hovering_altitude",
        event="rth.ending_hovering_altitude",
        takes={"current": "altitude"},
        start={"current": 10.0, "min": 1.0, "max": 100.0},
    ),
    _plain("rth.set_ending_behavior", "rth.ending_behavior", "ending_behavior", "landing"),
    _plain("rth.set_auto_trigger_mode", "rth.auto_trigger_mode", "mode", "on"),
    Setting(
        command="gimbal.set_max_speed",
        event="gimbal.max_speed",
        takes={"current_yaw": "yaw", "current_pitch": "pitch", "current_roll": "roll"},
        start={
            **dict.fromkeys(("min_bound_yaw", "max_bound_yaw", "current_yaw"), 0.0),
            **dict.fromkeys(("min_bound_roll", "max_bound_roll", "current_roll"), 0.0),
            "gimbal_id": 0,
            "min_bound_pitch": 1.0,
            "max_bound_pitch": 180.0,
            "current_pitch": 90.0,
        },
    ),
    Setting(
        command="gimbal.set_offsets",
        event="gimbal.offsets",
        takes={"current_yaw": "yaw", "current_pitch": "pitch", "current_roll": "roll"},
        start={
            "gimbal_id": 0,
            "update_state": "inactive",
            **dict.fromkeys(("min_bound_yaw", "max_bound_yaw", "current_yaw"), 0.0),
            **dict.fromkeys(("min_bound_pitch", "min_bound_roll"), -4.0),
            **dict.fromkeys(("max_bound_pitch", "max_bound_roll"), 4.0),
            **dict.fromkeys(("current_pitch", "current_roll"), 0.0),
        },
    ),
)


class Settings:
    """Keeps the settings; the other parts read them by the event's name."""

    def __init__(self, announcer: Announcer, settings: tuple[Setting, ...] = SETTINGS) -> None:
        self._announcer = announcer
        self._settings = settings
        self._values: dict[str, dict[str, Any]] = {}
        self.reset()

    def reset(self) -> None:
        """Take the first values, as a drone does that is told to forget."""
        self._values = {one.event: dict(one.start) for one in self._settings}
        for event, values in self._values.items():
            self._announcer.state(event, **values)

    def value(self, event: str, argument: str = "current") -> Any:
        """Return what is set."""
        return self._values[event][argument]

    def change(self, event: str, **values: Any) -> None:
        """Set without a client's command, and tell."""
        self._values[event].update(values)
        self._announcer.repeat(event, **self._values[event])

    def handlers(self) -> Mapping[str, Handler]:
        """Return what obeys which command."""
        return {one.command: self._taker(one) for one in self._settings} | {
            "common.Settings.Reset": self._reset
        }

    def update(self, state: WorldState) -> None:
        """Nothing changes by itself."""

    def _taker(self, setting: Setting) -> Handler:
        def take(values: Values, state: WorldState) -> None:
            del state
            held = self._values[setting.event]
            taken = {told: values[given] for told, given in setting.takes.items()}
            for told, value in taken.items():
                taken[told] = _within(held, told, value)
            self.change(setting.event, **taken)

        return take

    def _reset(self, values: Values, state: WorldState) -> None:
        del values, state
        self.reset()
        self._announcer.repeat("common.SettingsState.ResetChanged")


def _within(held: Mapping[str, Any], name: str, value: Any) -> Any:
    """Return a value within the bounds that its event names; NaN leaves it as it was."""
    if isinstance(value, float) and math.isnan(value):
        return held[name]
    bounds = [(f"{name}_min", f"{name}_max"), ("min", "max")]
    if "current" in name:
        bounds.insert(
            0, (name.replace("current", "min_bound"), name.replace("current", "max_bound"))
        )
    for low, top in bounds:
        if low in held and top in held:
            return max(held[low], min(held[top], value))
    return value
