"""Store of photographs, as the web interface of the drone lists them.

The format of the lists and names is that of public clients of the ANAFI's interface: Olympe's
`media` and the tests of Parrot's GroundSdk.
"""

from __future__ import annotations

import enum
import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, Final

from sim_bridge.loopback.world import Location

MAX_BYTES: Final = 256 * 2**20  # all photographs together; they are kept in memory
_FIRST_ID: Final = 10_000_000

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
    """Content of the drone's memory card; listeners are notified of each change.

    Args:
        run_id: identifier of the drone's present run.
        card: state of the memory card.
    """

    def __init__(self, run_id: str = "0" * 32, card: Card = Card.READY) -> None:
        self._run_id = run_id
        self._card = card
        self._photos: dict[str, Photo] = {}  # by id of the medium
        self._count = 0
        self._listeners: list[Listener] = []

    def __len__(self) -> int:
        """Return the number of media."""
        return len(self._photos)

    @property
    def used_bytes(self) -> int:
        """The total size of all photographs."""
        return sum(len(photo.jpeg) for photo in self._photos.values())

    @property
    def absent(self) -> bool:
        """Whether there is no memory card."""
        return self._card is Card.ABSENT

    @property
    def free_bytes(self) -> int:
        """The size of what still fits."""
        return max(0, MAX_BYTES - self.used_bytes) if self._card is Card.READY else 0

    @property
    def full(self) -> bool:
        """Whether another photograph would not fit."""
        return self.free_bytes == 0

    def add(self, photo: Photo) -> str:
        """Store a photograph and return the id of its medium."""
        self._count += 1
        media_id = str(_FIRST_ID + self._count)
        self._photos[media_id] = photo
        self._tell("media_created", media=self.medium(media_id))
        self._tell("resource_created", resource=self._resource(media_id))
        return media_id

    def media(self) -> list[Json]:
        """Return all media, oldest first."""
        return [self._medium(media_id) for media_id in self._photos]

    def medium(self, media_id: str) -> Json | None:
        """Return one medium; None if the id is unknown."""
        return self._medium(media_id) if media_id in self._photos else None

    def checksum(self, resource_id: str) -> Json | None:
        """Return the MD5 sum of a resource; None if the id is unknown."""
        media_id = self._media_id(resource_id)
        if media_id is None:
            return None
        digest = hashlib.md5(self._photos[media_id].jpeg, usedforsecurity=False).hexdigest()
        return {"media_id": media_id, "resource_id": resource_id, "md5": digest}

    def file(self, name: str, *, thumbnail: bool = False) -> bytes | None:
        """Return the content of a file; None if the name is unknown."""
        media_id = self._media_id(name)
        if media_id is None:
            return None
        photo = self._photos[media_id]
        return photo.thumbnail if thumbnail else photo.jpeg

    def remove(self, media_id: str) -> bool:
        """Delete a medium; return whether it existed."""
        if self._photos.pop(media_id, None) is None:
            return False
        self._tell("media_removed", media_id=media_id)
        return True

    def remove_resource(self, resource_id: str) -> bool:
        """Delete a resource and its medium, which has only this one; return whether it existed."""
        media_id = self._media_id(resource_id)
        if media_id is None:
            return False
        self._tell("resource_removed", resource_id=resource_id)
        return self.remove(media_id)

    def format(self) -> None:
        """Delete all files of the card, those that are not listed included."""
        if self._card is Card.FULL:
            self._card = Card.READY
        self.clear()

    def clear(self) -> None:
        """Delete all media."""
        self._photos.clear()
        self._tell("all_media_removed")

    def subscribe(self, listener: Listener) -> Callable[[], None]:
        """Notify a listener of all changes from now on; return the function that ends this."""
        self._listeners.append(listener)
        return lambda: self._listeners.remove(listener)

    def _tell(self, event: str, **data: object) -> None:
        for listener in tuple(self._listeners):
            listener({"name": event, "data": data})

    def _medium(self, media_id: str) -> Json:
        resource = self._resource(media_id)
        shared = ("media_id", "type", "datetime", "size", "thumbnail", "gps")
        return {
            **{name: resource[name] for name in shared if name in resource},
            "photo_mode": "SINGLE",
            "run_id": self._run_id,
            "resources": [resource],
        }

    def _resource(self, media_id: str) -> Json:
        photo, name = self._photos[media_id], _resource_id(media_id)
        place = photo.location
        gps = {} if place is None else {"gps": place.arguments}
        return {
            "media_id": media_id,
            "resource_id": name,
            "type": "PHOTO",
            "format": "JPG",
            "datetime": datetime.fromtimestamp(photo.taken_utc_s, UTC).strftime("%Y%m%dT%H%M%S%z"),
            "size": len(photo.jpeg),
            "url": f"/data/media/{name}",
            "thumbnail": f"/data/thumb/{name}",
            "width": photo.size_px[0],
            "height": photo.size_px[1],
            **gps,
        }

    def _media_id(self, resource_id: str) -> str | None:
        media_id = resource_id[: len(str(_FIRST_ID))]
        known = media_id in self._photos and resource_id == _resource_id(media_id)
        return media_id if known else None


def _resource_id(media_id: str) -> str:
    return f"{media_id}{(int(media_id) - _FIRST_ID) % 10_000:04d}.JPG"
