"""What the control student is told beside the pixels: how it stands, and how it moved meanwhile.

Flight and training build these numbers here, from the same kind of dead-reckoned poses.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.types.dead_reckoning import OdometryPose

__all__ = ["Standing", "mirrored", "situation", "situation_size"]

# Where the numbers are nought: the mission's usual height and camera pitch.
_HEIGHT_M: Final = 1.5
_PITCH_RAD: Final = math.radians(-30.0)
_MOST_FULL_TURNS: Final = 3  # as many as the rules relieve

_STANDING: Final = 4  # height, pitch, turn under way, full turns
_MOVED: Final = 5  # age, forward, right, sine and cosine of the turn
_SIDED: Final = (False, False, True, False)  # a mirror turns these over
_SIDED_MOVED: Final = (False, False, True, True, False)


@dataclass(frozen=True, kw_only=True)
class Standing:
    """How the drone stands when it decides."""

    height_above_carpet_m: float
    gimbal_pitch_rad: float
    turning: int = 0  # a turn under way: +1 clockwise, -1 counter-clockwise, 0 none
    full_turns: int = 0  # in a row that found no free way


def situation_size(views: int) -> int:
    """Return how many numbers there are for so many views."""
    return _STANDING + _MOVED * (views - 1)


def situation(standing: Standing, poses: Sequence[OdometryPose]) -> NDArray[np.float32]:
    """Return the numbers of a moment.

    Args:
        standing: how the drone stands.
        poses: where each view was captured, the present one first.

    Returns:
        (4 + 5 (V - 1),) float32: height and pitch from their usual values, the turn under way, full
        turns; then of each earlier view its age in seconds, where the body was then (forward and
        right from the body now, metres), sine and 1 - cosine of its heading from the heading now.
    """
    now = poses[0]
    numbers = [
        standing.height_above_carpet_m - _HEIGHT_M,
        standing.gimbal_pitch_rad - _PITCH_RAD,
        float(standing.turning),
        min(standing.full_turns, _MOST_FULL_TURNS) / _MOST_FULL_TURNS,
    ]
    for then in poses[1:]:
        turned_rad = then.yaw_rad - now.yaw_rad
        numbers += [
            now.time_s - then.time_s,
            *now.to_body(then.x_m, then.y_m),
            math.sin(turned_rad),
            1.0 - math.cos(turned_rad),
        ]
    return np.array(numbers, dtype=np.float32)


def mirrored(numbers: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return what the numbers, (..., 4 + 5 (V - 1)), are with left and right exchanged."""
    earlier = (numbers.shape[-1] - _STANDING) // _MOVED
    sided = np.array([*_SIDED, *(_SIDED_MOVED * earlier)])
    return np.where(sided, -numbers, numbers)
