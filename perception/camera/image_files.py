"""Image files: listing and reading them, and the orientation that a file gives its images.

A drone or phone that is mounted upside down stores the sensor's rows unchanged and records in the
file how a player must turn them: in EXIF data, or in what FFmpeg calls the display matrix.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Literal

import cv2
import numpy as np

from uav_bt.errors import FileError, ValueRangeError
from uav_bt.files import reading
from uav_bt.types import CameraModel
from uav_bt.types.arrays import Floats, Image

IMAGE_SUFFIXES: Final = (".bmp", ".jpeg", ".jpg", ".png", ".tif", ".tiff", ".webp")
# Formats of phones and cameras that messages name but that cannot be read.
FOREIGN_SUFFIXES: Final = (".arw", ".avif", ".cr2", ".cr3", ".dng", ".heic", ".heif", ".nef")
_JPEG_MARK: Final = b"\xff\xd8"
_EXIF_MARK: Final = b"Exif\0\0"
_PNG_MARKS: Final = b"\x89PNG", b"eXIf"
_EXIF_BYTES: Final = 65_536 + 64  # longest JPEG segment, and the segment before it
_ORIENTATION_TAG: Final = 0x0112
_NAMED: Final = 3  # files that a message lists
_SLACK: Final = 0.01  # of the matrix's largest entry, 0.6 degrees, counts as none; chosen


@dataclass(frozen=True, kw_only=True)
class Orientation:
    """A rotation by a multiple of 90 degrees and a mirroring: transpose first, then flip."""

    transpose: bool = False  # swap columns and rows
    flip_columns: bool = False  # swap left and right
    flip_rows: bool = False  # swap top and bottom

    @staticmethod
    def from_display_matrix(matrix: Floats) -> Orientation:
        """Return the orientation of a display matrix, (2, 2) of any scale: a, b, c, d.

        Column x and row y are shown at column a x + c y and row b x + d y. ValueRangeError if the
        angle is not a multiple of 90 degrees.
        """
        kept = np.where(np.abs(matrix) > _SLACK * np.abs(matrix).max(), matrix, 0.0)
        (a, b), (c, d) = kept.tolist()
        if a and d and not b and not c:
            return Orientation(flip_columns=a < 0, flip_rows=d < 0)
        if b and c and not a and not d:
            return Orientation(transpose=True, flip_columns=c < 0, flip_rows=b < 0)
        raise ValueRangeError(
            f"the orientation must be a multiple of 90 degrees, got the matrix {matrix.tolist()}; "
            "turn the video with a video editor first"
        )

    @property
    def upright(self) -> bool:
        """Whether images stay as they are."""
        return not (self.transpose or self.flip_columns or self.flip_rows)

    def image(self, rgb: Image) -> Image:
        """Return an image, (H, W, 3) uint8, as a player shows it."""
        shown = rgb.swapaxes(0, 1) if self.transpose else rgb
        rows, columns = (-1 if flip else 1 for flip in (self.flip_rows, self.flip_columns))
        return np.ascontiguousarray(shown[::rows, ::columns])

    def camera(self, raw: CameraModel) -> CameraModel:
        """Return the camera of the images as shown, from that of the images as stored.

        ValueRangeError if they are turned for it and the lens has more than k1, k2, p1, p2, k3.
        """
        if self.upright:
            return raw
        if len(raw.distortion) > 5:
            raise ValueRangeError(
                f"a turned video needs a camera of five distortion numbers or fewer, got "
                f"{len(raw.distortion)}; calibrate with `uav-bt lab calibrate`"
            )
        # Tangential terms: dx = 2 p1 x y + p2 (r2 + 2 x2), so p2 belongs to columns, p1 to rows.
        k1, k2, p1, p2, *k3 = raw.distortion or (0.0, 0.0, 0.0, 0.0)
        columns = (raw.width_px, raw.fx_px, raw.cx_px, p2)
        rows = (raw.height_px, raw.fy_px, raw.cy_px, p1)
        (width, fx, cx, p2), (height, fy, cy, p1) = (
            (rows, columns) if self.transpose else (columns, rows)
        )
        if self.flip_columns:
            cx, p2 = width - 1 - cx, -p2
        if self.flip_rows:
            cy, p1 = height - 1 - cy, -p1
        bent = (k1, k2, p1, p2, *k3) if raw.distortion else ()
        turned = replace(raw, width_px=width, height_px=height, fx_px=fx, fy_px=fy)
        return replace(turned, cx_px=cx, cy_px=cy, distortion=bent)


UPRIGHT: Final = Orientation()  # images that are shown as they are stored


def image_files(folder: Path) -> tuple[list[Path], str]:
    """Return the images of a folder (FileError without any), and a line about other formats."""
    inside = sorted(folder.iterdir())
    found = [path for path in inside if path.suffix.lower() in IMAGE_SUFFIXES]
    foreign = [path for path in inside if path.suffix.lower() in FOREIGN_SUFFIXES]
    line = conversion_advice(foreign) if foreign else ""
    if not found:
        known = ", ".join(suffix.removeprefix(".") for suffix in IMAGE_SUFFIXES)
        other = f"; it holds {line}" if line else ""
        raise FileError(folder, f"the folder holds no images ({known}){other}")
    return found, line


def conversion_advice(foreign: list[Path]) -> str:
    """Return a line about files of formats that are not read."""
    names = ", ".join(path.name for path in foreign[:_NAMED])
    more = f" and {len(foreign) - _NAMED} more" if len(foreign) > _NAMED else ""
    formats = ", ".join(sorted({path.suffix.lower().removeprefix(".") for path in foreign}))
    return (
        f"{len(foreign)} of a format that is not read ({formats}): {names}{more}; convert them "
        f"to PNG, for example with `magick mogrify -format png *{foreign[0].suffix}`"
    )


def read_image(path: Path, *, colour: bool, as_stored: bool) -> Image:
    """Read an image file as (H, W, 3) RGB, or (H, W) grey; FileError if it holds no image.

    Unless `as_stored`, the EXIF orientation is applied. Images of more than 8 bits are shifted down
    by the bits that they use, for example 12 in a 16-bit file.
    """
    if path.suffix.lower() in FOREIGN_SUFFIXES:
        raise FileError(path, conversion_advice([path]))
    with reading(path):
        encoded = np.fromfile(path, dtype=np.uint8)
    flags = cv2.IMREAD_ANYDEPTH | (cv2.IMREAD_COLOR if colour else cv2.IMREAD_GRAYSCALE)
    if as_stored:
        flags |= cv2.IMREAD_IGNORE_ORIENTATION
    # OpenCV raises on an empty buffer, and returns None for data without an image.
    image = cv2.imdecode(encoded, flags) if encoded.size else None
    if image is None or image.dtype not in (np.uint8, np.uint16):
        raise FileError(path, "is not a readable image")
    if image.dtype == np.uint16:
        image = np.right_shift(image.astype(np.uint16), max(int(image.max()).bit_length() - 8, 0))
    grey_or_rgb = cv2.cvtColor(image, cv2.COLOR_BGR2RGB) if colour else image
    return np.asarray(grey_or_rgb, dtype=np.uint8)


def exif_orientation(path: Path) -> Orientation:
    """Return the orientation in the EXIF data of a JPEG or PNG file; upright without one."""
    with reading(path), path.open("rb") as file:
        head = file.read(_EXIF_BYTES)
    mark = _EXIF_MARK if head.startswith(_JPEG_MARK) else _PNG_MARKS[1]
    begin = head.find(mark)
    if not head.startswith((_JPEG_MARK, _PNG_MARKS[0])) or begin < 0:
        return UPRIGHT
    tiff = head[begin + len(mark) :]
    order: Literal["little", "big"] = "little" if tiff.startswith(b"II") else "big"
    place = int.from_bytes(tiff[4:8], order)
    count = int.from_bytes(tiff[place : place + 2], order)
    for entry in range(place + 2, place + 2 + 12 * count, 12):  # tag, type, count, value
        if int.from_bytes(tiff[entry : entry + 2], order) == _ORIENTATION_TAG:
            value = int.from_bytes(tiff[entry + 8 : entry + 10], order)  # EXIF 2.3, table 4
            return Orientation(
                transpose=value in (5, 6, 7, 8),
                flip_columns=value in (2, 3, 6, 7),
                flip_rows=value in (3, 4, 7, 8),
            )
    return UPRIGHT
