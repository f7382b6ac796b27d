"""Gimbal, photographs and memory card."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from concurrent.futures import Future
from typing import Final

from sim_bridge.loopback.codec import Values
from sim_bridge.loopback.firmware.states import States
from sim_bridge.loopback.media import MAX_BYTES, MediaStore, Photo
from sim_bridge.loopback.twin_world import TwinWorld
from sim_bridge.loopback.world import WorldState
from uav_bt.types.pose import clamp

_LOG = logging.getLogger(__name__)

Shutter = Callable[[], Future[Photo]]  # takes a photograph

_PHOTO_S: Final = 0.5  # least duration of a photograph, s


class Camera:
    """Points the camera, takes photographs, and reports the contents of the card.

    `unanswered` takes the name of a command that is not answered.
    """

    def __init__(
        self,
        world: TwinWorld,
        states: States,
        shoot: Shutter,
        media: MediaStore,
        unanswered: Callable[[str], None],
    ) -> None:
        self._world, self._states = world, states
        self._shoot, self._media = shoot, media
        self._unanswered = unanswered
        self._photo: Future[Photo] | None = None  # the photograph in progress
        self._started_s = 0.0  # start time of this photograph
        self.handlers = {
            "gimbal.set_target": self._set_target,
            "gimbal.reset_orientation": lambda _, __: self._point(0.0),
            "camera.take_photo": self._take_photo,
        }
        product = states.value("common.SettingsState.ProductNameChanged", "name")
        states.set("user_storage.info", name=product, capacity=MAX_BYTES)
        if media.absent:
            states.set(
                "user_storage.state", physical_state="undetected", file_system_state="unknown"
            )
        media.subscribe(lambda _: self._count())

    def update(self, state: WorldState) -> None:
        """Finish the photograph in progress."""
        photo = self._photo
        if photo is None or not photo.done() or state.captured_s - self._started_s < _PHOTO_S:
            return
        self._photo = None
        if (fault := photo.exception()) is None:
            media_id = self._media.add(photo.result())
            self._progress("photo_taken", media_id)
            self._progress("photo_saved", media_id)
        else:
            _LOG.warning("a photograph failed: %s", fault)
            self._progress("error")
        self._states.set("camera.photo_state", state="inactive")

    def _set_target(self, values: Values, state: WorldState) -> None:
        reference, pitch_deg = values["pitch_frame_of_reference"], values["pitch"]
        if values["control_mode"] == "velocity":
            self._unanswered("gimbal.set_target by velocity")
        elif reference != "none" and math.isfinite(pitch_deg):
            self._states.set("gimbal.attitude", pitch_frame_of_reference=reference)
            if reference == "relative":
                pitch_deg += math.degrees(state.attitude.pitch_rad)
            self._point(pitch_deg)

    def _point(self, pitch_deg: float) -> None:
        limit_deg = self._states.value("gimbal.absolute_attitude_bounds", "max_pitch")
        self._world.point(math.radians(clamp(pitch_deg, limit_deg)))

    def _take_photo(self, _values: Values, state: WorldState) -> None:
        if self._photo is not None:
            self._progress("error_bad_state")
        elif self._media.full:
            self._progress("error_no_storage_space")
        else:
            self._photo, self._started_s = self._shoot(), state.captured_s
            self._states.set("camera.photo_state", state="active")
            self._progress("taking_photo")

    def _progress(self, result: str, media: str = "") -> None:
        self._states.notify(
            "camera.photo_progress", cam_id=0, result=result, photo_count=1, media_id=media
        )

    def _count(self) -> None:
        photos = len(self._media)
        self._states.set(
            "mediastore.counters", photo_media_count=photos, photo_resource_count=photos
        )
