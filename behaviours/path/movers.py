"""Predicted places of movers, and the gap between them and a course.

The numbers were chosen in flights among movers in the twin.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from uav_bt.types.arrays import Flags, Floats
from uav_bt.types.site_map import MapMover, SiteMap

SPARE_M: Final = 0.2  # least gap between body and mover
# Height above the flight height that the drone climbs to. People and carts may pass below; the
# limit of the ceiling holds. It keeps this height for a while after the last seen movement, because
# a mover that is out of view may come back from any side.
ABOVE_M: Final = 0.5
RAISED_S: Final = 60.0

_STEP_S: Final = 0.2  # between two predicted places
TIMES_S: Final = np.arange(0.0, 3.0 + _STEP_S / 2, _STEP_S)  # of a prediction
_TAKEN_S: Final = 1.0  # routes avoid the places that a mover reaches within this time
# After this time the uncertainty of the velocity no longer grows the place's: movers turn and stop.
_DOUBTED_S: Final = 1.5
# Largest uncertainty of a place that counts. A mover that is out of view may be anywhere after a
# few seconds, and no way leads away from all of these places.
_DOUBTED_M: Final = 1.0
_RIM: Final = 12  # points on the circle of a mover
_AROUND_M: Final = 0.15  # around a mover's circle: error of its points
_YIELDS_BY: Final = 0.5  # ratio of each speed tried to the one before
_MIN_MPS: Final = 0.12  # the drone waits instead of flying more slowly than this
_STOP_S: Final = 1.0  # the drone is predicted to fly on for this time and then stand still


def raised_m(site_map: SiteMap | None) -> float:
    """Return the height above the flight height that the drone keeps on a map, metres."""
    moved = site_map is not None and site_map.captured_s - site_map.moved_s <= RAISED_S
    return ABOVE_M if moved else 0.0


def outlines_m(movers: Sequence[MapMover]) -> Floats:
    """Return points that movers occupy within a second, (N, 2) metres in the map's frame."""
    times_s = np.arange(0.0, _TAKEN_S + _STEP_S / 2, _STEP_S)
    angles = np.linspace(0.0, 2.0 * math.pi, _RIM, endpoint=False)
    rim = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    points = [
        mover.at(times_s)[:, None] + share * mover.radius_m * rim
        for mover in movers
        for share in (0.5, 1.0)
    ]
    return np.array(points).reshape(-1, 2)


def gap_m(movers: Sequence[MapMover], places_m: Floats, body_m: float) -> Floats:
    """Return the least gap from body to movers over a prediction, (...) metres; inf without any.

    Their uncertainty is deducted. `places_m`, (..., T, 2) on the map, are the drone's at `TIMES_S`.
    """
    min_left_m = np.full(places_m.shape[:-2], math.inf)
    for mover in movers:
        doubt_m = np.hypot(mover.std_m, mover.std_mps * np.minimum(TIMES_S, _DOUBTED_S))
        doubt_m = np.minimum(doubt_m, _DOUBTED_M)
        apart_m = np.linalg.norm(places_m - mover.at(TIMES_S), axis=-1)
        left_m = apart_m - mover.radius_m - doubt_m - body_m
        min_left_m = np.minimum(min_left_m, left_m.min(axis=-1))
    return min_left_m


def yielding_mps(
    movers: Sequence[MapMover], path_m: Floats, speed_mps: float, body_m: float = 0.2
) -> float:
    """Return the highest speed, up to `speed_mps`, that keeps the gap to movers; 0 to wait.

    The path, (N, 2) in the map's frame, begins at the drone. `body_m` is half of the diagonal.
    """
    if not movers or speed_mps <= 0.0:
        return speed_mps
    along_m = np.concatenate([[0.0], np.hypot(*np.diff(path_m, axis=0).T).cumsum()])
    tried_mps = speed_mps
    while tried_mps >= _MIN_MPS:
        flown_m = tried_mps * TIMES_S
        places_m = np.stack([np.interp(flown_m, along_m, axis) for axis in path_m.T], axis=-1)
        if float(gap_m(movers, places_m, body_m)) >= SPARE_M:
            return tried_mps
        tried_mps *= _YIELDS_BY
    return 0.0


def runs_into(site_map: SiteMap, velocity_mps: Floats, body_m: float) -> bool:
    """Return whether a drone that flies on for a moment comes too near to a mover.

    Its velocity, (2,), is over the ground in the map's frame.
    """
    flown_s = np.minimum(TIMES_S, _STOP_S)[:, None]
    places_m = np.array([site_map.pose.x_m, site_map.pose.y_m]) + flown_s * velocity_mps
    return bool(gap_m(site_map.movers, places_m, body_m) < SPARE_M)


def is_of_movers(movers: Sequence[MapMover], points_m: Floats) -> Flags:
    """Return which points, (N, 2) in the map's frame, belong to movers."""
    found = np.zeros(len(points_m), dtype=bool)
    for mover in movers:
        apart_m = np.hypot(*(points_m - (mover.x_m, mover.y_m)).T)
        found |= apart_m <= mover.radius_m + _AROUND_M
    return found
