"""The identity and the height of the map's objects, kept through a mission.

`find_objects` makes the objects anew from the points of the map. Each object found is assigned to
one found before, of the same class and near its place, and gets its id.

- *An object that vanishes* keeps its id and its place. It gets the id again when an object of its
  class is found near that place.
- *Two objects that merge* become the nearer one. The id of the other one is kept, as above.
- *An object that splits* goes on as the part nearest to its place. The other part gets the id of an
  object that had vanished there, or a new one.
- *An object seen with another class* is another object.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from statistics import median
from typing import Final

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.spatial.distance import cdist

from perception.mapping.upper_edges import upper_edges
from perception.mapping.view import View
from uav_bt.types import Pose2D
from uav_bt.types.arrays import Floats
from uav_bt.types.site_map import MapObject

_APART_M: Final = 0.1  # an object may have moved by this and half of the shorter sides of both
_RESTART_M: Final = 0.5  # extra distance after a restart, until the object is found again; chosen
_MEASUREMENTS: Final = 100  # the newest ones that are kept; the height is their median; chosen
# Error that does not fall with the number of measurements, as that of the drone's own height
_FLOOR_M: Final = 0.02
_FAR: Final = 1e6  # cost of a pair that is too far apart; the assignment needs finite costs
_STD_OF_SPREAD: Final = 1.48  # of a normal distribution, over the median distance from its middle


@dataclass(kw_only=True)
class _Known:
    """An object of the mission."""

    newest: MapObject  # with its id and its height
    is_present: bool = True
    doubt_m: float = 0.0
    heights_m: deque[float] = field(default_factory=lambda: deque(maxlen=_MEASUREMENTS))

    def see(self, found: MapObject) -> None:
        self.newest = replace(
            found,
            id=self.newest.id,
            height_m=self.newest.height_m,
            height_std_m=self.newest.height_std_m,
        )
        self.is_present, self.doubt_m = True, 0.0

    def measure(self, height_m: float) -> None:
        self.heights_m.append(height_m)
        middle_m = median(self.heights_m)
        spread_m = _STD_OF_SPREAD * median(abs(each_m - middle_m) for each_m in self.heights_m)
        std_m = math.hypot(_FLOOR_M, spread_m / math.sqrt(len(self.heights_m)))
        self.newest = replace(self.newest, height_m=middle_m, height_std_m=std_m)


class KnownObjects:
    """Gives the objects of a map ids that last for a mission, and heights."""

    def __init__(self) -> None:
        self._known: list[_Known] = []

    def measure(self, view: View) -> None:
        """Measure the objects of the last search in a view that is placed in the map's frame."""
        present = [each for each in self._known if each.is_present]
        heights_m = upper_edges(view, [each.newest for each in present])
        for each, height_m in zip(present, heights_m.tolist(), strict=True):
            if math.isfinite(height_m):
                each.measure(height_m)

    def named(self, found: Sequence[MapObject]) -> tuple[MapObject, ...]:
        """Return the objects of the present map with their ids and heights."""
        left = list(range(len(found)))
        owners: dict[int, _Known] = {}
        # First the objects of the last search: one that vanished takes no id from one that stands.
        for group in (True, False):
            candidates = [each for each in self._known if each.is_present is group]
            pairs = _assigned([found[index] for index in left], candidates)
            owners |= {left[row]: candidates[column] for row, column in pairs}
            left = [index for index in left if index not in owners]
        for each in self._known:
            each.is_present = False
        present = []
        for index, item in enumerate(found):
            if index not in owners:
                self._known.append(_Known(newest=replace(item, id=len(self._known) + 1)))
            owner = owners.get(index, self._known[-1])
            owner.see(item)
            present.append(owner)
        return tuple(owner.newest for owner in present)

    def restart(self, correction: Pose2D) -> None:
        """Move the known objects to the frame of a new map, which is the dead-reckoned one.

        `correction` is the pose of that frame in the frame of the abandoned map.
        """
        for each in self._known:
            x_m, y_m = correction.to_body(each.newest.x_m, each.newest.y_m)
            yaw_rad = each.newest.yaw_rad - correction.yaw_rad
            each.newest = replace(each.newest, x_m=x_m, y_m=y_m, yaw_rad=yaw_rad)
            each.is_present, each.doubt_m = False, _RESTART_M


def _assigned(found: Sequence[MapObject], known: Sequence[_Known]) -> list[tuple[int, int]]:
    """Return the pairs of found and known objects with the least sum of distances."""
    if not found or not known:
        return []

    def columns(items: Sequence[MapObject]) -> Floats:
        return np.array([(e.x_m, e.y_m, min(e.size_m, e.width_m) / 2, e.class_id) for e in items])

    here, there = columns(found), columns([each.newest for each in known])
    apart_m = cdist(here[:, :2], there[:, :2])
    doubt_m = np.array([each.doubt_m for each in known])
    reach_m = here[:, 2, None] + (there[:, 2] + doubt_m)
    same = here[:, 3, None] == there[:, 3]
    costs = np.where(same & (apart_m <= reach_m + _APART_M), apart_m, _FAR)
    pairs = zip(*linear_sum_assignment(costs), strict=True)
    return [(int(row), int(column)) for row, column in pairs if costs[row, column] < _FAR]
