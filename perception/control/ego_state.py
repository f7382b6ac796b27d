"""The control student's shape, inputs and outputs, shared by flight and training.

Besides the images, the inputs are the ego state and the motion between the views, from
dead-reckoned poses. This module does not import torch.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import ValueRangeError
from uav_bt.types.dead_reckoning import OdometryPose

VERSION: Final = 2  # of layer names, inputs and outputs; files of another version are refused
# `advance` (or turn), `clockwise` (if it turns), `ground_ends` as logits; others in m.
OUTPUTS: Final = ("advance", "clockwise", "step_m", "ground_ends", "free_m")


@dataclass(frozen=True, kw_only=True)
class ControlNetConfig:
    """The network's shape."""

    width_px: int = 160  # at 3 m this resolves the base of a box to 5 cm
    height_px: int = 80
    channels: tuple[int, ...] = (24, 48, 96, 160)  # by level: the segmentation U-Net's encoder
    bottleneck: int = 24  # channels per cell of the last level into the dense layers
    embedding: int = 192  # values per view
    hidden: int = 128  # values of the layers that join the views
    views: int = 3  # number of views: the present one and earlier ones
    spacing_s: float = 0.5  # between views; the paper has three within a second

    def __post_init__(self) -> None:
        if self.views < 1 or not self.spacing_s > 0.0:
            raise ValueRangeError(
                f"views and their spacing must be positive, got {self.views}, {self.spacing_s} s"
            )

    @property
    def ages_s(self) -> tuple[float, ...]:
        """Ages of the views, s, the present one first."""
        return tuple(self.spacing_s * number for number in range(self.views))

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> ControlNetConfig:
        """Return the shape from the JSON of its fields; KeyError if one is missing."""
        known = {item.name: values[item.name] for item in fields(cls)}
        return cls(**{**known, "channels": tuple(known["channels"])})


# Zero points of the vector: the mission's usual height and camera pitch.
_HEIGHT_M: Final = 1.5
_PITCH_RAD: Final = math.radians(-30.0)
_MAX_FULL_TURNS: Final = 3  # as `max_full_turns` of the rules

_EGO: Final = 4  # height, pitch, turn under way, full turns
_MOVED: Final = 5  # age, forward, right, sine and 1 - cosine of the turn
_SIDED: Final = (False, False, True, False)  # values that change sign in a mirrored world
_SIDED_MOVED: Final = (False, False, True, True, False)


def state_size(views: int) -> int:
    """Return the length of the state vector for a number of views."""
    return _EGO + _MOVED * (views - 1)


def state_vector(
    poses: Sequence[OdometryPose],
    *,
    height_above_ground_m: float,
    gimbal_pitch_rad: float,
    turning: int,
    full_turns: int,
) -> NDArray[np.float32]:
    """Return the state vector of a decision, (4 + 5 (V - 1),), from the pose of each view.

    The first four are height and pitch relative to their usual values, the turn under way (+1
    clockwise, -1 counter-clockwise), and full turns without a free path. Each earlier view adds its
    age in seconds, the body's former position (forward and right of the present body, metres), and
    sine and 1 - cosine of its heading relative to the present one.
    """
    now = poses[0]
    values = [
        height_above_ground_m - _HEIGHT_M,
        gimbal_pitch_rad - _PITCH_RAD,
        float(turning),
        min(full_turns, _MAX_FULL_TURNS) / _MAX_FULL_TURNS,
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
