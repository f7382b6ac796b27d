"""Pose of a level board of tags from the corners of its tags in one image.

A detector's corners lie up to half a pixel inside a blurred black square, which makes it appear
smaller and farther away. The edges do not move when the image is blurred, so corners are taken as
the crossings of edges. The method is that of AprilTag's `refine_edges` (Wang and Olson, "AprilTag
2", IROS 2016).
"""

from __future__ import annotations

import cmath
import math
from typing import Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from uav_bt.types import CameraModel
from uav_bt.types.arrays import Floats
from uav_bt.types.projection import pixel_rays, project

_REACH_PX: Final = 2.0  # distance from the rough edge in which the real one is searched
_STEP_PX: Final = 0.25
_SAMPLES: Final = 24  # along an edge
_INNER: Final = (0.1, 0.9)  # part of an edge that is sampled: corners are rounded
_LEAST_SAMPLES: Final = 6
_MOST_MOVED_PX: Final = 3.0  # a corner that moves farther was not on the tag
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


def refine_corners(grey: NDArray[np.uint8], corners_px: Floats) -> Floats:
    """Return the corners of a dark square on a light ground, from lines along its edges.

    Corners are (4, 2) in turn, as (column, row); the rough ones if an edge is not found.
    """
    middle = corners_px.mean(axis=0)
    lines = []
    for begin, end in zip(corners_px, np.roll(corners_px, -1, axis=0), strict=True):
        along = (end - begin) / max(float(np.linalg.norm(end - begin)), 1e-9)
        outwards = np.array([along[1], -along[0]])
        if outwards @ (begin - middle) < 0.0:
            outwards = -outwards
        line = _edge(grey, begin, end, outwards)
        if line is None:
            return corners_px
        lines.append(line)
    # Corner i lies between the edge before it and the edge after it.
    pairs = np.stack([np.roll(lines, 1, axis=0), lines], axis=1)
    if np.abs(np.linalg.det(pairs[..., :2])).min() < 1e-6:  # parallel lines
        return corners_px
    found = np.linalg.solve(pairs[..., :2], pairs[..., 2:])[..., 0]
    moved_px = np.linalg.norm(found - corners_px, axis=1)
    return found if moved_px.max() <= _MOST_MOVED_PX else corners_px


def _edge(grey: NDArray[np.uint8], begin: Floats, end: Floats, outwards: Floats) -> Floats | None:
    """Return an edge as (normal x, normal y, distance); None without enough contrast.

    It goes roughly from `begin` to `end`; `outwards` is the unit normal away from the tag.
    """
    shares = np.linspace(*_INNER, _SAMPLES)[:, None]
    points = begin + shares * (end - begin)
    offsets_px = np.arange(-_REACH_PX, _REACH_PX + _STEP_PX / 2.0, _STEP_PX)
    # Brightness one pixel outside minus one pixel inside, at each offset: the weight of the offset.
    at = points[:, None, :] + offsets_px[None, :, None] * outwards
    rise = _sampled(grey, at + outwards) - _sampled(grey, at - outwards)
    weights = np.maximum(rise, 0.0) ** 2
    total = weights.sum(axis=1)
    sure = total > 0.0
    if np.count_nonzero(sure) < _LEAST_SAMPLES:
        return None
    shift_px = (weights[sure] * offsets_px).sum(axis=1) / total[sure]
    found = points[sure] + shift_px[:, None] * outwards
    centre = found.mean(axis=0)
    _, _, axes = np.linalg.svd(found - centre)
    normal = axes[1]
    return np.array([*normal, normal @ centre])


def _sampled(grey: NDArray[np.uint8], points: Floats) -> Floats:
    """Return the brightness at points (N, M, 2) as (N, M), between pixels bilinearly."""
    columns, rows = np.moveaxis(points.astype(np.float32), -1, 0)
    values, border = grey.astype(np.float32), cv2.BORDER_REPLICATE
    found = cv2.remap(values, columns, rows, cv2.INTER_LINEAR, borderMode=border)
    return np.asarray(found, dtype=np.float64)
