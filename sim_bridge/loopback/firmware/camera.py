"""Photos, recordings and the camera's settings, as far as clients wait for their answers.

Nothing is stored: a photo is told as taken and saved, and no file stands behind it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from sim_bridge.loopback.firmware.announcer import Announcer
from sim_bridge.loopback.firmware.part import Handler, Values
from sim_bridge.loopback.firmware.settings import Setting
from sim_bridge.loopback.world import WorldState

__all__ = ["CAMERA_SETTINGS", "Camera"]

_PHOTO_S: Final = 0.5  # s that a photo takes
_ISO: Final = ("iso_100", "iso_200", "iso_400", "iso_800", "iso_1600", "iso_3200")
_SHUTTER: Final = ("shutter_1_over_1000", "shutter_1_over_500", "shutter_1_over_60")


def _of_camera(
    command: str, event: str, takes: tuple[str, ...] | dict[str, str], start: dict[str, Any]
) -> Setting:
    renamed = takes if isinstance(takes, dict) else {name: name for name in takes}
    return Setting(
        command=f"camera.{command}",
        event=f"camera.{event}",
        takes=renamed,
        start={"cam_id": 0, **start},
    )


CAMERA_SETTINGS: Final = (
    _of_camera("set_camera_mode", "camera_mode", {"mode": "value"}, {"mode": "recording"}),
    _of_camera(
        "set_recording_mode",
        "recording_mode",
        ("mode", "resolution", "framerate", "hyperlapse"),
        {
            "mode": "standard",
            "resolution": "res_1080p",
            "framerate": "fps_30",
            "hyperlapse": "ratio_15",
            "bitrate": 50_000_000,
        },
    ),
    _of_camera(
        "set_photo_mode",
        "photo_mode",
        ("mode", "format", "file_format", "burst", "bracketing", "capture_interval"),
        {
            "mode": "single",
            "format": "rectilinear",
            "file_format": "jpeg",
            "burst": "burst_14_over_1s",
            "bracketing": "preset_1ev",
            "capture_interval": 0.0,
        },
    ),
    _of_camera("set_streaming_mode", "streaming_mode", ("value",), {"value": "low_latency"}),
    _of_camera("set_ev_compensation", "ev_compensation", ("value",), {"value": "ev_0_00"}),
    _of_camera(
        "set_white_balance",
        "white_balance",
        ("mode", "temperature"),
        {"mode": "automatic", "temperature": "t_5000", "lock": "inactive"},
    ),
    _of_camera("set_hdr_setting", "hdr_setting", ("value",), {"value": "inactive"}),
    _of_camera("set_autorecord", "autorecord", ("state",), {"state": "inactive"}),
    _of_camera(
        "set_max_zoom_speed",
        "max_zoom_speed",
        {"current": "max"},
        {"min": 0.1, "max": 10.0, "current": 1.0},
    ),
    _of_camera(
        "set_zoom_velocity_quality_degradation",
        "zoom_velocity_quality_degradation",
        {"allowed": "allow"},
        {"allowed": 0},
    ),
    _of_camera(
        "set_style_params",
        "style",
        ("saturation", "contrast", "sharpness"),
        {
            "style": "standard",
            **{
                f"{name}{bound}": value
                for name in ("saturation", "contrast", "sharpness")
                for bound, value in (("", 0), ("_min", -2), ("_max", 2))
            },
        },
    ),
    _of_camera(
        "set_exposure_settings",
        "exposure_settings",
        {
            "mode": "mode",
            "manual_shutter_speed": "shutter_speed",
            "manual_iso_sensitivity": "iso_sensitivity",
            "max_iso_sensitivity": "max_iso_sensitivity",
            "metering_mode": "metering_mode",
        },
        {
            "mode": "automatic",
            "manual_shutter_speed": _SHUTTER[0],
            "manual_shutter_speed_capabilities": frozenset(_SHUTTER),
            "manual_iso_sensitivity": _ISO[0],
            "manual_iso_sensitivity_capabilities": frozenset(_ISO),
            "max_iso_sensitivity": _ISO[-1],
            "max_iso_sensitivities_capabilities": frozenset(_ISO),
            "metering_mode": "standard",
        },
    ),
    Setting(
        command="camera.set_antiflicker_mode",
        event="camera.antiflicker_mode",
        takes={"mode": "mode"},
        start={"mode": "auto", "value": "mode_50hz"},
    ),
)

_ABILITIES: Final = {
    "cam_id": 0,
    "model": "main",
    "exposure_modes": {"automatic", "manual"},
    "exposure_lock_supported": "not_supported",
    "exposure_roi_lock_supported": "not_supported",
    "ev_compensations": {"ev_minus_1_00", "ev_0_00", "ev_1_00"},
    "white_balance_modes": {"automatic", "custom"},
    "custom_white_balance_temperatures": {"t_5000"},
    "white_balance_lock_supported": "not_supported",
    "styles": {"standard"},
    "camera_modes": {"recording", "photo"},
    "hyperlapse_values": {"ratio_15"},
    "bracketing_presets": {"preset_1ev"},
    "burst_values": {"burst_14_over_1s"},
    "streaming_modes": {"low_latency"},
    "timelapse_interval_min": 1.0,
    "gpslapse_interval_min": 1.0,
    "auto_exposure_metering_modes": {"standard"},
}
_RECORDING: Final = {
    "id": 0,
    "recording_modes": {"standard"},
    "resolutions": {"res_1080p", "res_720p"},
    "framerates": {"fps_30"},
    "hdr": "not_supported",
}
_PHOTO: Final = {
    "id": 0,
    "photo_modes": {"single"},
    "photo_formats": {"rectilinear"},
    "photo_file_formats": {"jpeg"},
    "hdr": "not_supported",
}


class Camera:
    """Obeys take-photo and recording; tells what the camera can do."""

    def __init__(self, announcer: Announcer) -> None:
        """Stand ready.

        Args:
            announcer: told how it goes.
        """
        self._announcer = announcer
        self._taken_s: float | None = None
        self._photos = 0
        self._recordings = 0
        self._recording = False
        tell = announcer.state
        tell("camera.camera_states", active_cameras=1)
        tell("camera.camera_capabilities", **_ABILITIES)
        announcer.entries("camera.recording_capabilities", [_RECORDING])
        announcer.entries("camera.photo_capabilities", [_PHOTO])
        tell("camera.antiflicker_capabilities", supported_modes={"auto", "mode_50hz", "mode_60hz"})
        tell("camera.zoom_level", cam_id=0, level=1.0)
        tell(
            "camera.zoom_info",
            cam_id=0,
            available="not_available",
            high_quality_maximum_level=1.0,
            maximum_level=1.0,
        )
        tell("camera.hdr", cam_id=0, available="not_available", state="inactive")
        self._tell_photo("inactive")
        self._tell_recording(0)

    def handlers(self) -> Mapping[str, Handler]:
        """Return what obeys which command."""
        return {
            "camera.take_photo": self._take_photo,
            "camera.stop_photo": self._stop_photo,
            "camera.start_recording": self._start_recording,
            "camera.stop_recording": self._stop_recording,
        }

    def update(self, state: WorldState) -> None:
        """Finish the photo that is being taken."""
        if self._taken_s is not None and state.time_s - self._taken_s >= _PHOTO_S:
            self._taken_s = None
            media = f"{self._photos:08d}"
            self._tell_progress("photo_taken", media)
            self._tell_progress("photo_saved", media)
            self._tell_photo("inactive")

    def _take_photo(self, values: Values, state: WorldState) -> None:
        if values["cam_id"] != 0 or self._taken_s is not None:
            self._tell_progress("error_bad_state", "")
            return
        self._taken_s = state.time_s
        self._photos += 1
        self._tell_photo("active")
        self._tell_progress("taking_photo", "")

    def _stop_photo(self, values: Values, state: WorldState) -> None:
        del values
        if self._taken_s is not None:
            self._taken_s = state.time_s - _PHOTO_S
            self.update(state)

    def _start_recording(self, values: Values, state: WorldState) -> None:
        if values["cam_id"] != 0 or self._recording:
            self._tell_recording_progress("error_bad_state", "")
            return
        self._recording = True
        self._recordings += 1
        self._tell_recording(int(1000 * state.time_s))
        self._tell_recording_progress("started", "")

    def _stop_recording(self, values: Values, state: WorldState) -> None:
        del values, state
        if not self._recording:
            self._tell_recording_progress("error_bad_state", "")
            return
        self._recording = False
        self._tell_recording(0)
        self._tell_recording_progress("stopped", f"{self._recordings:08d}")

    def _tell_photo(self, state: str) -> None:
        self._announcer.state("camera.photo_state", cam_id=0, available="available", state=state)

    def _tell_progress(self, result: str, media: str) -> None:
        self._announcer.note(
            "camera.photo_progress", cam_id=0, result=result, photo_count=1, media_id=media
        )

    def _tell_recording(self, start_ms: int) -> None:
        self._announcer.state(
            "camera.recording_state",
            cam_id=0,
            available="available",
            state="active" if self._recording else "inactive",
            start_timestamp=start_ms,
        )

    def _tell_recording_progress(self, result: str, media: str) -> None:
        self._announcer.note("camera.recording_progress", cam_id=0, result=result, media_id=media)
