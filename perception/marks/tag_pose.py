"""Pose of a level board of tags from the corners of its tags in one image."""

from __future__ import annotations

import cmath
import math
from typing import Final, NamedTuple

import numpy as np

from uav_bt.types import CameraModel
from uav_bt.types.arrays import Floats
from uav_bt.types.projection import pixel_rays, project

_ROUNDS: Final = 8  # Gauss-Newton converges within three or four
_STEP: Final = 1e-5  # of the numeric derivative, metres and radians
_ENOUGH: Final = 1e-6  # step below which the pose is final, metres and radians
_LEAST_DOWN: Final = 1e-3  # of a ray of unit depth: flatter rays do not meet the board


class BoardPose(NamedTuple):
    """Pose of a level board in the level frame of the camera."""

    forward_m: float  # its centre ahead of the lens
    right_m: float
    down_m: float
    up_rad: float  # direction of its upper edge from the heading, clockwise
    error_px: float  # root mean square distance of the corners from their projections


def level_pose(
    corners_m: Floats, corners_px: Floats, camera: CameraModel, gimbal_pitch_rad: float
) -> BoardPose | None:
    """Return the pose of a level board; None if no pose fits.

    The camera sees a level board on the plane one metre below it turned, shifted and scaled, which
    is linear in complex numbers. From there a least-squares fit moves the four coordinates. Corners
    are (4 N, 3) on the board (right, towards the upper edge, 0) and (4 N, 2) in the image.
    """
    rays = pixel_rays(corners_px, camera, gimbal_pitch_rad)
    if not rays[:, 2].min() > _LEAST_DOWN:
        return None
    board = corners_m[:, 1] + 1j * corners_m[:, 0]
    seen = (rays[:, 0] + 1j * rays[:, 1]) / rays[:, 2]
    off, spread = board - board.mean(), seen - seen.mean()
    turn = complex((off.conj() @ spread) / (off.conj() @ off))  # its length is 1 / down
    if turn == 0.0:
        return None
    down_m = 1.0 / abs(turn)
    middle = complex(seen.mean() - turn * board.mean()) * down_m
    pose = np.array([middle.real, middle.imag, down_m, cmath.phase(turn)])

    def residual(of: Floats) -> Floats:
        placed = placed_corners(corners_m, of)
        return np.asarray(project(placed, camera, gimbal_pitch_rad) - corners_px).ravel()

    for _ in range(_ROUNDS):
        error = residual(pose)
        slope = np.stack([(residual(pose + d) - error) / _STEP for d in _STEP * np.eye(4)], axis=1)
        if not np.isfinite(slope).all() or not np.isfinite(error).all():
            return None
        step = np.linalg.lstsq(slope, -error, rcond=None)[0]
        pose += step
        if np.abs(step).max() < _ENOUGH:
            break
    error = residual(pose)
    if not np.isfinite(error).all() or pose[2] <= 0.0:
        return None
    forward_m, right_m, down_m, up_rad = pose.tolist()
    error_px = float(np.sqrt(np.mean(error**2) * 2.0))
    return BoardPose(forward_m, right_m, down_m, math.remainder(up_rad, math.tau), error_px)


def placed_corners(corners_m: Floats, pose: Floats | BoardPose) -> Floats:
    """Return corners of a level board in the level frame, (4 N, 3)."""
    forward_m, right_m, down_m, up_rad = pose[:4]
    # Seen from above, the board's right is clockwise from its upper edge.
    placed = cmath.exp(1j * up_rad) * (corners_m[:, 1] + 1j * corners_m[:, 0])
    return np.stack(
        [placed.real + forward_m, placed.imag + right_m, np.full(len(placed), down_m)], axis=1
    )
