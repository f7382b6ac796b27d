"""Camera pitch towards the landing mark, ground near an edge, movers, or unplaced obstacles."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np

from uav_bt.errors import ValueRangeError
from uav_bt.types import MIN_VIEW_HEIGHT_M, CameraModel, NearObstacles
from uav_bt.types.arrays import Floats
from uav_bt.types.projection import ground_points
from uav_bt.types.site_map import SiteMap

_SAMPLES: Final = 12, 9  # columns and rows of an image
_MIN_BEARINGS: Final = 2  # 1-degree bearings of one obstacle; fewer are specks of the mask
_MIN_RANGE_M: Final = 0.05  # m; chosen: smaller ranges count as this, to avoid a division by zero


@dataclass(frozen=True, kw_only=True)
class GimbalConfig:
    """How far down the camera looks, and when.

    Attributes:
        ground_rad: Pitch near an edge of the ground. Steeper views are not matched to the map.
        far_heights: Ground further away than this multiple of the height is seen too flatly.
        enough: From this share of ground in the image the camera keeps the flight pitch.
        little: Up to this share the camera looks down to `ground_rad`.
        mark_rad: Lowest pitch at which the camera follows the mark. Steeper, roofs look like bases.
        near_ahead_rad: Half angle ahead in which the camera looks at obstacles of unknown range.
        look_down_s: Time of a look, long enough for the map to place the obstacle.
        base_rad: Largest angle of the base of a mover below the middle of the image. The half view
            of an ANAFI is 20 degrees.
    """

    ground_rad: float = math.radians(-56)
    far_heights: float = 2.0
    enough: float = 0.35
    little: float = 0.15
    mark_rad: float = math.radians(-50)
    near_ahead_rad: float = math.radians(45)
    look_down_s: float = 1.0
    base_rad: float = math.radians(10)

    def __post_init__(self) -> None:
        if not (-math.pi / 2 <= self.mark_rad < 0.0 < self.near_ahead_rad):
            raise ValueRangeError(f"the camera must look down, and ahead must be wide, got {self}")


def ground_share(
    site_map: SiteMap,
    camera: CameraModel,
    pitch_rad: float,
    height_m: float,
    config: GimbalConfig | None = None,
) -> float:
    """Return the share of an image that may show near ground within the edges of the map.

    Unknown cells of the map may be ground; places beyond the map are not.

    Args:
        site_map: The newest map, with the drone's present pose.
        camera: Intrinsics at any size.
        pitch_rad: Pitch of the gimbal, negative down.
        height_m: Height of the camera above the ground.
        config: Source of the distance up to which ground counts.
    """
    config = config or GimbalConfig()
    pixels = _samples(camera.width_px, camera.height_px)
    height_m = max(height_m, MIN_VIEW_HEIGHT_M)
    shown_m = ground_points(pixels, camera, pitch_rad, height_m)
    near = np.hypot(*shown_m.T) <= config.far_heights * height_m
    lens_m = np.array([camera.forward_offset_m, 0.0])
    places_m = site_map.pose.points_to_world(shown_m + lens_m)
    return float(np.mean(near & site_map.lies_on(~site_map.outside, places_m)))


@cache
def _samples(width_px: int, height_px: int) -> Floats:
    """Return pixels spread over an image, (N, 2) as (column, row)."""
    columns, rows = _SAMPLES
    across, down = np.linspace(0.0, width_px - 1, columns), np.linspace(0.0, height_px - 1, rows)
    return np.stack(np.meshgrid(across, down), axis=-1).reshape(-1, 2)


def ground_pitch_rad(
    site_map: SiteMap,
    camera: CameraModel,
    flight_rad: float,
    height_m: float,
    config: GimbalConfig | None = None,
) -> float:
    """Return the camera's pitch: the flight pitch, or lower if that would show little ground.

    Args:
        site_map: The newest map, with the drone's present pose.
        camera: Intrinsics at any size.
        flight_rad: Pitch in flight, negative down.
        height_m: Height of the camera above the ground.
        config: How far down the camera looks, and when.
    """
    config = config or GimbalConfig()
    share = ground_share(site_map, camera, flight_rad, height_m, config)
    if share >= config.enough:
        return flight_rad
    lowest_rad = min(config.ground_rad, flight_rad)
    if ground_share(site_map, camera, lowest_rad, height_m, config) < share:
        return flight_rad  # beyond the edge of the ground a lower pitch shows less of it
    return float(np.interp(share, (config.little, config.enough), (lowest_rad, flight_rad)))


def mover_pitch_rad(
    site_map: SiteMap, flight_rad: float, height_m: float, config: GimbalConfig | None = None
) -> float:
    """Return the camera's pitch that shows the base of the nearest mover, or the flight pitch.

    Args:
        site_map: The newest map, with movers.
        flight_rad: Pitch in flight, negative down; the camera does not look further up.
        height_m: Height of the camera above the ground.
        config: How far down the camera looks.
    """
    config, pose = config or GimbalConfig(), site_map.pose
    range_m = min(
        math.dist((mover.x_m, mover.y_m), (pose.x_m, pose.y_m)) - mover.radius_m
        for mover in site_map.movers
    )
    base_rad = -math.atan2(height_m, max(range_m, _MIN_RANGE_M))
    return min(flight_rad, max(base_rad + config.base_rad, config.ground_rad))


def mark_pitch_rad(
    range_m: float, above_m: float, flight_rad: float, config: GimbalConfig | None = None
) -> float:
    """Return the camera's pitch that follows the landing mark down.

    Args:
        range_m: Horizontal distance of the mark.
        above_m: Height of the drone above the top of the mark.
        flight_rad: Pitch in flight, negative down; the camera does not look further up.
        config: How far down the camera looks.
    """
    mark_rad = -math.atan2(max(above_m, 0.0), max(range_m, _MIN_RANGE_M))
    return min(flight_rad, max(mark_rad, (config or GimbalConfig()).mark_rad))


def shows_unplaced(obstacles: NearObstacles | None, half_angle_rad: float) -> bool:
    """Return whether an obstacle of unknown range is ahead.

    Args:
        obstacles: Points around the drone; None while unknown.
        half_angle_rad: Half angle of the sector around the heading.
    """
    return obstacles is not None and obstacles.unplaced_within(half_angle_rad) >= _MIN_BEARINGS


class LookingDown:
    """Looks down for a time at obstacles of unknown range and at edges ahead.

    Args:
        config: When the camera looks down, and for how long.
    """

    def __init__(self, config: GimbalConfig | None = None) -> None:
        self._config = config or GimbalConfig()
        self._until_s = -math.inf

    def pitch_rad(self, obstacles: NearObstacles | None, now_s: float) -> float | None:
        """Return the camera's pitch; None without a reason to look down.

        Args:
            obstacles: Points around the drone; None while unknown.
            now_s: Time of the mission clock.
        """
        cfg = self._config
        if obstacles is not None and (
            shows_unplaced(obstacles, cfg.near_ahead_rad)
            or obstacles.ends_within(cfg.near_ahead_rad) >= _MIN_BEARINGS
        ):
            self._until_s = now_s + cfg.look_down_s
        return cfg.mark_rad if now_s < self._until_s else None
