"""The camera's pitch: at the landing mark, at ground near an edge, at unplaced obstacles."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from uav_bt.errors import ValueRangeError
from uav_bt.types import MIN_VIEW_HEIGHT_M, CameraModel, NearObstacles
from uav_bt.types.projection import ground_points
from uav_bt.types.site_map import SiteMap

_SAMPLES: Final = 12, 9  # columns and rows of an image
_MIN_BEARINGS: Final = 2  # degrees that show a thing of unknown range; fewer are specks of the mask
_MIN_RANGE_M: Final = 0.05  # m; chosen: a shorter range counts as this in a division


@dataclass(frozen=True, kw_only=True)
class GimbalConfig:
    """How far down the camera looks, and when.

    Attributes:
        ground_rad: Pitch near an edge of the ground. Steeper views are not matched to the map.
        far_heights: Ground further away than this many heights is seen too flatly.
        enough: With this share of ground in the image the camera stays as in flight.
        little: With this share it looks down to `ground_rad`.
        mark_rad: The camera follows the mark down to this pitch. Steeper, roofs look like
            bases.
        near_ahead_rad: A thing of unknown range this near to ahead is looked at.
        look_down_s: It is looked at for this long, enough for the memory to place it.
    """

    ground_rad: float = math.radians(-56)
    far_heights: float = 2.0
    enough: float = 0.35
    little: float = 0.15
    mark_rad: float = math.radians(-50)
    near_ahead_rad: float = math.radians(45)
    look_down_s: float = 1.0

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
    """Return the share of an image that may show ground: near, and not beyond its edge.

    Unknown cells of the map may be ground; places beyond the map are not.

    Args:
        site_map: The newest map, with the drone's pose of now.
        camera: Intrinsics at any size.
        pitch_rad: Pitch of the gimbal, negative down.
        height_m: Height of the camera above the ground.
        config: The distance to which ground counts.
    """
    config = config or GimbalConfig()
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
    config: GimbalConfig | None = None,
) -> float:
    """Return the camera's pitch: as in flight, and lower if that showed little ground.

    Args:
        site_map: The newest map, with the drone's pose of now.
        camera: Intrinsics at any size.
        flight_rad: The pitch in flight, negative down.
        height_m: Height of the camera above the ground.
        config: How far down it looks, and when.
    """
    config = config or GimbalConfig()
    share = ground_share(site_map, camera, flight_rad, height_m, config)
    if share >= config.enough:
        return flight_rad
    lowest_rad = min(config.ground_rad, flight_rad)
    if ground_share(site_map, camera, lowest_rad, height_m, config) < share:
        return flight_rad  # from beyond the edge the ground lies further away
    return float(np.interp(share, (config.little, config.enough), (lowest_rad, flight_rad)))


def mark_pitch_rad(
    range_m: float, above_m: float, flight_rad: float, config: GimbalConfig | None = None
) -> float:
    """Return the camera's pitch that follows the landing mark down.

    Args:
        range_m: Horizontal distance of the mark.
        above_m: Height of the drone above the top of the mark.
        flight_rad: Pitch in flight, negative down; the camera does not look further up.
        config: How far down it looks.
    """
    mark_rad = -math.atan2(max(above_m, 0.0), max(range_m, _MIN_RANGE_M))
    return min(flight_rad, max(mark_rad, (config or GimbalConfig()).mark_rad))


def shows_unplaced(obstacles: NearObstacles | None, half_angle_rad: float) -> bool:
    """Return whether an obstacle of unknown range stands ahead.

    Args:
        obstacles: Points around the drone; None while they are not known.
        half_angle_rad: Of the sector around the heading.
    """
    return obstacles is not None and obstacles.unplaced_within(half_angle_rad) >= _MIN_BEARINGS


class LookingDown:
    """Looks down for a while at obstacles and edges ahead that are nearer than the view.

    Args:
        config: When, and for how long.
    """

    def __init__(self, config: GimbalConfig | None = None) -> None:
        self._config = config or GimbalConfig()
        self._until_s = -math.inf

    def pitch_rad(self, obstacles: NearObstacles | None, now_s: float) -> float | None:
        """Return the camera's pitch; None where nothing asks for a look.

        Args:
            obstacles: Points around the drone; None while they are not known.
            now_s: Time of the mission clock.
        """
        cfg = self._config
        if obstacles is not None and (
            shows_unplaced(obstacles, cfg.near_ahead_rad)
            or obstacles.ends_within(cfg.near_ahead_rad) >= _MIN_BEARINGS
        ):
            self._until_s = now_s + cfg.look_down_s
        return cfg.mark_rad if now_s < self._until_s else None
