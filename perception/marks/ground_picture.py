"""A bird's-eye picture of the ground, collected from views straight down in a fixed level frame.

Pictures hold texture, not brightness: the local mean is removed, so that light and exposure do not
matter. Cells that no view has shown have no texture.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.landing_marks import MarkView
from uav_bt.types import MIN_VIEW_HEIGHT_M, Pose2D
from uav_bt.types.arrays import Flags
from uav_bt.types.projection import project

Picture = NDArray[np.float32]

CELL_M: Final = 0.016  # of a picture. Chosen: a pixel of 320 columns covers 7 mm at 1.5 m.
STRAIGHT_RAD: Final = math.radians(-75.0)  # pitch up to which a view is straight down. Chosen.
_SIDE_PX: Final = 192  # of a picture, 3.1 m: a view straight down is 2.1 m wide at 1.5 m
_SMOOTH_M: Final = 0.012  # standard deviation of the filter against pixel noise. Chosen.
_LOCAL_M: Final = 0.12  # of the local mean that is removed. Chosen.
_BORDER_PX: Final = 2.0  # pixels at the image's border that do not count


@dataclass(frozen=True, kw_only=True, eq=False)
class GroundPicture:
    """Texture of the ground in a square around the origin of a level frame.

    Attributes:
        texture: (S, S) float32, rows along x, columns along y (to the right); 0 where unknown.
        known: (S, S) cells that were seen.
    """

    texture: Picture
    known: Flags


def middles_m() -> NDArray[np.float64]:
    """Return the middles of a picture's cells, (S * S, 2): x and y, metres."""
    along_m = (np.arange(_SIDE_PX) - (_SIDE_PX - 1) / 2.0) * CELL_M
    return np.stack(np.meshgrid(along_m, along_m, indexing="ij"), axis=-1).reshape(-1, 2)


def ground_picture(view: MarkView, frame: Pose2D) -> GroundPicture | None:
    """Return the ground of one view straight down.

    Every pixel counts as ground. Networks that were trained on oblique views see no ground in such
    a view: a floor without anything around it may be a wall.

    Args:
        view: Image, camera, gimbal pitch, and height of the lens above the ground.
        frame: Level frame of the picture, relative to the body: x forward, y right, yaw clockwise.

    Returns:
        The picture; None for another view, without a usable height, or far from the frame's origin.
    """
    height_m, pitch_rad = view.frame.height_above_ground_m, view.frame.gimbal_pitch_rad
    if not (height_m > MIN_VIEW_HEIGHT_M and pitch_rad <= STRAIGHT_RAD):
        return None
    image_px = view.frame.image.shape[:2]
    camera = view.camera.resized(image_px[1], image_px[0])
    places_m = frame.points_to_world(middles_m())
    places_m[:, 0] -= camera.forward_offset_m
    level_m = np.column_stack([places_m, np.full(len(places_m), height_m)])
    pixels = project(level_m, camera, pitch_rad).reshape(_SIDE_PX, _SIDE_PX, 2)
    limits_px = np.array(image_px[::-1]) - 1.0 - _BORDER_PX
    with np.errstate(invalid="ignore"):
        inside = (pixels >= _BORDER_PX) & (pixels <= limits_px)
    known: Flags = np.asarray(inside.all(axis=-1))
    if not known.any():
        return None
    columns, rows = (np.where(known, pixels[..., each], -1.0).astype(np.float32) for each in (0, 1))
    grey = cv2.cvtColor(view.frame.image, cv2.COLOR_RGB2GRAY)
    flat = cv2.remap(grey, columns, rows, cv2.INTER_LINEAR).astype(np.float32)
    return GroundPicture(texture=_texture(flat, known), known=known)


def _texture(grey: Picture, known: Flags) -> Picture:
    """Return a picture without its local mean and without pixel noise; unknown cells are 0."""
    weight = known.astype(np.float32)
    fine, coarse = (_mean(grey * weight, weight, std_m) for std_m in (_SMOOTH_M, _LOCAL_M))
    return np.asarray((fine - coarse) * weight, dtype=np.float32)


def _mean(weighted: Picture, weight: Picture, std_m: float) -> Picture:
    """Return the local mean of known cells."""
    std_px = std_m / CELL_M
    total = cv2.GaussianBlur(weighted, (0, 0), std_px)
    share = cv2.GaussianBlur(weight, (0, 0), std_px)
    return np.asarray(total / np.maximum(share, 1e-6), dtype=np.float32)


class GroundMosaic:
    """Mean of the pictures of several frames."""

    def __init__(self) -> None:
        self._total = np.zeros((_SIDE_PX, _SIDE_PX), dtype=np.float32)
        self._count = np.zeros((_SIDE_PX, _SIDE_PX), dtype=np.float32)
        self.pictures = 0

    def add(self, picture: GroundPicture) -> None:
        """Add the picture of a frame."""
        self._total += picture.texture
        self._count += picture.known
        self.pictures += 1

    def picture(self) -> GroundPicture:
        """Return the mean texture of the cells that were seen in at least one frame."""
        known = self._count > 0
        texture = (self._total / np.maximum(self._count, 1.0)).astype(np.float32)
        return GroundPicture(texture=texture, known=known)
