"""The orientation that a video's metadata gives its frames, applied to images and cameras.

A drone or phone that is mounted upside down stores the sensor's rows unchanged and records in the
file how a player must turn them. FFmpeg calls this record the display matrix.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from uav_bt.errors import ValueRangeError
from uav_bt.types import CameraModel
from uav_bt.types.arrays import Floats, Image

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
        largest = float(np.abs(matrix).max())
        kept = np.where(np.abs(matrix) > _SLACK * largest, matrix, 0.0)
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
        shown = shown[:, ::-1] if self.flip_columns else shown
        shown = shown[::-1] if self.flip_rows else shown
        return np.ascontiguousarray(shown)

    def camera(self, raw: CameraModel) -> CameraModel:
        """Return the camera of shown images from the camera of raw ones.

        ValueRangeError if they are turned and the lens has more numbers than k1, k2, p1, p2, k3.
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
        if self.transpose:
            columns, rows = rows, columns
        width_px, fx_px, cx_px, p2 = _flipped(*columns) if self.flip_columns else columns
        height_px, fy_px, cy_px, p1 = _flipped(*rows) if self.flip_rows else rows
        return replace(
            raw,
            width_px=width_px,
            height_px=height_px,
            fx_px=fx_px,
            fy_px=fy_px,
            cx_px=cx_px,
            cy_px=cy_px,
            distortion=(k1, k2, p1, p2, *k3) if raw.distortion else (),
        )


def _flipped(
    size_px: int, focal_px: float, centre_px: float, tangential: float
) -> tuple[int, float, float, float]:
    return size_px, focal_px, size_px - 1 - centre_px, -tangential


UPRIGHT: Final = Orientation()
"""Images that are shown as they are stored."""
