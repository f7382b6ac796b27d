"""Which heading leads to the helipad round what is remembered, from one tick to the next."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from behaviours.path.planner import PathConfig, first_segment
from uav_bt.types import DroneState, HelipadFix, ObstaclePoints


@dataclass(frozen=True, kw_only=True)
class PathToPadConfig:
    """When a path is planned at all, and how often."""

    straight_margin_m: float = 0.52  # flown straight where it is this wide, half, from the centre
    before_pad_m: float = 0.35  # what stands this much before the pad's centre is not on the path
    replan_s: float = 0.2  # a path is planned afresh this often,
    turned_rad: float = math.radians(12)  # but not before the drone has turned to it,
    replan_turning_s: float = 1.5  # or so long has passed
    path: PathConfig = field(default_factory=PathConfig)


class PathToPad:
    """Plans the path, and keeps to it while it is as good as another.

    Args:
        config: when and how it is planned.
    """

    def __init__(self, config: PathToPadConfig | None = None) -> None:
        self._config = config or PathToPadConfig()
        self.drop()

    def drop(self) -> None:
        """Forget the path being flown."""
        self._yaw_rad: float | None = None
        self._planned_s = -math.inf

    def bearing(
        self, obstacles: ObstaclePoints, fix: HelipadFix, state: DroneState, now_s: float
    ) -> float | None:
        """Return the bearing to fly on, None without a path.

        Args:
            obstacles: what is remembered.
            fix: where the pad lies.
            state: of the drone.
            now_s: the mission clock's time.

        Returns:
            Radians from the heading, clockwise positive.
        """
        cfg = self._config
        share = max(fix.range_m - cfg.before_pad_m, 0.0) / max(fix.range_m, cfg.before_pad_m)
        straight = (share * fix.forward_m, share * fix.right_m)
        if obstacles.allows(*straight, margin_m=cfg.straight_margin_m):
            self.drop()
            return fix.bearing_rad
        yaw_rad, present_rad = state.attitude.yaw_rad, None
        if self._yaw_rad is not None:
            present_rad = math.remainder(self._yaw_rad - yaw_rad, 2.0 * math.pi)
            turned = abs(present_rad) < cfg.turned_rad
            if now_s - self._planned_s < (cfg.replan_s if turned else cfg.replan_turning_s):
                return present_rad
        bearing_rad = first_segment(
            obstacles,
            (fix.forward_m, fix.right_m),
            cfg.path,
            yaw_rad=yaw_rad,
            present_rad=present_rad,
        )
        self._planned_s = now_s
        self._yaw_rad = None if bearing_rad is None else yaw_rad + bearing_rad
        return bearing_rad
