"""Photos, recordings and the camera's settings, as far as clients wait for their answers.

Nothing is stored: a photo is reported as taken and saved, and there is no file.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from sim_bridge.loopback.firmware.part import Core, Part
from sim_bridge.loopback.firmware.publisher import Handler, Values
from sim_bridge.loopback.firmware.settings import Setting, setting
from sim_bridge.loopback.world import WorldState

_PHOTO_S: Final = 0.5  # s that a photo takes
_ISO: Final = ("iso_100", "iso_200", "iso_400", "iso_800", "iso_1600", "iso_3200")
_SHUTTER: Final = ("shutter_1_over_1000", "shutter_1_over_500", "shutter_1_over_60")
_STYLE: Final = ("saturation", "contrast", "sharpness")


def _setting(command: str, takes: str, event: str = "", /, **start: Any) -> Setting:
    return setting(f"camera.{command}", takes, event, cam_id=0, **start)


CAMERA_SETTINGS: Final = (
    _setting("set_camera_mode", "mode=value", mode="recording"),
    _setting(
        "set_recording_mode",
        "mode resolution framerate hyperlapse",
        mode="standard",
        resolution="res_1080p",
        framerate="fps_30",
        hyperlapse="ratio_15",
        bitrate=50_000_000,
    ),
    _setting(
        "set_photo_mode",
        "mode format file_format burst bracketing capture_interval",
        mode="single",
        format="rectilinear",
        file_format="jpeg",
        burst="burst_14_over_1s",
        bracketing="preset_1ev",
        capture_interval=0.0,
    ),
    _setting("set_streaming_mode", "value", value="low_latency"),
    _setting("set_ev_compensation", "value", value="ev_0_00"),
    _setting(
        "set_white_balance",
        "mode temperature",
        mode="automatic",
        temperature="t_5000",
        lock="inactive",
    ),
    _setting("set_hdr_setting", "value", value="inactive"),
    _setting("set_autorecord", "state", state="inactive"),
    _setting("set_max_zoom_speed", "current=max", min=0.1, max=10.0, current=1.0),
    _setting("set_zoom_velocity_quality_degradation", "allowed=allow", allowed=0),
    _setting(
        "set_style_params",
        " ".join(_STYLE),
        "camera.style",
        style="standard",
        **dict.fromkeys(_STYLE, 0),
        **{f"{name}_min": -2 for name in _STYLE},
        **{f"{name}_max": 2 for name in _STYLE},
    ),
    _setting(
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

_CAPABILITIES: Final = {
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
_ZOOM: Final = {
    "available": "not_available",
    "high_quality_maximum_level": 1.0,
    "maximum_level": 1.0,
}


class Camera(Part):
    """Takes photos and recordings; publishes what the camera can do.

    Args:
        core: what the parts share.
    """

    def __init__(self, core: Core) -> None:
        super().__init__(core)
        self._started_s: float | None = None  # when the photo under way was started
        self._photos = 0
        self._recordings = 0
        self._recording = False
        publish = core.publisher.state
        publish("camera.camera_states", active_cameras=1)
        publish("camera.camera_capabilities", **_CAPABILITIES)
        core.publisher.entries("camera.recording_capabilities", [_RECORDING])
        core.publisher.entries("camera.photo_capabilities", [_PHOTO])
        modes = {"auto", "mode_50hz", "mode_60hz"}
        publish("camera.antiflicker_capabilities", supported_modes=modes)
        publish("camera.zoom_level", cam_id=0, level=1.0)
        publish("camera.zoom_info", cam_id=0, **_ZOOM)
        publish("camera.hdr", cam_id=0, available="not_available", state="inactive")
        self._publish_photo("inactive")
        self._publish_recording(0)

    def handlers(self) -> Mapping[str, Handler]:
        """Return the commands it handles, by name."""
        return {
            "camera.take_photo": self._take_photo,
            "camera.stop_photo": self._stop_photo,
            "camera.start_recording": self._start_recording,
            "camera.stop_recording": self._stop_recording,
        }

    def update(self, state: WorldState) -> None:
        """Finish the photo under way."""
        if self._started_s is not None and state.time_s - self._started_s >= _PHOTO_S:
            self._started_s = None
            media = f"{self._photos:08d}"
            self._notify_photo("photo_taken", media)
            self._notify_photo("photo_saved", media)
            self._publish_photo("inactive")

    def _take_photo(self, values: Values, state: WorldState) -> None:
        if values["cam_id"] != 0 or self._started_s is not None:
            self._notify_photo("error_bad_state")
            return
        self._started_s = state.time_s
        self._photos += 1
        self._publish_photo("active")
        self._notify_photo("taking_photo")

    def _stop_photo(self, _values: Values, state: WorldState) -> None:
        if self._started_s is not None:
            self._started_s = state.time_s - _PHOTO_S
            self.update(state)

    def _start_recording(self, values: Values, state: WorldState) -> None:
        if values["cam_id"] != 0 or self._recording:
            self._notify_recording("error_bad_state")
            return
        self._recording = True
        self._recordings += 1
        self._publish_recording(int(1000 * state.time_s))
        self._notify_recording("started")

    def _stop_recording(self, _values: Values, _state: WorldState) -> None:
        if not self._recording:
            self._notify_recording("error_bad_state")
            return
        self._recording = False
        self._publish_recording(0)
        self._notify_recording("stopped", f"{self._recordings:08d}")

    def _publish_photo(self, state: str) -> None:
        self._core.publisher.state(
            "camera.photo_state", cam_id=0, available="available", state=state
        )

    def _notify_photo(self, result: str, media: str = "") -> None:
        self._core.publisher.notify(
            "camera.photo_progress", cam_id=0, result=result, photo_count=1, media_id=media
        )

    def _publish_recording(self, start_ms: int) -> None:
        self._core.publisher.state(
            "camera.recording_state",
            cam_id=0,
            available="available",
            state="active" if self._recording else "inactive",
            start_timestamp=start_ms,
        )

    def _notify_recording(self, result: str, media: str = "") -> None:
        self._core.publisher.notify(
            "camera.recording_progress", cam_id=0, result=result, media_id=media
        )
