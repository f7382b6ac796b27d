"""Where the twin's camera is, and where it looks."""

from __future__ import annotations

import math
from dataclasses import dataclass

from uav_bt.types import Pose


@dataclass(frozen=True, kw_only=True, slots=True)
class CameraPose(Pose):
    """Where the lens is and where it looks; the gimbal keeps the horizon level."""

    pitch_rad: float  # 0 level, negative down

    def axes(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Return the optical axis and the image's upward direction in the world."""
        cy, sy = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        cp, sp = math.cos(self.pitch_rad), math.sin(self.pitch_rad)
        return (cp * cy, cp * sy, sp), (-sp * cy, -sp * sy, cp)
