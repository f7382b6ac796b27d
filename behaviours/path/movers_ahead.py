"""Predicted places of movers, and the gap between them and a course."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from uav_bt.types.arrays import Floats
from uav_bt.types.site_map import MapMover

_RIM: Final = 12  # points on the circle of a mover


@dataclass(frozen=True, kw_only=True)
class MoversAheadConfig:
    """Prediction of movers, and the gap to them. Chosen in flights among movers in the twin.

    Attributes:
        ahead_s: Length of the prediction.
        step_s: Time between two predicted places.
        doubted_s: Time after which the uncertainty of the velocity no longer grows the place's:
            movers turn and stop.
        doubted_m: Largest uncertainty of a place that counts. A mover that is out of view may be
            anywhere after a few seconds, and no way leads away from all of these places.
        taken_s: Routes avoid the places that a mover reaches within this time.
        body_m: Half of the body's diagonal.
        spare_m: Least gap between body and mover.
        yields_by: Ratio of each speed tried to the one before.
        min_mps: The drone waits instead of flying more slowly than this.
    """

    ahead_s: float = 3.0
    step_s: float = 0.2
    doubted_s: float = 1.5
    doubted_m: float = 1.0
    taken_s: float = 1.0
    body_m: float = 0.2
    spare_m: float = 0.2
    yields_by: float = 0.5
    min_mps: float = 0.12

    @property
    def times_s(self) -> Floats:
        """The times of a prediction, (T,)."""
        return np.arange(0.0, self.ahead_s + self.step_s / 2, self.step_s)


def outlines_m(movers: Sequence[MapMover], config: MoversAheadConfig | None = None) -> Floats:
    """Return points that movers occupy within `taken_s`, (N, 2) metres in the map's frame."""
    if not movers:
        return np.empty((0, 2))
    config = config or MoversAheadConfig()
    times_s = np.arange(0.0, config.taken_s + config.step_s / 2, config.step_s)
    angles = np.linspace(0.0, 2.0 * math.pi, _RIM, endpoint=False)
    rim = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    points = [
        mover.at(times_s)[:, None] + share * mover.radius_m * rim
        for mover in movers
        for share in (0.5, 1.0)
    ]
    return np.array(points).reshape(-1, 2)


def gap_m(movers: Sequence[MapMover], places_m: Floats, config: MoversAheadConfig) -> Floats:
    """Return the gap between the body and the nearest mover, less the movers' uncertainty, metres.

    Args:
        movers: The movers of the map.
        places_m: (..., T, 2) places of the drone at `config.times_s`, in the map's frame.
        config: How movers are predicted.

    Returns:
        (...) least gap over the prediction; inf without movers.
    """
    times_s = config.times_s
    min_left_m = np.full(places_m.shape[:-2], math.inf)
    for mover in movers:
        doubt_m = np.hypot(mover.std_m, mover.std_mps * np.minimum(times_s, config.doubted_s))
        doubt_m = np.minimum(doubt_m, config.doubted_m)
        apart_m = np.linalg.norm(places_m - mover.at(times_s), axis=-1)
        left_m = apart_m - mover.radius_m - doubt_m - config.body_m
        min_left_m = np.minimum(min_left_m, left_m.min(axis=-1))
    return min_left_m


def yielding_mps(
    movers: Sequence[MapMover], path_m: Floats, speed_mps: float, config: MoversAheadConfig
) -> float:
    """Return the highest speed along a path that keeps the gap to movers; 0 to wait.

    Args:
        movers: The movers of the map.
        path_m: (N, 2) path from the drone, metres in the map's frame.
        speed_mps: Highest speed.
        config: How movers are predicted.
    """
    if not movers or speed_mps <= 0.0:
        return speed_mps
    along_m = np.concatenate([[0.0], np.hypot(*np.diff(path_m, axis=0).T).cumsum()])
    tried_mps = speed_mps
    while tried_mps >= config.min_mps:
        flown_m = tried_mps * config.times_s
        places_m = np.stack([np.interp(flown_m, along_m, axis) for axis in path_m.T], axis=-1)
        if float(gap_m(movers, places_m, config)) >= config.spare_m:
            return tried_mps
        tried_mps *= config.yields_by
    return 0.0
