"""Photographs of a calibration board, taken in the twin's room."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray

from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.gl import load_mujoco
from sim_bridge.twin.scene import ROOM_SIZE_M, Lighting, Scene, TakeOffSpec

load_mujoco()

from sim_bridge.twin import model as twin_model  # noqa: E402  (after load_mujoco)
from sim_bridge.twin.render import Renderer  # noqa: E402  (after load_mujoco)

_CENTRE_M = (0.0, 0.0, 1.5)
_SQUARE_PX = 32


def _texture(squares: tuple[int, int]) -> NDArray[np.uint8]:
    """Draw (columns, rows) squares with a white border of one square."""
    columns, rows = squares
    checks = (np.add.outer(np.arange(rows), np.arange(columns)) % 2).astype(np.uint8)
    bordered = np.pad(20 + 200 * checks, 1, constant_values=235).astype(np.uint8)
    grey = bordered.repeat(_SQUARE_PX, axis=0).repeat(_SQUARE_PX, axis=1)
    return np.repeat(grey[..., None], 3, axis=-1)


def photograph(
    poses: Iterable[CameraPose],
    *,
    squares: tuple[int, int] = (25, 14),
    square_m: float = 0.02,
    size_px: tuple[int, int] = (960, 540),
) -> Iterator[NDArray[np.uint8]]:
    """Draw the board, upright at the room's middle and facing -x, from poses.

    Args:
        poses: of the lens.
        squares: columns and rows of the board.
        square_m: edge of a square.
        size_px: width and height of the pictures.

    Yields:
        (H, W, 3) uint8 RGB.
    """
    builder = twin_model._Builder(
        Scene(name="board", take_off=TakeOffSpec(random=True)), drawn=True
    )
    builder.room(ROOM_SIZE_M)
    builder.lights(Lighting(ambient=0.9, direction=(0.6, 0.2, -0.6)))
    builder.texture("board", partial(_texture, squares))
    width_m, height_m = ((count + 2) * square_m for count in squares)
    solid = twin_model.Solid(half_m=(0.002, width_m / 2, height_m / 2), centre_m=_CENTRE_M)
    builder.show("board/seen", solid, material="board", class_id=0, tile_m=(width_m, height_m))
    with Renderer(builder.done(()), samples=4) as renderer:
        for pose in poses:
            yield renderer.rgb(pose, *size_px)


def board_poses(count: int, generator: np.random.Generator) -> list[CameraPose]:
    """Draw poses that see a board of 0.5 x 0.3 m whole, tilted and off the middle."""
    poses = []
    for _ in range(count):
        distance = generator.uniform(0.55, 0.85)
        around, over = generator.uniform(-0.6, 0.6), generator.uniform(-0.5, 0.5)
        x = -distance * math.cos(around) * math.cos(over)
        y, z = distance * math.sin(around) * math.cos(over), distance * math.sin(over)
        aside = generator.uniform(-0.1, 0.1, 2)
        poses.append(
            CameraPose(
                x_m=x,
                y_m=y,
                z_m=_CENTRE_M[2] + z,
                yaw_rad=-around + aside[0],
                pitch_rad=-over + aside[1],
            )
        )
    return poses
