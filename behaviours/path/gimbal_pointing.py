"""Where the camera points: down to the ground near its edge, and at the helipad on the way."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from uav_bt.errors import ValueRangeError
from uav_bt.types import (
    MIN_VIEW_HEIGHT_M,
    PAD_HEIGHT_M,
    CameraModel,
    DroneState,
    HelipadFix,
    ObstaclePoints,
)
from uav_bt.types.projection import ground_points
from uav_bt.types.site_map import SiteMap

_SAMPLES: Final = 12, 9  # columns and rows of an image
_MIN_BEARINGS = 2  # degrees that must show something of unknown range; fewer are specks of the mask


@dataclass(frozen=True, kw_only=True)
class GroundPointingConfig:
    """When the camera looks down, so that the odometry sees ground to follow."""

    down_rad: float = math.radians(-56)  # steeper, views are not matched to the map
    far_heights: float = 2.0  # ground further away than so many heights is seen too flatly
    enough: float = 0.35  # of the image: with so much ground it stays as in flight,
    little: float = 0.15  # with so little it looks down as far as it may


def ground_share(
    site_map: SiteMap,
    camera: CameraModel,
    pitch_rad: float,
    height_m: float,
    config: GroundPointingConfig | None = None,
) -> float:
    """Return the share of an image that shows what may be ground: near, and not beyond its edge.

    Places beyond what the map holds are no ground; unknown cells of it may be.

    Args:
        site_map: with the drone where it is now.
        camera: intrinsics at any size.
        pitch_rad: of the gimbal, negative down.
        height_m: of the camera above the ground.
        config: how far ground counts.
    """
    config = config or GroundPointingConfig()
    across, down = (np.linspace(0.0, 1.0, count) for count in _SAMPLES)
    pixels = np.stack(
        np.meshgrid((camera.width_px - 1) * across, (camera.height_px - 1) * down), axis=-1
    ).reshape(-1, 2)
    height_m = max(height_m, MIN_VIEW_HEIGHT_M)
    shown_m = ground_points(pixels, camera, pitch_rad, height_m)
    near = np.hypot(*shown_m.T) <= config.far_heights * height_m
    lens_m = np.array([camera.forward_offset_m, 0.0])
    places_m = site_map.pose.points_to_world(shown_m + lens_m)
    return float(np.mean(near & site_map.lies_on(~site_map.outside, places_m)))


def ground_pitch_rad(
    site_map: SiteMap,
    camera: CameraModel,
    flight_rad: float,
    height_m: float,
    config: GroundPointingConfig | None = None,
) -> float:
    """Return the camera's pitch: as in flight, and lower where that would show little ground.

    Args:
        site_map: with the drone where it is now.
        camera: intrinsics at any size.
        flight_rad: the pitch in flight, negative down.
        height_m: of the camera above the ground.
        config: how far down, and when.
    """
    config = config or GroundPointingConfig()
    share = ground_share(site_map, camera, flight_rad, height_m, config)
    if share >= config.enough:
        return flight_rad
    lowest_rad = min(config.down_rad, flight_rad)
    if ground_share(site_map, camera, lowest_rad, height_m, config) < share:
        return flight_rad  # from beyond the edge the ground lies further away
    return float(np.interp(share, (config.little, config.enough), (lowest_rad, flight_rad)))


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
