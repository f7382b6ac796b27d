"""Detection of an obstacle that has arrived near the drone while its base is below the view.

A camera that looks ahead shows no base nearer than about 1.3 m. A mover that comes from the side or
turns a corner may be nearer when it comes into view. It then covers ground that was seen free
before and where the map has no obstacle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from perception.mapping.ground_grid import GroundGrid
from uav_bt.types import Pose2D
from uav_bt.types.arrays import Floats


@dataclass(frozen=True, kw_only=True)
class HiddenArrivalConfig:
    """When an obstacle with a hidden base has arrived. The numbers are chosen.

    Attributes:
        from_m: Nearest tested distance from the body's centre; a nearer obstacle would touch the
            body.
        to_m: Farthest tested distance. Ground further away need not have been seen free.
        step_m: Distance between the places that are tested on a bearing.
        beside_m: A place this near to an obstacle of the map belongs to it.
        bearings: Least number of bearings, which are one degree apart. Fewer are specks of the
            class map.
        place_m: Assumed distance of its middle from the body's centre.
        speed_mps: Assumed speed, towards the drone.
    """

    from_m: float = 0.4
    to_m: float = 1.1
    step_m: float = 0.1
    beside_m: float = 0.3
    bearings: int = 3
    place_m: float = 0.9
    speed_mps: float = 0.5


def hidden_arrival(
    hidden_m: Floats, pose: Pose2D, grid: GroundGrid, known_m: Floats, config: HiddenArrivalConfig
) -> Floats | None:
    """Return the direction of an obstacle that has arrived, (2,) in the map's frame.

    None if nothing has arrived.

    Args:
        hidden_m: (N, 2) nearest ground in view on the bearings of obstacles of unknown range,
            forward and right of the body's centre.
        pose: The body in the map's frame.
        grid: The ground that was seen.
        known_m: (M, 2) bases and sides of the obstacles of the map.
        config: When an obstacle has arrived.
    """
    if len(hidden_m) < config.bearings:
        return None
    ends_m = np.hypot(*hidden_m.T)
    ranges_m = np.arange(config.from_m, ends_m.max() + config.step_m, config.step_m)
    ahead = hidden_m / ends_m[:, None]
    places_m = pose.points_to_world((ahead[:, None] * ranges_m[:, None]).reshape(-1, 2))
    shape = len(hidden_m), len(ranges_m)
    free = grid.was_ground(places_m).reshape(shape) | (ranges_m > config.to_m)
    if len(known_m):
        apart_m = np.hypot(*np.moveaxis(places_m[:, None] - known_m, -1, 0)).min(axis=1)
        free &= (apart_m > config.beside_m).reshape(shape)
    covers = (free | (ranges_m > ends_m[:, None])).all(axis=1)
    if covers.sum() < config.bearings:
        return None
    middle = np.median(ahead[covers], axis=0, keepdims=True)
    here_m = np.array([pose.x_m, pose.y_m])
    (towards_m,) = pose.points_to_world(middle) - here_m
    return np.asarray(towards_m / np.hypot(*towards_m))
