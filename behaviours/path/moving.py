"""Where what moves will be, for plans around it."""

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
class MovingConfig:
    """How far ahead movers are predicted, and how much room they get."""

    ahead_s: float = 3.0
    step_s: float = 0.2
    # They turn and stop: what their velocity errs by counts for so long only.
    sure_s: float = 1.5
    taken_s: float = 1.0  # no leg is planned over where a mover is within so long

    @property
    def times_s(self) -> Floats:
        """The times of a prediction."""
        return np.arange(0.0, self.ahead_s + self.step_s / 2, self.step_s)


def predicted_m(mover: MapMover, times_s: Floats, config: MovingConfig) -> tuple[Floats, Floats]:
    """Return where a mover will be, (T, 2), and the radius that it may fill then, (T,).

    Args:
        mover: of the map.
        times_s: (T,) from now on.
        config: how its uncertainty counts.
    """
    doubt_m = np.hypot(mover.std_m, mover.std_mps * np.minimum(times_s, config.sure_s))
    return mover.at(times_s), mover.radius_m + doubt_m


def taken_m(movers: Sequence[MapMover], config: MovingConfig | None = None) -> Floats:
    """Return points around the ground that movers fill now and soon, (N, 2) in the map's frame."""
    config = config or MovingConfig()
    times_s = np.arange(0.0, config.taken_s + config.step_s / 2, config.step_s)
    angles = np.linspace(0.0, 2.0 * math.pi, _RIM, endpoint=False)
    rim = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    points = [
        mover.at(times_s)[:, None] + share * mover.radius_m * rim
        for mover in movers
        for share in (0.5, 1.0)
    ]
    return np.array(points).reshape(-1, 2)
