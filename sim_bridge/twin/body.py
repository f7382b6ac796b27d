"""The drone's body: its size and motion, and the step in which it is controlled."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from sim_bridge.anafi import ANAFI_AIRFRAME
from uav_bt.types import Pose

HULL_HALF_M: Final = tuple(side / 2 for side in ANAFI_AIRFRAME.body_size_m)  # forward, aside, up
CONTROL_STEP_S: Final = 0.01
TIME_SLACK_S: Final = 1e-6  # rounding error of a sum of control steps


@dataclass(frozen=True, kw_only=True, slots=True)
class Motion(Pose):
    """Motion of the body's centre, true or estimated; world axes, yaw counter-clockwise."""

    vx_mps: float
    vy_mps: float
    vz_mps: float
    roll_rad: float  # about the forward axis, right-down positive
    pitch_rad: float  # nose-up positive
    yaw_rate_radps: float


def lag_gain(lag_s: float) -> float:
    """Return the share of an error that a first-order lag removes in one control step."""
    return 1.0 - math.exp(-CONTROL_STEP_S / lag_s)
