"""Photographs of the drone's camera: requests them and follows the drone's events."""

from __future__ import annotations

import enum
import logging
import threading
from collections.abc import Callable, Mapping
from typing import Any, Final

from sim_bridge.olympe import orders
from sim_bridge.olympe.commands import CommandQueue, Kind
from sim_bridge.olympe.media import fetch_photo
from sim_bridge.olympe.orders import Order
from uav_bt.protocols import Still, StillState

_LOG: Final = logging.getLogger(__name__)

_PHOTO: Final = "photo"  # camera mode
_ERRORS: Final = {
    "error_no_storage_space": "the memory card is full",
    "error_bad_state": "the camera is busy, or in another mode",
    "error": "the camera reports an error",
}
# States of ARSDK's `user_storage.state`, of the card and of its content, that take no photographs.
_UNUSABLE: Final = {
    "undetected": "the drone has no memory card",
    "too_small": "the memory card is too small",
    "too_slow": "the memory card is too slow",
    "usb_mass_storage": "the memory card is in use by a computer, over USB",
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
    """

    def __init__(
        self,
        send: Callable[[Order], None],
        commands: CommandQueue,
        web_address: Callable[[], tuple[str, int]],
    ) -> None:
        self._send_order = send
        self._commands = commands
        self._web_address = web_address
        self._lock = threading.Lock()  # guards all attributes below
        self._step = _Step.NOTHING
        self._stills: list[Still] = []
        self._restore: str | None = None  # camera mode from before the present photograph
        self._mode: str | None = None
        self._photo_mode: Mapping[str, Any] = {}
        self._available = True
        self._card: str | None = None  # why the memory card takes no photographs

    def take(self, name: str, args: Mapping[str, Any]) -> None:
        """Process an event, with enumerations as names."""
        if args.get("cam_id", 0) != 0:
            return
        with self._lock:
            if name == "camera.camera_mode":
                self._mode = args["mode"]
            elif name == "camera.photo_mode":
                self._photo_mode = args
            elif name == "camera.photo_state":
                self._available = args["available"] == "available"
            elif name == "camera.photo_progress":
                self._progressed(args["result"], args["media_id"])
            elif name == "user_storage.state":
                states = args["physical_state"], args["file_system_state"]
                self._card = next((_UNUSABLE[each] for each in states if each in _UNUSABLE), None)

    def take_still(self) -> int:
        """Ask for a photograph; return its number."""
        with self._lock:
            self._fail("another one was asked for")
            self._stills.append(Still())
            self._step = _Step.MODE
            refusal = self._card or self._other_mode()
            change = refusal is None and self._mode != _PHOTO
            if refusal is not None:
                self._fail(refusal)
            elif change and self._restore is None:
                self._restore = self._mode
        if change:
            self._send(orders.camera_mode(_PHOTO))
        self.advance()
        return len(self._stills) - 1

    def still(self, number: int) -> Still:
        """Return the present state of a photograph, by its number."""
        with self._lock:
            return self._stills[number]

    def fetch_still(self, media: str, limit_s: float) -> bytes:
        """Return a saved photograph as a JPEG file, within a limit of seconds; else DroneError."""
        return fetch_photo(*self._web_address(), media, limit_s)

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
            self._send(orders.TAKE_PHOTO)
        if restore is not None:
            self._send(orders.camera_mode(restore))

    def give_up(self) -> None:
        """End the present photograph, and restore the camera's mode."""
        with self._lock:
            self._fail("the drone was disconnected")
        self.advance()

    def _send(self, order: Order) -> None:
        """Send a command; a failure ends the photograph, and not the flight."""

        def send() -> None:
            try:
                self._send_order(order)
            except Exception as error:  # noqa: BLE001 - the SDK raises many kinds
                _LOG.warning("a command to the camera failed: %s: %s", type(error).__name__, error)
                with self._lock:
                    self._fail(f"the command to the camera failed: {error}")

        self._commands.submit(Kind.CAMERA, send)

    def _fail(self, reason: str) -> None:
        """End the present photograph, if there is one."""
        if self._step is not _Step.NOTHING:
            self._end(Still(state=StillState.FAILED, reason=reason))

    def _end(self, still: Still) -> None:
        self._stills[-1] = still
        self._step = _Step.NOTHING

    def _other_mode(self) -> str | None:
        """Return why the pilot's settings give no single JPEG; None if they do, or are unknown."""
        mode = self._photo_mode.get("mode", "single")
        file_format = str(self._photo_mode.get("file_format", "jpeg"))
        if mode != "single":
            return f"the camera is set to '{mode}': choose single photographs with FreeFlight"
        if "jpeg" not in file_format:
            return f"the camera is set to '{file_format}': choose JPEG with FreeFlight"
        return None

    def _progressed(self, result: str, media: str) -> None:
        if self._step not in {_Step.BEGIN, _Step.SAVE}:
            return  # of another program, or of a photograph that was given up
        if result in {"taking_photo", "photo_taken"}:
            self._step = _Step.SAVE
        elif result != "photo_saved":
            self._fail(self._card or _ERRORS.get(result, f"the camera reports '{result}'"))
        elif self._step is _Step.SAVE:
            self._end(Still(state=StillState.SAVED, media=media))
