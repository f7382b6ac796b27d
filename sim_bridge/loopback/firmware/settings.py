"""Settings that a client may change: limited to their bounds, and published."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from sim_bridge.loopback.firmware.publisher import Handler, Publisher, Values
from sim_bridge.loopback.world import WorldState


@dataclass(frozen=True, kw_only=True)
class Setting:
    """A command and the event that answers it."""

    command: str
    event: str
    takes: Mapping[str, str]  # from argument of the event to argument of the command
    start: Mapping[str, Any]  # first values of all event arguments; `min` and `max` are bounds


def setting(command: str, takes: str, event: str = "", /, **start: Any) -> Setting:
    """Return a setting.

    Args:
        command: name of the command.
        takes: arguments that the event takes from the command, separated by spaces: `name`, or
            `event name=command name`.
        event: name of the event if it differs from the default: `rth.delay` for
            `rth.set_delay`, and `ASettingsState.XChanged` for `ASettings.X`.
        start: first values of all arguments of the event.
    """
    if not event:
        where, _, name = command.rpartition(".")
        event = f"{where}State.{name}Changed"
        if "." not in where:
            event = f"{where}.{name.removeprefix('set_')}"
    pairs = (pair.partition("=") for pair in takes.split())
    return Setting(
        command=command,
        event=event,
        takes={shown: given or shown for shown, _, given in pairs},
        start=start,
    )


def _camera(command: str, takes: str, event: str = "", /, **start: Any) -> Setting:
    return setting(f"camera.{command}", takes, event, cam_id=0, **start)


_PILOTING: Final = "ardrone3.PilotingSettings"
_SPEED: Final = "ardrone3.SpeedSettings"
_NETWORK: Final = "ardrone3.NetworkSettings"
_PICTURE: Final = "ardrone3.PictureSettings"
_ISO: Final = ("iso_100", "iso_200", "iso_400", "iso_800", "iso_1600", "iso_3200")
_SHUTTER: Final = ("shutter_1_over_1000", "shutter_1_over_500", "shutter_1_over_60")
_STYLE: Final = ("saturation", "contrast", "sharpness")

# Bounds and first values are those of the ANAFI's documentation and settings page.
SETTINGS: Final = (
    setting(f"{_PILOTING}.MaxAltitude", "current", current=30.0, min=0.5, max=4000.0),
    setting(f"{_PILOTING}.MaxTilt", "current", current=20.0, min=1.0, max=40.0),
    setting(f"{_PILOTING}.MaxDistance", "current=value", current=100.0, min=10.0, max=4000.0),
    setting(f"{_PILOTING}.MinAltitude", "current", current=0.0, min=0.0, max=0.0),
    setting(f"{_PILOTING}.NoFlyOverMaxDistance", "shouldNotFlyOver", shouldNotFlyOver=0),
    setting(f"{_PILOTING}.BankedTurn", "state=value", state=1),
    setting(
        f"{_PILOTING}.SetMotionDetectionMode",
        "enabled=enable",
        f"{_PILOTING}State.MotionDetection",
        enabled=1,
    ),
    setting(f"{_SPEED}.MaxVerticalSpeed", "current", current=1.0, min=0.1, max=4.0),
    setting(f"{_SPEED}.MaxRotationSpeed", "current", current=40.0, min=3.0, max=200.0),
    setting(f"{_SPEED}.MaxPitchRollRotationSpeed", "current", current=200.0, min=40.0, max=300.0),
    setting(f"{_SPEED}.HullProtection", "present", present=0),
    setting(f"{_SPEED}.Outdoor", "outdoor", outdoor=1),
    setting(
        f"{_NETWORK}.wifiSecurity",
        "type key keyType",
        f"{_NETWORK}State.wifiSecurity",
        type="open",
        key="",
        keyType="plain",
    ),
    setting(
        f"{_PICTURE}.VideoAutorecordSelection",
        "enabled mass_storage_id",
        f"{_PICTURE}State.VideoAutorecordChanged",
        enabled=0,
        mass_storage_id=0,
    ),
    setting("common.Settings.ProductName", "name", name=""),
    setting("common.Settings.Country", "code", code="FR"),
    setting("common.Settings.AutoCountry", "automatic", automatic=0),
    setting(
        "common.WifiSettings.OutdoorSetting",
        "outdoor",
        "common.WifiSettingsState.outdoorSettingsChanged",
        outdoor=0,
    ),
    setting("common.Common.CurrentDateTime", "datetime", datetime="19700101T000000+0000"),
    setting("common.Common.CurrentDate", "date", date=""),
    setting("common.Common.CurrentTime", "time", time=""),
    setting("ardrone3.GPSSettings.HomeType", "type", type="TAKEOFF"),
    setting("piloting_style.set_style", "style", style="standard"),
    setting("precise_home.set_mode", "mode", mode="disabled"),
    setting("rth.set_preferred_home_type", "type", type="takeoff"),
    setting("rth.set_delay", "delay", delay=60, min=0, max=120),
    setting("ardrone3.GPSSettings.ReturnHomeDelay", "delay", delay=60),
    setting("rth.set_min_altitude", "current=altitude", current=20.0, min=20.0, max=100.0),
    setting(
        "rth.set_ending_hovering_altitude", "current=altitude", current=10.0, min=1.0, max=10.0
    ),
    setting("rth.set_ending_behavior", "ending_behavior", ending_behavior="landing"),
    setting("rth.set_auto_trigger_mode", "mode", mode="on"),
    setting(
        "gimbal.set_max_speed",
        "current_yaw=yaw current_pitch=pitch current_roll=roll",
        **dict.fromkeys(("min_bound_yaw", "max_bound_yaw", "current_yaw"), 0.0),
        **dict.fromkeys(("min_bound_roll", "max_bound_roll", "current_roll"), 0.0),
        gimbal_id=0,
        min_bound_pitch=1.0,
        max_bound_pitch=180.0,
        current_pitch=90.0,
    ),
    setting(
        "gimbal.set_offsets",
        "current_yaw=yaw current_pitch=pitch current_roll=roll",
        gimbal_id=0,
        update_state="inactive",
        **dict.fromkeys(("min_bound_yaw", "max_bound_yaw", "current_yaw"), 0.0),
        **dict.fromkeys(("min_bound_pitch", "min_bound_roll"), -4.0),
        **dict.fromkeys(("max_bound_pitch", "max_bound_roll"), 4.0),
        **dict.fromkeys(("current_pitch", "current_roll"), 0.0),
    ),
    _camera("set_camera_mode", "mode=value", mode="recording"),
    _camera(
        "set_recording_mode",
        "mode resolution framerate hyperlapse",
        mode="standard",
        resolution="res_1080p",
        framerate="fps_30",
        hyperlapse="ratio_15",
        bitrate=50_000_000,
    ),
    _camera(
        "set_photo_mode",
        "mode format file_format burst bracketing capture_interval",
        mode="single",
        format="rectilinear",
        file_format="jpeg",
        burst="burst_14_over_1s",
        bracketing="preset_1ev",
        capture_interval=0.0,
    ),
    _camera("set_streaming_mode", "value", value="low_latency"),
    _camera("set_ev_compensation", "value", value="ev_0_00"),
    _camera(
        "set_white_balance",
        "mode temperature",
        mode="automatic",
        temperature="t_5000",
        lock="inactive",
    ),
    _camera("set_hdr_setting", "value", value="inactive"),
    _camera("set_autorecord", "state", state="inactive"),
    _camera("set_max_zoom_speed", "current=max", min=0.1, max=10.0, current=1.0),
    _camera("set_zoom_velocity_quality_degradation", "allowed=allow", allowed=0),
    _camera(
        "set_style_params",
        " ".join(_STYLE),
        "camera.style",
        style="standard",
        **dict.fromkeys(_STYLE, 0),
        **{f"{name}_min": -2 for name in _STYLE},
        **{f"{name}_max": 2 for name in _STYLE},
    ),
    _camera(
        "set_exposure_settings",
        "mode manual_shutter_speed=shutter_speed manual_iso_sensitivity=iso_sensitivity "
        "max_iso_sensitivity metering_mode",
        mode="automatic",
        manual_shutter_speed=_SHUTTER[0],
        manual_shutter_speed_capabilities=frozenset(_SHUTTER),
        manual_iso_sensitivity=_ISO[0],
        manual_iso_sensitivity_capabilities=frozenset(_ISO),
        max_iso_sensitivity=_ISO[-1],
        max_iso_sensitivities_capabilities=frozenset(_ISO),
        metering_mode="standard",
    ),
    setting("camera.set_antiflicker_mode", "mode", mode="auto", value="mode_50hz"),
)


class Settings:
    """Stores the settings; the other parts read them by event name."""

    def __init__(self, publisher: Publisher) -> None:
        self._publisher = publisher
        self._values: dict[str, dict[str, Any]] = {}
        self.handlers: Mapping[str, Handler] = {
            "common.Settings.Reset": self._reset,
            **{one.command: self._setter(one) for one in SETTINGS},
        }
        self._restore()

    def _restore(self) -> None:
        self._values = {one.event: dict(one.start) for one in SETTINGS}
        for event, values in self._values.items():
            self._publisher.state(event, **values)

    def value(self, event: str, argument: str = "current") -> Any:
        """Return the value of a setting.

        Args:
            event: the event that publishes it.
            argument: name of the event's argument.
        """
        return self._values[event][argument]

    def change(self, event: str, /, **values: Any) -> None:
        """Change a setting without a command of a client, and publish it.

        Args:
            event: the event that publishes it.
            values: the arguments that change.
        """
        self._values[event].update(values)
        self._publisher.refresh(event, **self._values[event])

    def _setter(self, one: Setting) -> Handler:
        def set_values(values: Values, _state: WorldState) -> None:
            held = self._values[one.event]
            taken = {
                shown: _within(held, shown, values[given]) for shown, given in one.takes.items()
            }
            self.change(one.event, **taken)

        return set_values

    def _reset(self, _values: Values, _state: WorldState) -> None:
        self._restore()
        self._publisher.refresh("common.SettingsState.ResetChanged")


def _within(held: Mapping[str, Any], name: str, value: Any) -> Any:
    """Return a value limited to the bounds of its event; NaN keeps the present value."""
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
