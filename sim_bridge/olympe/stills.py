"""Photographs of the drone's camera: requests them and follows the drone's events."""

from __future__ import annotations

import enum
import logging
import threading
from collections.abc import Callable, Mapping
from typing import Any, Final

from sim_bridge.olympe.commands import Job
from sim_bridge.olympe.orders import Orders
from uav_bt.protocols import Still, StillState

_LOG: Final = logging.getLogger(__name__)

_PHOTO: Final = "photo"  # camera mode
_SINGLE: Final = "single"  # photo mode
_SAVED: Final = "photo_saved"
_BEGUN: Final = frozenset({"taking_photo", "photo_taken"})
_FULL: Final = "the memory card is full"
_ERRORS: Final = {
    "error_no_storage_space": _FULL,
    "error_bad_state": "the camera is busy, or in another mode",
    "error": "the camera reports an error",
}
# States of ARSDK's `user_storage.state` with which no photograph can be stored.
_NO_CARD: Final = {
    "undetected": "the drone has no memory card",
    "too_small": "the memory card is too small",
    "too_slow": "the memory card is too slow",
    "usb_mass_storage": "the memory card is in use by a computer, over USB",
}
_UNREADY: Final = {
    "format_needed": "the memory card must be formatted",
    "formatting": "the memory card is being formatted",
    "password_needed": "the memory card is locked by a password",
    "error": "the memory card has an error",
}


class _Step(enum.Enum):
    """Event for which the present photograph waits."""

    NOTHING = "nothing"  # no photograph
    MODE = "mode"  # the camera changes to photographs
    BEGIN = "begin"  # the drone has not yet confirmed the command
    SAVE = "save"  # the drone takes and stores it


class OlympeStills:
    """Takes photographs one at a time, without waiting; implements `StillCamera`.

    The camera changes to the mode for photographs and back, because the video may show another
    field of view meanwhile. The pilot's choice of bursts, time lapse or another file format is
    left as it is, and such photographs are refused.

    Events arrive on a thread of the SDK, all else comes from the thread of the mission.

    Args:
        orders: Commands to the drone.
        submit: Runs a command on the thread of the SDK's object.
        fetch: Returns the JPEG file of a photograph by its identifier, within a time in seconds.
    """

    def __init__(
        self,
        orders: Orders,
        submit: Callable[[Job], None],
        fetch: Callable[[str, float], bytes],
    ) -> None:
        self._orders = orders
        self._submit = submit
        self._fetch = fetch
        self._lock = threading.Lock()  # guards all attributes below
        self._step = _Step.NOTHING
        self._stills: list[Still] = []
        self._restore: str | None = None  # camera mode from before the present photograph
        self._mode: str | None = None
        self._photo_mode: Mapping[str, Any] = {}
        self._available = True
        self._card: str | None = None  # why the memory card takes no photographs
        self._readers: dict[str, Callable[[Mapping[str, Any]], None]] = {
            "camera.camera_mode": self._mode_changed,
            "camera.photo_mode": self._photo_mode_changed,
            "camera.photo_state": self._photo_state_changed,
            "camera.photo_progress": self._progressed,
            "user_storage.state": self._card_changed,
        }

    def take(self, name: str, args: Mapping[str, Any]) -> None:
        """Process an event.

        Args:
            name: Full name of the event.
            args: Arguments of the event, enumerations as names.
        """
        reader = self._readers.get(name)
        if reader is not None and args.get("cam_id", 0) == 0:
            with self._lock:
                reader(args)

    def take_still(self) -> int:
        """Ask for a photograph; return its number."""
        with self._lock:
            if self._step is not _Step.NOTHING:
                self._end(Still(state=StillState.FAILED, reason="another one was asked for"))
            self._stills.append(Still())
            number = len(self._stills) - 1
            refusal = self._card or self._other_mode()
            if refusal is not None:
                self._end(Still(state=StillState.FAILED, reason=refusal))
                return number
            self._step = _Step.MODE
            change = self._mode != _PHOTO
            if change and self._restore is None:
                self._restore = self._mode
        if change:
            self._send(lambda: self._orders.camera_mode(_PHOTO))
        self.advance()
        return number

    def still(self, number: int) -> Still:
        """Return the present state of a photograph.

        Args:
            number: As `take_still` returned it.
        """
        with self._lock:
            return self._stills[number]

    def fetch_still(self, media: str, limit_s: float) -> bytes:
        """Return a saved photograph as a JPEG file.

        Args:
            media: Identifier of the photograph on the drone.
            limit_s: Longest wait, s.

        Raises:
            DroneError: The drone does not send it in time, or it is no JPEG.
        """
        return self._fetch(media, limit_s)

    def advance(self) -> None:
        """Send the command that the present photograph needs next; called in every tick."""
        with self._lock:
            shoot = self._step is _Step.MODE and self._mode == _PHOTO and self._available
            if shoot:
                self._step = _Step.BEGIN
            restore = self._restore if self._step is _Step.NOTHING else None
            if restore is not None:
                self._restore = None
        if shoot:
            self._send(self._orders.take_photo)
        if restore is not None:
            self._send(lambda: self._orders.camera_mode(restore))

    def give_up(self) -> None:
        """End the present photograph, and restore the camera's mode."""
        with self._lock:
            if self._step is not _Step.NOTHING:
                self._end(Still(state=StillState.FAILED, reason="the drone was disconnected"))
        self.advance()

    def _send(self, job: Job) -> None:
        """Send a command; a failure ends the photograph, and not the flight."""

        def send() -> None:
            try:
                job()
            except Exception as error:  # noqa: BLE001 - the SDK raises many kinds
                _LOG.warning("a command to the camera failed: %s: %s", type(error).__name__, error)
                with self._lock:
                    if self._step is not _Step.NOTHING:
                        reason = f"the command to the camera failed: {error}"
                        self._end(Still(state=StillState.FAILED, reason=reason))

        self._submit(send)

    def _end(self, still: Still) -> None:
        self._stills[-1] = still
        self._step = _Step.NOTHING

    def _other_mode(self) -> str | None:
        """Return why the pilot's settings give no single JPEG; None if they do, or are unknown."""
        mode = self._photo_mode.get("mode", _SINGLE)
        file_format = str(self._photo_mode.get("file_format", "jpeg"))
        if mode != _SINGLE:
            return f"the camera is set to '{mode}': choose single photographs with FreeFlight"
        if "jpeg" not in file_format:
            return f"the camera is set to '{file_format}': choose JPEG with FreeFlight"
        return None

    def _mode_changed(self, args: Mapping[str, Any]) -> None:
        self._mode = str(args["mode"])

    def _photo_mode_changed(self, args: Mapping[str, Any]) -> None:
        self._photo_mode = args

    def _photo_state_changed(self, args: Mapping[str, Any]) -> None:
        self._available = args["available"] == "available"

    def _card_changed(self, args: Mapping[str, Any]) -> None:
        physical, content = str(args["physical_state"]), str(args["file_system_state"])
        self._card = _NO_CARD.get(physical) or _UNREADY.get(content)

    def _progressed(self, args: Mapping[str, Any]) -> None:
        if self._step not in {_Step.BEGIN, _Step.SAVE}:
            return  # of another program, or of a photograph that was given up
        result = str(args["result"])
        if result in _BEGUN:
            self._step = _Step.SAVE
        elif result == _SAVED and self._step is _Step.SAVE:
            self._end(Still(state=StillState.SAVED, media=str(args["media_id"])))
        elif result != _SAVED:
            reason = self._card or _ERRORS.get(result, f"the camera reports '{result}'")
            self._end(Still(state=StillState.FAILED, reason=reason))
