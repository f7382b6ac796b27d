"""Frames, class maps and depth maps as images in standard formats, and back.

`foxglove-sdk` cannot read protobuf messages, and other packages pin the version of Python's
protobuf. Therefore this module reads the few fields that are needed.
"""

from __future__ import annotations

from typing import Any, Final

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import InputError
from uav_bt.record import Quality

# On noisy 640x360 frames: 11 ms and 406 kB; libpng's default takes 21 ms for 402 kB.
_HUFFMAN_ONLY: Final = 2
_HAS_FILTER: Final = hasattr(cv2, "IMWRITE_PNG_FILTER")  # not before OpenCV 4.12
_PNG: Final = [
    *(cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_STRATEGY, _HUFFMAN_ONLY),
    *((cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_AVG) if _HAS_FILTER else ()),
]
_JPEG: Final = [cv2.IMWRITE_JPEG_QUALITY, 90]
_SMALL_WIDTH_PX: Final = 320

# foxglove.RawImage's names of our pixel types.
ENCODINGS: Final = {"uint8": "mono8", "uint16": "16UC1", "float32": "32FC1"}
_DTYPES: Final = {"mono8": "<u1", "16UC1": "<u2", "32FC1": "<f4"}
_MAX_PIXELS: Final = 50_000_000  # twice a photograph's; a small PNG can have billions
_PNG_HEAD: Final = b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR"
_JPEG_FRAMES: Final = frozenset(range(0xC0, 0xD0)) - {0xC4, 0xC8, 0xCC}  # markers with a size
_MAX_MM: Final = 65_535
# Field numbers of foxglove.CompressedImage and foxglove.RawImage.
_COMPRESSED_DATA: Final = 2
_WIDTH, _HEIGHT, _ENCODING, _DATA = 2, 3, 4, 6
_BYTES, _FIXED = 2, 5  # protobuf's wire types
_FIXED_BYTES: Final = 4
_MAX_VARINT_BYTES: Final = 10  # 64 bits in groups of seven


def encode_image(image: NDArray[np.uint8], quality: Quality) -> tuple[bytes, str]:
    """Return an image, (H, W, 3) RGB, as a file's bytes, and Foxglove's name of the format."""
    if quality == "small" and image.shape[1] > _SMALL_WIDTH_PX:
        height_px = max(1, round(image.shape[0] * _SMALL_WIDTH_PX / image.shape[1]))
        small = cv2.resize(image, (_SMALL_WIDTH_PX, height_px), interpolation=cv2.INTER_AREA)
        image = np.asarray(small, dtype=np.uint8)
    suffix, options = (".png", _PNG) if quality == "lossless" else (".jpg", _JPEG)
    _, data = cv2.imencode(suffix, cv2.cvtColor(image, cv2.COLOR_RGB2BGR), options)
    return data.tobytes(), "png" if quality == "lossless" else "jpeg"


def decode_image(data: bytes | memoryview) -> NDArray[np.uint8]:
    """Return the image of a PNG or JPEG, (H, W, 3) RGB; InputError if it is none."""
    return np.ascontiguousarray(_decoded(data, cv2.IMREAD_COLOR)[..., ::-1])


def encode_bytes(values: NDArray[np.uint8]) -> bytes:
    """Return (H, W) bytes as a PNG with one byte per pixel."""
    return cv2.imencode(".png", values)[1].tobytes()


def decode_bytes(data: bytes) -> NDArray[np.uint8]:
    """Return the (H, W) bytes of a PNG of `encode_bytes`; InputError as `decode_image`."""
    return _decoded(data, cv2.IMREAD_GRAYSCALE)


def _decoded(data: bytes | memoryview, how: int) -> NDArray[np.uint8]:
    width_px, height_px = image_size(data)
    if width_px * height_px > _MAX_PIXELS:
        raise InputError(f"an image of {width_px}x{height_px} has more than {_MAX_PIXELS} pixels")
    image = cv2.imdecode(np.frombuffer(data, dtype=np.uint8), how)
    if image is None:
        raise InputError(f"a PNG or JPEG image of {len(data)} bytes is damaged")
    return image.astype(np.uint8, copy=False)


def image_size(data: bytes | memoryview) -> tuple[int, int]:
    """Return width and height of a PNG or JPEG, px; InputError if it is neither."""
    view = memoryview(data)
    if bytes(view[:16]).startswith(_PNG_HEAD) and len(view) > 24:
        return int.from_bytes(view[16:20]), int.from_bytes(view[20:24])
    at = 2 if bytes(view[:2]) == b"\xff\xd8" else len(view)
    while at + 9 <= len(view) and view[at] == 0xFF:
        if view[at + 1] in _JPEG_FRAMES:
            return int.from_bytes(view[at + 7 : at + 9]), int.from_bytes(view[at + 5 : at + 7])
        # Fill bytes 0xFF may stand between two segments.
        at += 1 if view[at + 1] == 0xFF else 2 + int.from_bytes(view[at + 2 : at + 4])
    raise InputError(f"expected a PNG or JPEG image, got {len(view)} bytes of neither")


def image_bytes(message: bytes) -> bytes:
    """Return the image file in a foxglove.CompressedImage."""
    contents = fields(message)
    if _COMPRESSED_DATA not in contents:
        raise InputError("expected a foxglove.CompressedImage with data, got none")
    return bytes(contents[_COMPRESSED_DATA])


def raw_image(message: bytes) -> NDArray[Any]:
    """Return the pixels of a foxglove.RawImage, (H, W)."""
    contents = fields(message)
    try:
        dtype = _DTYPES[bytes(contents[_ENCODING]).decode()]
        shape = [int.from_bytes(contents[side], "little") for side in (_HEIGHT, _WIDTH)]
        return np.frombuffer(contents[_DATA], dtype=dtype).reshape(shape).copy()
    except (LookupError, ValueError) as error:
        raise InputError(f"expected a foxglove.RawImage as records have it: {error}") from error


def millimetres(depth_m: NDArray[np.float32]) -> NDArray[np.uint16]:
    """Return metres as whole millimetres: at most 65.535 m; 0 where not finite."""
    with np.errstate(invalid="ignore"):
        mm = np.clip(np.rint(depth_m * 1000.0), 0, _MAX_MM)
    return np.where(np.isfinite(depth_m), mm, 0).astype(np.uint16)


def fields(message: bytes) -> dict[int, memoryview]:
    """Return the contents of a protobuf message by field; of repeated ones the last.

    InputError if it is no message of texts, bytes and fixed 32-bit numbers.
    """
    contents: dict[int, memoryview] = {}
    view, at = memoryview(message), 0
    while at < len(view):
        tag, at = _varint(view, at)
        number, kind = tag >> 3, tag & 7
        size = _FIXED_BYTES
        if kind != _FIXED:
            size, at = _varint(view, at)
        contents[number] = view[at : at + size]
        if kind not in (_FIXED, _BYTES) or len(contents[number]) < size:
            raise InputError(f"expected a protobuf message, got one that is damaged at byte {at}")
        at += size
    return contents


def _varint(view: memoryview, at: int) -> tuple[int, int]:
    value = 0
    for place, byte in enumerate(view[at : at + _MAX_VARINT_BYTES]):
        value |= (byte & 0x7F) << (7 * place)
        if byte < 0x80:
            return value, at + place + 1
    raise InputError("expected a protobuf message, got an unfinished number")
