"""Pictures of records, decoded when they are asked for; the last few are kept."""

from __future__ import annotations

from collections import OrderedDict
from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import FileError, InputError, ValueRangeError
from uav_bt.learning.dataset.flight_data import FlightData
from uav_bt.record import channels
from uav_bt.record.images import decode_image, image_bytes
from uav_bt.record.reader import RecordReader

__all__ = ["PictureStore"]

_NS: Final = 1_000_000_000
_OPEN_READERS: Final = 8  # of records read last


class PictureStore:
    """Decodes pictures of one size; bounded in memory, and safe to hand to another process.

    Args:
        size_px: width and height that pictures are resized to, never cropped.
        keep: how many pictures are kept.
    """

    def __init__(self, size_px: tuple[int, int], *, keep: int = 64) -> None:
        if min(size_px) < 1 or keep < 1:
            raise ValueRangeError(f"pictures need a size and a place to stay: {size_px}, {keep}")
        self._size_px = size_px
        self._keep = keep
        self._pictures: OrderedDict[tuple[str, int], NDArray[np.uint8]] = OrderedDict()
        self._readers: OrderedDict[str, RecordReader] = OrderedDict()

    def __getstate__(self) -> dict[str, Any]:
        """Leave what was read behind: another process reads for itself."""
        return {**self.__dict__, "_pictures": OrderedDict(), "_readers": OrderedDict()}

    def picture(self, flight: FlightData, place: int) -> NDArray[np.uint8]:
        """Return a flight's picture, (H, W, 3) uint8 RGB; not to be changed.

        Args:
            flight: the flight.
            place: the frame's place among those of the flight.

        Raises:
            FileError: the record was changed or damaged meanwhile.
        """
        key = (str(flight.path), place)
        found = self._pictures.get(key)
        if found is None:
            found = self._decoded(flight, int(flight.stored_ns[place]))
            found.flags.writeable = False
            self._pictures[key] = found
            if len(self._pictures) > self._keep:
                self._pictures.popitem(last=False)
        self._pictures.move_to_end(key)
        return found

    def _decoded(self, flight: FlightData, stored_ns: int) -> NDArray[np.uint8]:
        span = {"from_s": stored_ns / _NS, "to_s": (stored_ns + 1) / _NS}
        for message in self._reader(flight).messages([channels.CAMERA_IMAGE.topic], **span):
            try:
                image = decode_image(image_bytes(message.data))
            except InputError as error:
                raise FileError(flight.path, f"a picture is damaged: {error}") from error
            return _resized(image, self._size_px)
        raise FileError(flight.path, "a picture is not where the index has it: was it replaced?")

    def _reader(self, flight: FlightData) -> RecordReader:
        key = str(flight.path)
        if key not in self._readers:
            self._readers[key] = RecordReader(flight.path)
            if len(self._readers) > _OPEN_READERS:
                self._readers.popitem(last=False)
        self._readers.move_to_end(key)
        return self._readers[key]


def _resized(image: NDArray[np.uint8], size_px: tuple[int, int]) -> NDArray[np.uint8]:
    if image.shape[1::-1] == size_px:
        return image.copy()
    return np.asarray(cv2.resize(image, size_px, interpolation=cv2.INTER_AREA), dtype=np.uint8)
