"""Where the camera points on the way to the helipad."""

from __future__ import annotations

import math
from dataclasses import dataclass

from uav_bt.errors import ValueRangeError
from uav_bt.types import PAD_HEIGHT_M, DroneState, HelipadFix, ObstaclePoints

_MIN_BEARINGS = 2  # degrees that must show something of unknown range; fewer are specks of the mask


@dataclass(frozen=True, kw_only=True)
class GimbalPointingConfig:
    """How far down the camera looks, and when."""

    min_pitch_rad: float = math.radians(-50)  # steeper, roofs cannot be distinguished from bases
    near_ahead_rad: float = math.radians(45)  # what is unplaced this near to ahead is looked at
    look_down_s: float = 1.0  # so long, enough for the memory to place it

    def __post_init__(self) -> None:
        if not (-math.pi / 2 <= self.min_pitch_rad < 0.0 < self.near_ahead_rad):
            raise ValueRangeError(f"the camera must look down, and ahead must be wide, got {self}")


def shows_unplaced(obstacles: ObstaclePoints | None, half_angle_rad: float) -> bool:
    """Return whether something of unknown range stands this near to ahead.

    Args:
        obstacles: what is remembered.
        half_angle_rad: of the sector around the heading.
    """
    return obstacles is not None and obstacles.unplaced_within(half_angle_rad) >= _MIN_BEARINGS


class GimbalPointing:
    """Follows the pad down, so that the carpet before it is in view, and looks at what is near.

    Args:
        config: how far down, and when.
    """

    def __init__(self, config: GimbalPointingConfig | None = None) -> None:
        self._config = config or GimbalPointingConfig()
        self._look_down_until_s = -math.inf

    def pitch_rad(
        self,
        fix: HelipadFix,
        obstacles: ObstaclePoints | None,
        state: DroneState,
        *,
        flight_rad: float,
        now_s: float,
    ) -> float:
        """Return the camera's pitch, between the one in flight and the lowest, negative down.

        Args:
            fix: where the pad lies.
            obstacles: what is remembered.
            state: of the drone.
            flight_rad: the camera's pitch in flight.
            now_s: the mission clock's time.
        """
        cfg = self._config
        if shows_unplaced(obstacles, cfg.near_ahead_rad) or self._ends_unseen(obstacles):
            self._look_down_until_s = now_s + cfg.look_down_s
        if now_s < self._look_down_until_s:
            return cfg.min_pitch_rad
        above_m = max(state.height_above_carpet_m - PAD_HEIGHT_M, 0.0)
        pad_rad = -math.atan2(above_m, max(fix.range_m, 0.05))
        return min(flight_rad, max(pad_rad, cfg.min_pitch_rad))

    def _ends_unseen(self, obstacles: ObstaclePoints | None) -> bool:
        """Return whether the carpet ends ahead, nearer than anything in view."""
        if obstacles is None:
            return False
        return obstacles.ends_within(self._config.near_ahead_rad) >= _MIN_BEARINGS
