"""Where what moves will be, and how near a course comes to it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uav_bt.types.site_map import MapMover

Floats = NDArray[np.float64]

_RIM = 12  # points around a mover


@dataclass(frozen=True, kw_only=True)
class MoversAheadConfig:
    """How far ahead movers are predicted, and how much room they get."""

    ahead_s: float = 3.0
    step_s: float = 0.2
    # They turn and stop: what their velocity errs by counts for so long only.
    doubted_s: float = 1.5
    taken_s: float = 1.0  # no leg is planned over where a mover is within so long
    body_m: float = 0.2  # half of the body's diagonal
    spare_m: float = 0.2  # beside that, between body and mover
    yields_by: float = 0.5  # the speeds that are tried: each that share of the one before,
    min_mps: float = 0.12  # down to this; then the drone waits

    @property
    def times_s(self) -> Floats:
        """The times of a prediction, (T,)."""
        return np.arange(0.0, self.ahead_s + self.step_s / 2, self.step_s)


def outlines_m(movers: Sequence[MapMover], config: MoversAheadConfig | None = None) -> Floats:
    """Return points around the ground that movers fill now and soon, (N, 2) in the map's frame."""
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
    """Return how much room is left between the body and the movers, beside what they err by.

    Args:
        movers: of the map.
        places_m: (..., T, 2) where the drone is at `config.times_s`, in the map's frame.
        config: how movers are predicted.

    Returns:
        (...) the least over the time; infinite without movers.
    """
    times_s = config.times_s
    min_left_m = np.full(places_m.shape[:-2], math.inf)
    for mover in movers:
        doubt_m = np.hypot(mover.std_m, mover.std_mps * np.minimum(times_s, config.doubted_s))
        apart_m = np.linalg.norm(places_m - mover.at(times_s), axis=-1)
        left_m = apart_m - mover.radius_m - doubt_m - config.body_m
        min_left_m = np.minimum(min_left_m, left_m.min(axis=-1))
    return min_left_m


def yielding_mps(
    movers: Sequence[MapMover], path_m: Floats, speed_mps: float, config: MoversAheadConfig
) -> float:
    """Return the speed along a path at which nothing that moves comes too near; 0 waits.

    Args:
        movers: of the map.
        path_m: (N, 2) from the drone on, in the map's frame.
        speed_mps: at most.
        config: how much room movers get.
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
