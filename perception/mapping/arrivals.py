"""Detection of points that have arrived on ground seen free before."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from perception.mapping.landmarks import Landmarks, nearest_circles
from uav_bt.types.arrays import Flags, Floats


@dataclass(frozen=True, kw_only=True)
class ArrivalConfig:
    """Which points belong to standing obstacles.

    A point that is seen again is displaced by the map's drift and by the errors of height and
    pitch. A new point near a settled point is therefore that obstacle again. Views fit the map by
    0.02 m in the mean, 0.03 to 0.08 m with the network `any`. The distances were chosen on flights
    without and with slow movers: with larger ones a mover at 0.2 m/s counts as a standing obstacle.
    """

    beside_m: float = 0.15  # a point this near to a settled point belongs to it
    beside_new_m: float = 0.1  # the same for a point that has just settled
    beside_mps: float = 0.04  # growth from `beside_new_m` to `beside_m`
    # A point on ground that was seen before settles after this time. Chosen.
    settles_s: float = 2.0
    # A point that a mover owns may be this much nearer to settled points. Less than `beside_new_m`,
    # so that the points of a box that a mover passes stay those of the box. Chosen.
    shared_m: float = 0.05


def find_arrivals(
    seen: Landmarks,
    known: Landmarks,
    on_ground: Flags,
    owned: Flags,
    config: ArrivalConfig,
) -> Flags:
    """Return which points of a view have arrived, (N,): on seen ground or owned by a mover.

    Args:
        seen: the view's bases, N of them.
        known: the map's bases.
        on_ground: (N,) points on ground that earlier views have shown.
        owned: (N,) points within a mover's circle.
        config: which points belong to standing obstacles.
    """
    if not len(seen):
        return np.zeros(0, dtype=bool)
    off_m = _off_standing_m(seen, known, config)
    return np.asarray((on_ground & (off_m > 0.0)) | (owned & (off_m > -config.shared_m)))


def _off_standing_m(seen: Landmarks, known: Landmarks, config: ArrivalConfig) -> Floats:
    """Return the distance of points to the circles around settled points, (N,), m."""
    time_s = float(seen.seen_s[0])
    known = known.take((known.settled_s <= time_s) & (known.missed == 0.0))
    reach_m = config.beside_new_m + config.beside_mps * (time_s - known.settled_s)
    reach_m = np.minimum(config.beside_m, reach_m)
    return nearest_circles(seen.xy_m, known.xy_m, reach_m)[0]
