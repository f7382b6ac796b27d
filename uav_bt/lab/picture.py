"""Width and height of a PNG or JPEG file, from its header: nothing is unpacked."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from uav_bt.errors import FileError
from uav_bt.files import read_bounded

MAX_SIDE_PX: Final = 4096
MAX_BYTES: Final = 8_000_000
_PNG: Final = b"\x89PNG\r\n\x1a\n"
_JPEG: Final = b"\xff\xd8\xff"
_NO_SIZE: Final = (0xC4, 0xC8, 0xCC)  # JPEG segments among those of sizes that have none


def check_picture(path: Path) -> None:
    """Refuse a file that is no picture, or a large one."""
    data = read_bounded(path, MAX_BYTES)
    size_px = _png_size(data) if data.startswith(_PNG) else _jpeg_size(data)
    if size_px is None or min(size_px) < 1:
        raise FileError(path, "is no picture: expected a PNG or JPEG file")
    if max(size_px) > MAX_SIDE_PX:
        raise FileError(
            path,
            f"is a picture of {size_px[0]}x{size_px[1]} pixels: at most {MAX_SIDE_PX} a side, "
            "make it smaller",
        )


def _png_size(data: bytes) -> tuple[int, int] | None:
    if data[12:16] != b"IHDR" or len(data) < 24:
        return None
    return int.from_bytes(data[16:20], "big"), int.from_bytes(data[20:24], "big")


def _jpeg_size(data: bytes) -> tuple[int, int] | None:
    """Return the size in the first frame header; None without one."""
    if not data.startswith(_JPEG):
        return None
    place = 2
    while place + 9 <= len(data) and data[place] == 0xFF:
        kind = data[place + 1]
        if 0xC0 <= kind <= 0xCF and kind not in _NO_SIZE:
            high, wide = data[place + 5 : place + 7], data[place + 7 : place + 9]
            return int.from_bytes(wide, "big"), int.from_bytes(high, "big")
        place += 2 + int.from_bytes(data[place + 2 : place + 4], "big")
    return None
