"""Camera track of a whole flight, fitted to telemetry and to motions measured on the ground.

Telemetry's heading has an error of a third of a degree, which shifts an image of 448 pixels by
two. Motions measured on the ground (`perception.odometry.camera_track.measured_motion`) are exact,
but many pairs of frames show too little of it. A least-squares fit of headings and positions
combines both. Its weights fall with the residual, because a measurement may follow the top of an
object instead of the ground.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Final

import numpy as np
from scipy.sparse import coo_matrix
from scipy.sparse.linalg import spsolve
from scipy.spatial.transform import Rotation

from perception.odometry.camera_track import CameraTrack, Footage, measured_motion
from perception.odometry.visual import OdometryConfig
from uav_bt.types import Pose2D, rotate
from uav_bt.types.arrays import Floats
from uav_bt.types.projection import camera_axes

_ROUNDS: Final = 8  # of fitting and reweighting
_OUTLIER: Final = 2.0  # standard deviations at which a residual has half of its weight


@dataclass(frozen=True, kw_only=True)
class TrackFitConfig:
    """Which frames are compared, and the errors of the two sources. Numbers are chosen."""

    gaps: tuple[int, ...] = (1, 2, 4, 8)  # frames between the two frames of a pair
    # No mask shows the ground here: many points are tracked, and few of them must agree.
    following: OdometryConfig = field(
        default_factory=lambda: OdometryConfig(
            points=500, quality=0.005, spacing_px=4, min_points=15, max_range_m=5.0
        )
    )
    measured_rad: float = 0.0015  # standard deviation of a measured turn over one gap
    measured_m: float = 0.004  # of a measured displacement
    reported_rad: float = 0.004  # of telemetry's turn from frame to frame
    reported_m: float = 0.003  # of telemetry's displacement
    anywhere_rad: float = 0.02  # of telemetry's heading
    anywhere_m: float = 0.3  # of telemetry's position


def fitted_track(
    footage: Footage, track: CameraTrack, config: TrackFitConfig | None = None
) -> CameraTrack:
    """Return the camera track that agrees best with telemetry and the ground in the frames.

    Args:
        footage: one flight.
        track: its track from telemetry, `camera_track`.
        config: which frames are compared.
    """
    config = config or TrackFitConfig()
    pairs, motions = _measured(footage, track, config)
    count = len(footage)
    steps = [(frame, frame + 1) for frame in range(count - 1)]
    # Index -1 is the origin of the frame of reference.
    anchors = [(-1, frame) for frame in range(count)]
    every = np.array([*pairs, *steps, *anchors])
    apart = np.sqrt([second - first for first, second in pairs])

    turns = [motion.yaw_rad for motion in motions]
    reported = track.yaw_rad
    yaw_rad = _fit(
        every,
        np.concatenate([turns, np.diff(reported), reported])[:, None],
        np.concatenate(
            [
                config.measured_rad * apart,
                np.full(len(steps), config.reported_rad),
                np.full(count, config.anywhere_rad),
            ]
        ),
        count,
    )[:, 0]

    level_m = track.position_m[:, :2]
    turned = yaw_rad - reported
    shifts = [
        rotate(motion.x_m, motion.y_m, float(yaw_rad[first]))
        for (first, _), motion in zip(pairs, motions, strict=True)
    ]
    moved = [
        rotate(float(x_m), float(y_m), float(turn))
        for (x_m, y_m), turn in zip(np.diff(level_m, axis=0), turned[:-1], strict=True)
    ]
    position_m = _fit(
        every,
        np.array([*shifts, *moved, *level_m.tolist()]),
        np.concatenate(
            [
                config.measured_m * apart,
                np.full(len(steps), config.reported_m),
                np.full(count, config.anywhere_m),
            ]
        ),
        count,
    )
    about_down = Rotation.from_rotvec(np.multiply.outer(yaw_rad, (0.0, 0.0, 1.0))).as_matrix()
    axes = np.stack([camera_axes(float(pitch)) for pitch in footage.gimbal_pitch_rad])
    return replace(
        track,
        rotation=about_down @ axes,
        position_m=np.column_stack([position_m, track.position_m[:, 2]]),
        yaw_rad=yaw_rad,
    )


def _measured(
    footage: Footage, track: CameraTrack, config: TrackFitConfig
) -> tuple[list[tuple[int, int]], list[Pose2D]]:
    """Return pairs of frames, and the measured pose of the second lens in the first's frame."""
    pairs, motions = [], []
    for gap in config.gaps:
        for first in range(0, len(footage) - gap, max(1, gap // 2)):
            motion = measured_motion(footage, track, first, first + gap, config.following)
            if motion is not None:
                pitches = footage.gimbal_pitch_rad[[first, first + gap]]
                pairs.append((first, first + gap))
                motions.append(_level(motion, float(pitches[0]), float(pitches[1])))
    return pairs, motions


def _level(motion: Floats, first_rad: float, second_rad: float) -> Pose2D:
    """Return the pose of the second lens in the level frame of the first.

    Args:
        motion: (3, 4), transform of points between the two cameras.
        first_rad: gimbal pitch of the first camera.
        second_rad: gimbal pitch of the second camera.
    """
    first, second = camera_axes(first_rad), camera_axes(second_rad)
    turn = second @ motion[:, :3] @ first.T
    place = -first @ motion[:, :3].T @ motion[:, 3]
    yaw_rad = math.atan2(turn[0, 1], turn[0, 0])
    return Pose2D(x_m=float(place[0]), y_m=float(place[1]), yaw_rad=yaw_rad)


def _fit(pairs: Floats, differences: Floats, errors: Floats, count: int) -> Floats:
    """Return the values whose differences agree best with measured ones, (count, D).

    Args:
        pairs: (N, 2), indices of the first and second value; -1 is a value of zero.
        differences: (N, D), second minus first.
        errors: (N,), standard deviations.
        count: number of values.
    """
    rows = np.arange(len(pairs))
    known = pairs[:, 0] >= 0
    signs = np.concatenate([np.ones(len(pairs)), -np.ones(int(known.sum()))])
    places: Sequence[Floats] = (
        np.concatenate([rows, rows[known]]),
        np.concatenate([pairs[:, 1], pairs[known, 0]]),
    )
    matrix = coo_matrix((signs, tuple(places)), shape=(len(pairs), count)).tocsr()
    weights = 1.0 / errors
    values = np.zeros((count, differences.shape[1]))
    for _ in range(_ROUNDS):
        weighted = matrix.multiply(weights[:, None]).tocsr()
        normal, right = (
            (weighted.T @ weighted).tocsc(),
            weighted.T @ (differences * weights[:, None]),
        )
        values = np.column_stack([spsolve(normal, column) for column in right.T])
        residual = np.linalg.norm(differences - matrix @ values, axis=1) / errors
        weights = 1.0 / errors / np.sqrt(1.0 + (residual / _OUTLIER) ** 2)
    return values
