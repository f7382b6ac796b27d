"""Photographs of the drone's camera: taken, stored, and listed as its web interface does.

The format of the lists and names is that of public clients of the ANAFI's interface: Olympe's
`media` and the tests of Parrot's GroundSdk.
"""

from __future__ import annotations

import enum
import hashlib
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from sim_bridge.loopback.metadata import VideoFrame
from sim_bridge.loopback.world import Location
from uav_bt.errors import DroneError

MAX_BYTES: Final = 256 * 2**20  # all photographs together; they are kept in memory
_FIRST_ID: Final = 10_000_000
_RUN_ID: Final = "0" * 32  # identifier of the drone's present run
_QUALITY: Final = 92  # JPEG quality, per cent
_THUMBNAIL_PX: Final = (160, 90)

Json = Mapping[str, Any]
Listener = Callable[[Json], None]


class Card(enum.StrEnum):
    """State of the memory card when the drone is switched on."""

    READY = "ready"
    FULL = "full"  # by files that the web interface does not list
    ABSENT = "absent"


@dataclass(frozen=True, kw_only=True)
class Photo:
    """A photograph."""

    jpeg: bytes
    thumbnail: bytes  # small JPEG
    size_px: tuple[int, int]  # width and height
    taken_utc_s: float  # seconds since the epoch
    location: Location | None = None  # None: unknown


class MediaStore:
    """Photographs on the drone's memory card; listeners are notified of each new one.

    Args:
        card: state of the memory card.
    """

    def __init__(self, card: Card = Card.READY) -> None:
        self._card = card
        self._listeners: list[Listener] = []
        self.media: dict[str, Json] = {}  # entries of the list, by id, oldest first
        self.files: dict[str, bytes] = {}  # JPEGs by path

    def __len__(self) -> int:
        """Return the number of media."""
        return len(self.media)

    @property
    def absent(self) -> bool:
        """Whether there is no memory card."""
        return self._card is Card.ABSENT

    @property
    def full(self) -> bool:
        """Whether another photograph would not fit."""
        used_bytes = sum(medium["size"] for medium in self.media.values())
        return self._card is not Card.READY or used_bytes >= MAX_BYTES

    def add(self, photo: Photo) -> str:
        """Store a photograph and return the id of its medium."""
        number = len(self.media) + 1
        media_id = str(_FIRST_ID + number)
        name = f"{media_id}{number:04d}.JPG"
        url, thumbnail = f"/data/media/{name}", f"/data/thumb/{name}"
        shared = {
            "media_id": media_id,
            "type": "PHOTO",
            "datetime": datetime.fromtimestamp(photo.taken_utc_s, UTC).strftime("%Y%m%dT%H%M%S%z"),
            "size": len(photo.jpeg),
            "thumbnail": thumbnail,
        }
        if photo.location is not None:
            shared["gps"] = photo.location.arguments
        resource = {
            **shared,
            "resource_id": name,
            "format": "JPG",
            "url": url,
            "width": photo.size_px[0],
            "height": photo.size_px[1],
            "md5": hashlib.md5(photo.jpeg, usedforsecurity=False).hexdigest(),
        }
        medium = {**shared, "photo_mode": "SINGLE", "run_id": _RUN_ID, "resources": [resource]}
        self.media[media_id] = medium
        self.files |= {url: photo.jpeg, thumbnail: photo.thumbnail}
        self._tell("media_created", media=medium)
        self._tell("resource_created", resource=resource)
        return media_id

    def subscribe(self, listener: Listener) -> Callable[[], None]:
        """Notify a listener of all new ones from now on; return the function that ends this."""
        self._listeners.append(listener)
        return lambda: self._listeners.remove(listener)

    def _tell(self, event: str, **data: object) -> None:
        for listener in tuple(self._listeners):
            listener({"name": event, "data": data})


class Photographer:
    """Takes one photograph at a time, on a thread of its own.

    An OpenGL context belongs to one thread, and the thread of the video is busy with its frames.

    Args:
        newest: returns the newest frame of the camera; None before the first.
        finish: called once by `close` on the thread of `newest`.
    """

    def __init__(self, newest: Callable[[], VideoFrame | None], finish: Callable[[], None]) -> None:
        self._newest = newest
        self._finish: Callable[[], None] | None = finish
        self._thread = ThreadPoolExecutor(max_workers=1, thread_name_prefix="loopback-photos")

    def shoot(self) -> Future[Photo]:
        """Take a photograph."""
        return self._thread.submit(self._shoot)

    def close(self) -> None:
        """Finish the photograph in progress; safe to call twice."""
        finish, self._finish = self._finish, None
        if finish is not None:
            self._thread.submit(finish)
        self._thread.shutdown()

    def _shoot(self) -> Photo:
        frame = self._newest()
        if frame is None:
            raise DroneError("there is no image yet")
        height, width = frame.image.shape[:2]
        small = cv2.resize(frame.image, _THUMBNAIL_PX, interpolation=cv2.INTER_AREA)
        return Photo(
            jpeg=_jpeg(frame.image),
            thumbnail=_jpeg(np.asarray(small, np.uint8)),
            size_px=(width, height),
            taken_utc_s=frame.captured_utc_s,
            location=frame.location,
        )


def _jpeg(rgb: NDArray[np.uint8]) -> bytes:
    bgr = cv2.cvtColor(rgb, cv2.COLOR_RGB2BGR)
    return cv2.imencode(".jpg", bgr, [cv2.IMWRITE_JPEG_QUALITY, _QUALITY])[1].tobytes()
