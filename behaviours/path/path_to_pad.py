"""Which heading leads to the helipad round what is remembered, from one tick to the next."""

from __future__ import annotations

import math

from behaviours.path.planner import WayConfig, first_leg
from uav_bt.types import DroneState, HelipadFix, ObstaclePoints

__all__ = ["WayToPad"]

# Flown straight to the pad where it is this wide, half, from the body's centre.
_WIDE_M = 0.52
# What stands this much before the pad's centre, or behind it, is not in the way to it.
_BEFORE_PAD_M = 0.35
# A way is planned afresh this often, and not before the drone has turned to it.
_REPLAN_S = 0.2
_TURNED_RAD = math.radians(12)
_REPLAN_TURNING_S = 1.5


class WayToPad:
    """Plans the way, and keeps to it while it is as good as another."""

    def __init__(self, config: WayConfig | None = None) -> None:
        self._config = config or WayConfig()
        self.drop()

    def drop(self) -> None:
        """Forget the way being flown."""
        self._yaw_rad: float | None = None
        self._planned_s = -math.inf

    def bearing(
        self, obstacles: ObstaclePoints, fix: HelipadFix, state: DroneState, now_s: float
    ) -> float | None:
        """Return the bearing to fly on, None without a way.

        Args:
            obstacles: what is remembered.
            fix: where the pad lies.
            state: of the drone.
            now_s: the mission clock's time.

        Returns:
            Radians from the heading, clockwise positive.
        """
        share = max(fix.range_m - _BEFORE_PAD_M, 0.0) / max(fix.range_m, _BEFORE_PAD_M)
        if obstacles.allows(share * fix.forward_m, share * fix.right_m, margin_m=_WIDE_M):
            self.drop()
            return fix.bearing_rad
        yaw_rad, lately_rad = state.attitude.yaw_rad, None
        if self._yaw_rad is not None:
            lately_rad = math.remainder(self._yaw_rad - yaw_rad, 2.0 * math.pi)
            wait_s = _REPLAN_S if abs(lately_rad) < _TURNED_RAD else _REPLAN_TURNING_S
            if now_s - self._planned_s < wait_s:
                return lately_rad
        bearing_rad = first_leg(
            obstacles,
            (fix.forward_m, fix.right_m),
            self._config,
            yaw_rad=yaw_rad,
            lately_rad=lately_rad,
        )
        self._planned_s = now_s
        self._yaw_rad = None if bearing_rad is None else yaw_rad + bearing_rad
        return bearing_rad
