"""Detection of what has arrived on ground seen free before: bases, and hidden obstacles.

A point that is seen again is displaced by the map's drift and by the errors of height and pitch. A
new point near a settled point is therefore that obstacle again. Views fit the map by 0.02 m in the
mean, 0.03 to 0.08 m with the network `any`. The distances were chosen on flights without and with
slow movers: with larger ones a mover at 0.2 m/s counts as a standing obstacle.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from perception.mapping.ground_grid import GroundGrid
from perception.mapping.landmarks import Landmarks, nearest_circles
from uav_bt.types import Pose2D
from uav_bt.types.arrays import Flags, Floats

SETTLES_S: Final = 2.0  # a point on ground that was seen before settles after this time
_BESIDE_M: Final = 0.15  # a point this near to a settled point belongs to it
_BESIDE_NEW_M: Final = 0.1  # the same for a point that has just settled
_BESIDE_MPS: Final = 0.04  # growth from one to the other
# A point that a mover owns may be this much nearer to settled points. Less than `_BESIDE_NEW_M`, so
# that the points of a box that a mover passes stay those of the box.
_SHARED_M: Final = 0.05

STEP_M: Final = 0.1  # between the tested places on a bearing
HIDDEN_M: Final = 0.9  # assumed distance of a hidden arrival's middle from the body's centre
HIDDEN_MPS: Final = 0.5  # its assumed speed, towards the drone
_FROM_M: Final = 0.4  # nearest tested distance; a nearer obstacle would touch the body
_TO_M: Final = 1.1  # farthest tested distance; ground further away need not have been seen free
_KNOWN_M: Final = 0.3  # a place this near to an obstacle of the map belongs to it
_BEARINGS: Final = 3  # least number of bearings, a degree apart; fewer are specks of the class map


def find_arrivals(seen: Landmarks, known: Landmarks, on_ground: Flags, owned: Flags) -> Flags:
    """Return which points of a view have arrived, (N,): on seen ground or owned by a mover.

    Args:
        seen: the view's bases, N of them.
        known: the map's bases.
        on_ground: (N,) points on ground that earlier views have shown.
        owned: (N,) points within a mover's circle.
    """
    if not len(seen):
        return np.zeros(0, dtype=bool)
    time_s = float(seen.seen_s[0])
    known = known.take((known.settled_s <= time_s) & (known.missed == 0.0))
    reach_m = np.minimum(_BESIDE_M, _BESIDE_NEW_M + _BESIDE_MPS * (time_s - known.settled_s))
    off_m = nearest_circles(seen.xy_m, known.xy_m, reach_m)[0]
    return np.asarray((on_ground & (off_m > 0.0)) | (owned & (off_m > -_SHARED_M)))


def hidden_arrival(
    hidden_m: Floats, pose: Pose2D, grid: GroundGrid, known_m: Floats
) -> Floats | None:
    """Return the direction of an obstacle that has arrived with its base below the view.

    A camera that looks ahead shows no base nearer than about 1.3 m. A mover that comes from the
    side or turns a corner may be nearer when it comes into view. It then covers ground that was
    seen free before and where the map has no obstacle.

    Args:
        hidden_m: (N, 2) nearest ground in view on the bearings of obstacles of unknown range,
            forward and right of the body's centre.
        pose: The body in the map's frame.
        grid: The ground that was seen.
        known_m: (M, 2) bases and sides of the obstacles of the map.

    Returns:
        (2,) in the map's frame; None if nothing has arrived.
    """
    if len(hidden_m) < _BEARINGS:
        return None
    ends_m = np.hypot(*hidden_m.T)
    ranges_m = np.arange(_FROM_M, ends_m.max() + STEP_M, STEP_M)
    ahead = hidden_m / ends_m[:, None]
    places_m = pose.points_to_world((ahead[:, None] * ranges_m[:, None]).reshape(-1, 2))
    shape = len(hidden_m), len(ranges_m)
    free = grid.was_ground(places_m).reshape(shape) | (ranges_m > _TO_M)
    if len(known_m):
        apart_m = np.hypot(*np.moveaxis(places_m[:, None] - known_m, -1, 0)).min(axis=1)
        free &= (apart_m > _KNOWN_M).reshape(shape)
    covers = (free | (ranges_m > ends_m[:, None])).all(axis=1)
    if covers.sum() < _BEARINGS:
        return None
    middle = np.median(ahead[covers], axis=0, keepdims=True)
    here_m = np.array([pose.x_m, pose.y_m])
    (towards_m,) = pose.points_to_world(middle) - here_m
    return np.asarray(towards_m / np.hypot(*towards_m))
