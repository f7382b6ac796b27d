"""Gimbal, photographs, and the events of recordings.

A recording is reported as made, but no file is written.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from concurrent.futures import Future
from functools import partial
from typing import Final

from sim_bridge.loopback.firmware.core import Core, Part
from sim_bridge.loopback.firmware.publisher import Values
from sim_bridge.loopback.media import MediaStore, Photo
from sim_bridge.loopback.world import WorldState
from uav_bt.types.pose import clamp

_LOG = logging.getLogger(__name__)

Shutter = Callable[[], Future[Photo]]  # takes a photograph

_MIN_DEG: Final = -90.0  # range of the ANAFI and of the twin's camera
_MAX_DEG: Final = 90.0
_BOUNDS: Final = {
    "gimbal_id": 0,
    **dict.fromkeys(("min_yaw", "max_yaw", "min_roll", "max_roll"), 0.0),
    "min_pitch": _MIN_DEG,
    "max_pitch": _MAX_DEG,
}


class Gimbal(Part):
    """Controls the pitch of the camera; its yaw is that of the body, and its roll is 0."""

    def __init__(self, core: Core) -> None:
        super().__init__(core)
        self.handlers = {
            "gimbal.set_target": self._set_target,
            "gimbal.reset_orientation": self._reset,
            "gimbal.calibrate": self._calibrate,
            "gimbal.cancel_calibration": self._cancel_calibration,
            "gimbal.start_offsets_update": lambda _, __: self._update_offsets("active"),
            "gimbal.stop_offsets_update": lambda _, __: self._update_offsets("inactive"),
        }
        self._speed_degps = 0.0
        self._updated_s = 0.0
        self._target_deg = 0.0
        self.reference = "absolute"  # frame of the last target: absolute or relative
        publish = core.publisher.state
        publish("gimbal.gimbal_capabilities", gimbal_id=0, model="main", axes={"roll", "pitch"})
        publish("gimbal.relative_attitude_bounds", **_BOUNDS)
        publish("gimbal.absolute_attitude_bounds", **_BOUNDS)
        publish("gimbal.axis_lock_state", gimbal_id=0, locked={"yaw"})
        publish("gimbal.calibration_state", state="ok", gimbal_id=0)
        publish("gimbal.alert", gimbal_id=0, error=set())

    def update(self, state: WorldState) -> None:
        """Integrate the velocity if one is set."""
        elapsed_s, self._updated_s = state.time_s - self._updated_s, state.time_s
        if self._speed_degps:
            self._point(self._target_deg + self._speed_degps * elapsed_s)
            if self._target_deg in (_MIN_DEG, _MAX_DEG):
                self._speed_degps = 0.0

    def _set_target(self, values: Values, state: WorldState) -> None:
        reference, pitch = values["pitch_frame_of_reference"], values["pitch"]
        if values["gimbal_id"] != 0 or not math.isfinite(pitch):
            return
        if values["control_mode"] == "velocity":
            share = clamp(pitch, 1.0)
            max_degps = self._core.settings.value("gimbal.max_speed", "current_pitch")
            self._speed_degps = share * max_degps
            self._target_deg = math.degrees(state.gimbal_pitch_rad)
        elif reference != "none":
            self._speed_degps = 0.0
            self.reference = reference
            body_deg = math.degrees(state.attitude.pitch_rad) if reference == "relative" else 0.0
            self._point(pitch + body_deg)

    def _point(self, pitch_deg: float) -> None:
        self._target_deg = max(_MIN_DEG, min(_MAX_DEG, pitch_deg))
        self._core.world.point(math.radians(self._target_deg))

    def _reset(self, _values: Values, _state: WorldState) -> None:
        self._speed_degps = 0.0
        self._point(0.0)

    def _calibrate(self, _values: Values, _state: WorldState) -> None:
        publisher = self._core.publisher
        publisher.refresh("gimbal.calibration_state", state="in_progress", gimbal_id=0)
        publisher.notify("gimbal.calibration_result", gimbal_id=0, result="success")
        publisher.refresh("gimbal.calibration_state", state="ok", gimbal_id=0)

    def _cancel_calibration(self, _values: Values, _state: WorldState) -> None:
        self._core.publisher.notify("gimbal.calibration_result", gimbal_id=0, result="canceled")

    def _update_offsets(self, update_state: str) -> None:
        self._core.settings.change("gimbal.offsets", update_state=update_state)


_PHOTO_S: Final = 0.5  # least duration of a photograph, s
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
_LOCK_REGION: Final = ("lock_roi_x", "lock_roi_y", "lock_roi_width", "lock_roi_height")
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
# The automatic modes have one exposure, because the light of the twin is constant.
_AUTOMATIC: Final = ("shutter_1_over_500", "iso_100")


class Camera(Part):
    """Takes photographs and recordings; publishes the capabilities of the camera.

    Args:
        core: shared state of the parts.
        shoot: takes a photograph; None without a camera.
        media: stores the photographs.
    """

    def __init__(self, core: Core, shoot: Shutter | None, media: MediaStore) -> None:
        super().__init__(core)
        self.handlers = {
            "camera.take_photo": self._take_photo,
            "camera.stop_photo": self._stop_photo,
            "camera.start_recording": self._start_recording,
            "camera.stop_recording": self._stop_recording,
        }
        self._shoot, self._media = shoot, media
        self._photo: Future[Photo] | None = None  # the photograph in progress
        self._started_s = -math.inf  # start time of this photograph
        self._recordings = 0
        self._recording = False
        publish = core.publisher.state
        publish("camera.camera_states", active_cameras=1)
        publish("camera.camera_capabilities", **_CAPABILITIES)
        core.publisher.entries("camera.recording_capabilities", [_RECORDING])
        core.publisher.entries("camera.photo_capabilities", [_PHOTO])
        modes = {"auto", "mode_50hz", "mode_60hz"}
        publish("camera.antiflicker_capabilities", supported_modes=modes)
        publish("camera.hdr", cam_id=0, available="not_available", state="inactive")
        self._publish_photo("inactive")
        self._publish_recording(0)

    def update(self, state: WorldState) -> None:
        """Publish a changed exposure; finish the photograph in progress."""
        self._publish_exposure()
        photo = self._photo
        if photo is None or not photo.done() or state.time_s - self._started_s < _PHOTO_S:
            return
        self._photo = None
        if (fault := photo.exception()) is None:
            media_id = self._media.add(photo.result())
            self._notify_photo("photo_taken", media_id)
            self._notify_photo("photo_saved", media_id)
        else:
            _LOG.warning("a photograph failed: %s", fault)
            self._notify_photo("error")
        self._publish_photo("inactive")

    def _take_photo(self, values: Values, state: WorldState) -> None:
        if values["cam_id"] != 0 or self._photo is not None:
            self._notify_photo("error_bad_state")
        elif self._shoot is None:
            self._notify_photo("error")
        elif self._media.full:
            self._notify_photo("error_no_storage_space")
        else:
            self._photo, self._started_s = self._shoot(), state.time_s
            self._publish_photo("active")
            self._notify_photo("taking_photo")

    def _stop_photo(self, _values: Values, state: WorldState) -> None:
        self._started_s = -math.inf
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

    def _publish_exposure(self) -> None:
        setting = partial(self._core.settings.value, "camera.exposure_settings")
        mode, (shutter, iso) = setting("mode"), _AUTOMATIC
        if mode in ("manual", "manual_shutter_speed"):
            shutter = setting("manual_shutter_speed")
        if mode in ("manual", "manual_iso_sensitivity"):
            iso = setting("manual_iso_sensitivity")
        self._core.publisher.state(
            "camera.exposure",
            cam_id=0,
            shutter_speed=shutter,
            iso_sensitivity=iso,
            lock="inactive",
            **dict.fromkeys(_LOCK_REGION, -1.0),
        )

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
