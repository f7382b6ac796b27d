"""What the control student gets beside the images: the ego state, and the movement between views.

Flight and training build this vector here, from the same kind of dead-reckoned poses.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.types.dead_reckoning import OdometryPose

# Where the vector is zero: the mission's usual height and camera pitch.
_HEIGHT_M: Final = 1.5
_PITCH_RAD: Final = math.radians(-30.0)
_MAX_FULL_TURNS: Final = 3  # as many as the rules relieve

_EGO: Final = 4  # height, pitch, turn under way, full turns
_MOVED: Final = 5  # age, forward, right, sine and 1 - cosine of the turn
_SIDED: Final = (False, False, True, False)  # a mirror changes the sign of these
_SIDED_MOVED: Final = (False, False, True, True, False)


@dataclass(frozen=True, kw_only=True)
class EgoState:
    """The state of the drone when it decides."""

    height_above_carpet_m: float
    gimbal_pitch_rad: float
    turning: int = 0  # a turn under way: +1 clockwise, -1 counter-clockwise, 0 none
    full_turns: int = 0  # in a row that found no free path


def state_size(views: int) -> int:
    """Return the length of the state vector for so many views."""
    return _EGO + _MOVED * (views - 1)


def state_vector(ego: EgoState, poses: Sequence[OdometryPose]) -> NDArray[np.float32]:
    """Return the state vector of a moment.

    Args:
        ego: the drone's state.
        poses: where each view was captured, the present one first.

    Returns:
        (4 + 5 (V - 1),) float32: height and pitch from their usual values, the turn under way, full
        turns; then of each earlier view its age in seconds, where the body was then (forward and
        right from the body now, metres), sine and 1 - cosine of its heading from the heading now.
    """
    now = poses[0]
    values = [
        ego.height_above_carpet_m - _HEIGHT_M,
        ego.gimbal_pitch_rad - _PITCH_RAD,
        float(ego.turning),
        min(ego.full_turns, _MAX_FULL_TURNS) / _MAX_FULL_TURNS,
    ]
    for then in poses[1:]:
        turned_rad = then.yaw_rad - now.yaw_rad
        values += [
            now.time_s - then.time_s,
            *now.to_body(then.x_m, then.y_m),
            math.sin(turned_rad),
            1.0 - math.cos(turned_rad),
        ]
    return np.array(values, dtype=np.float32)


def mirrored(state: NDArray[np.float32]) -> NDArray[np.float32]:
    """Return state vectors, (..., 4 + 5 (V - 1)), with left and right exchanged."""
    earlier = (state.shape[-1] - _EGO) // _MOVED
    sided = np.array([*_SIDED, *(_SIDED_MOVED * earlier)])
    return np.where(sided, -state, state)
