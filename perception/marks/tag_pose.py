"""Pose of a level board of tags from the corners of its tags in one image."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.types import CameraModel
from uav_bt.types.arrays import Floats
from uav_bt.types.projection import camera_axes, project

_ROUNDS: Final = 8  # Gauss-Newton converges within three or four
_STEP: Final = 1e-5  # of the numeric derivative, metres and radians
_ENOUGH: Final = 1e-6  # step below which the pose is final, metres and radians


@dataclass(frozen=True, kw_only=True)
class BoardPose:
    """Pose of a level board in the level frame of the camera.

    Attributes:
        forward_m: Centre of the board ahead of the lens.
        right_m: Centre of the board to the right of the lens.
        down_m: Centre of the board below the lens.
        up_rad: Direction of the board's upper edge from the heading, clockwise.
        error_px: Root mean square distance of the corners from their projections.
        tilt_rad: Angle of the board to the horizontal, before it is taken as level.
    """

    forward_m: float
    right_m: float
    down_m: float
    up_rad: float
    error_px: float
    tilt_rad: float


def level_pose(
    corners_m: Floats, corners_px: Floats, camera: CameraModel, gimbal_pitch_rad: float
) -> BoardPose | None:
    """Return the pose of a level board; None if no pose fits.

    IPPE gives two poses that fit a small flat target almost equally well. The one whose plane is
    nearer to the horizontal begins a least-squares fit with the four coordinates of a level board.
    After: Collins and Bartoli, "Infinitesimal Plane-Based Pose Estimation", IJCV 2014.

    Args:
        corners_m: (4 N, 3) corners on the board: right, towards the upper edge, 0.
        corners_px: (4 N, 2) the same corners in the image, as (column, row).
        camera: Intrinsics at the image's size.
        gimbal_pitch_rad: Pitch of the gimbal; 0 is level, negative is down.
    """
    found = _candidates(corners_m, corners_px, camera)
    if not found:
        return None
    axes = camera_axes(gimbal_pitch_rad)
    places = [(axes @ turn, axes @ shift) for turn, shift in found]
    turn, shift = min(places, key=lambda place: float(place[0][2, 2]))  # z down: a normal is -1
    tilt_rad = math.acos(min(1.0, max(-1.0, -float(turn[2, 2]))))
    pose = np.array([*shift, math.atan2(turn[1, 1], turn[0, 1])])

    def residual(of: NDArray[np.float64]) -> NDArray[np.float64]:
        placed = _placed(corners_m, of)
        return np.asarray(project(placed, camera, gimbal_pitch_rad) - corners_px).ravel()

    for _ in range(_ROUNDS):
        off = residual(pose)
        slope = np.stack([(residual(pose + d) - off) / _STEP for d in _STEP * np.eye(4)], axis=1)
        if not np.isfinite(slope).all() or not np.isfinite(off).all():
            return None
        step = np.linalg.lstsq(slope, -off, rcond=None)[0]
        pose += step
        if np.abs(step).max() < _ENOUGH:
            break
    off = residual(pose)
    if not np.isfinite(off).all() or pose[2] <= 0.0:
        return None
    return BoardPose(
        forward_m=float(pose[0]),
        right_m=float(pose[1]),
        down_m=float(pose[2]),
        up_rad=math.remainder(float(pose[3]), math.tau),
        error_px=float(np.sqrt(np.mean(off**2) * 2.0)),
        tilt_rad=tilt_rad,
    )


def _candidates(
    corners_m: Floats, corners_px: Floats, camera: CameraModel
) -> list[tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Return rotations (3, 3) and translations (3,) from the board to the camera."""
    lens = np.array(
        [[camera.fx_px, 0.0, camera.cx_px], [0.0, camera.fy_px, camera.cy_px], [0.0, 0.0, 1.0]]
    )
    # IPPE_SQUARE needs one square around the origin.
    middle = corners_m.mean(axis=0)
    method = cv2.SOLVEPNP_IPPE_SQUARE if len(corners_m) == 4 else cv2.SOLVEPNP_IPPE
    count, turns, shifts, _ = cv2.solvePnPGeneric(
        np.ascontiguousarray(corners_m - middle),
        np.ascontiguousarray(corners_px, dtype=np.float64),
        lens,
        None,
        flags=method,
    )
    found = []
    for turn, shift in zip(turns[:count], shifts[:count], strict=True):
        rotation = np.asarray(cv2.Rodrigues(turn)[0], dtype=np.float64)
        place = shift.ravel() - rotation @ middle
        if np.isfinite(rotation).all() and np.isfinite(place).all():
            found.append((rotation, place))
    return found


def _placed(corners_m: Floats, pose: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return corners of a level board in the level frame, for (forward, right, down, up)."""
    cos, sin = math.cos(pose[3]), math.sin(pose[3])
    right_m, up_m = corners_m[:, 0], corners_m[:, 1]
    # Seen from above, the board's right is clockwise from its upper edge.
    forward_m, aside_m = cos * up_m - sin * right_m, sin * up_m + cos * right_m
    flat = np.stack([forward_m, aside_m, np.zeros(len(corners_m))], axis=1)
    return np.asarray(flat + pose[:3])
