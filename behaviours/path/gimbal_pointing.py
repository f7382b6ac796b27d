"""Where the camera looks on the way to the helipad."""

from __future__ import annotations

import math

from uav_bt.types import PAD_HEIGHT_M, DroneState, HelipadFix, ObstaclePoints

__all__ = ["PadGaze", "shows_unplaced"]

# The lowest pitch at which bases are still told from roofs.
_LOWEST_RAD = math.radians(-50)
# What has an unknown range this near to ahead is looked at from above, for so long.
_NEAR_AHEAD_RAD = math.radians(45)
_LOOK_DOWN_S = 1.0
# Degrees that must show an obstacle of unknown range; fewer are specks of the mask.
_UNPLACED_MIN = 2


def shows_unplaced(obstacles: ObstaclePoints | None, half_angle_rad: float) -> bool:
    """Return whether something of unknown range stands this near to ahead."""
    return obstacles is not None and obstacles.unplaced_within(half_angle_rad) >= _UNPLACED_MIN


class PadGaze:
    """Follows the pad down, so that the carpet before it is in view, and looks at what is near."""

    def __init__(self) -> None:
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
        """Return the camera's pitch, between the one in flight and the lowest."""
        if shows_unplaced(obstacles, _NEAR_AHEAD_RAD) or _ends_unseen(obstacles):
            self._look_down_until_s = now_s + _LOOK_DOWN_S
        if now_s < self._look_down_until_s:
            return _LOWEST_RAD
        above_m = max(state.height_above_carpet_m - PAD_HEIGHT_M, 0.0)
        pad_rad = -math.atan2(above_m, max(fix.range_m, 0.05))
        return min(flight_rad, max(pad_rad, _LOWEST_RAD))


def _ends_unseen(obstacles: ObstaclePoints | None) -> bool:
    """Return whether the carpet ends ahead, nearer than anything in view."""
    return obstacles is not None and obstacles.ends_within(_NEAR_AHEAD_RAD) >= _UNPLACED_MIN
