"""Camera pitch towards the landing mark, ground near an edge, or movers."""

from __future__ import annotations

import math
from functools import cache
from typing import Final

import numpy as np

from uav_bt.types import MIN_VIEW_HEIGHT_M, CameraModel
from uav_bt.types.arrays import Floats
from uav_bt.types.projection import ground_points
from uav_bt.types.site_map import SiteMap

LITTLE_GROUND: Final = 0.15
"""Share of ground in the image up to which the camera looks down to `_GROUND_RAD`."""

ENOUGH_GROUND: Final = 0.35
"""Share from which it keeps the flight pitch."""

_GROUND_RAD: Final = math.radians(-56)  # near an edge; steeper views are not matched to the map
_FAR_HEIGHTS: Final = 2.0  # ground further away than this times the height is seen too flatly
_MARK_RAD: Final = math.radians(-50)  # lowest, following the mark; steeper, roofs look like bases
_BASE_RAD: Final = math.radians(
    10
)  # largest angle of a mover's base below the middle of the image;
# the half view of an ANAFI is 20 degrees
_SAMPLES: Final = 12, 9  # columns and rows of an image
_MIN_RANGE_M: Final = 0.05  # m; chosen: smaller ranges count as this, to avoid a division by zero


def ground_share(
    site_map: SiteMap, camera: CameraModel, pitch_rad: float, height_m: float
) -> float:
    """Return the share of an image that may show near ground within the edges of the map.

    Unknown cells of the map may be ground; places beyond the map are not. The camera has a pitch,
    negative down, and a height above the ground.
    """
    pixels = _samples(camera.width_px, camera.height_px)
    height_m = max(height_m, MIN_VIEW_HEIGHT_M)
    shown_m = ground_points(pixels, camera, pitch_rad, height_m)
    near = np.hypot(*shown_m.T) <= _FAR_HEIGHTS * height_m
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
    site_map: SiteMap, camera: CameraModel, flight_rad: float, height_m: float
) -> float:
    """Return the camera's pitch: the flight pitch, or lower if that would show little ground."""
    share = ground_share(site_map, camera, flight_rad, height_m)
    if share >= ENOUGH_GROUND:
        return flight_rad
    lowest_rad = min(_GROUND_RAD, flight_rad)
    if ground_share(site_map, camera, lowest_rad, height_m) < share:
        return flight_rad  # beyond the edge of the ground a lower pitch shows less of it
    return float(np.interp(share, (LITTLE_GROUND, ENOUGH_GROUND), (lowest_rad, flight_rad)))


def mover_pitch_rad(site_map: SiteMap, flight_rad: float, height_m: float) -> float:
    """Return the camera's pitch that shows the base of the nearest mover, or the flight pitch."""
    pose = site_map.pose
    range_m = min(
        math.dist((mover.x_m, mover.y_m), (pose.x_m, pose.y_m)) - mover.radius_m
        for mover in site_map.movers
    )
    base_rad = -math.atan2(height_m, max(range_m, _MIN_RANGE_M))
    return min(flight_rad, max(base_rad + _BASE_RAD, _GROUND_RAD))


def mark_pitch_rad(range_m: float, above_m: float, flight_rad: float) -> float:
    """Return the camera's pitch that follows the landing mark down, at most the flight pitch.

    `range_m` is the horizontal distance of the mark, `above_m` the height above its top.
    """
    mark_rad = -math.atan2(max(above_m, 0.0), max(range_m, _MIN_RANGE_M))
    return min(flight_rad, max(mark_rad, _MARK_RAD))
