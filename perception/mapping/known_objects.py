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
from dataclasses import dataclass, replace
from statistics import median
from typing import Final

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from uav_bt.types import Pose2D
from uav_bt.types.arrays import Flags, Floats
from uav_bt.types.site_map import MapObject

_FAR: Final = 1e6  # cost of a pair that is too far apart; the assignment needs finite costs
_STD_OF_SPREAD: Final = 1.48  # of a normal distribution, over the median distance from its middle


@dataclass(frozen=True, kw_only=True)
class KnownObjectConfig:
    """Which objects are the same, and which views measure a height. All numbers were chosen.

    Attributes:
        apart_m: An object may have moved by this and half of the shorter sides of both bases.
        restart_m: Extra distance after a restart of the map, until the object is found again.
        beside_m: A measured height belongs to an object this near to its place.
        min_edges: Least number of bearings of a measurement.
        measurements: Number of the newest measurements that are kept. The height is their median.
        floor_m: Error that does not fall with the number of measurements, such as that of the
            drone's own height.
    """

    apart_m: float = 0.1
    restart_m: float = 0.5
    beside_m: float = 0.15
    min_edges: int = 3
    measurements: int = 40
    floor_m: float = 0.02


@dataclass(kw_only=True)
class _Known:
    """An object of the mission."""

    id: int
    newest: MapObject
    is_present: bool = True
    doubt_m: float = 0.0
    heights_m: deque[float]
    height_m: float | None = None
    height_std_m: float | None = None

    def measure(self, floor_m: float) -> None:
        """Compute the height from the measurements.

        Args:
            floor_m: Least standard deviation.
        """
        self.height_m = middle_m = median(self.heights_m)
        spread_m = _STD_OF_SPREAD * median(abs(each_m - middle_m) for each_m in self.heights_m)
        self.height_std_m = math.hypot(floor_m, spread_m / math.sqrt(len(self.heights_m)))

    def named(self) -> MapObject:
        """Return the object with its id and its height."""
        return replace(
            self.newest, id=self.id, height_m=self.height_m, height_std_m=self.height_std_m
        )


class KnownObjects:
    """Gives the objects of a map ids that last for a mission, and heights.

    Args:
        config: Which objects are the same.
    """

    def __init__(self, config: KnownObjectConfig | None = None) -> None:
        self._config = config or KnownObjectConfig()
        self._known: list[_Known] = []
        self._edges: list[tuple[Floats, NDArray[np.uint8], Floats]] = []

    def see_edges(self, xy_m: Floats, ids: NDArray[np.uint8], heights_m: Floats) -> None:
        """Add the upper edges in a view; they count from the next call of `named` on.

        Args:
            xy_m: (N, 2) points where the sides below them meet the ground, in the map's frame.
            ids: (N,) classes of the sides.
            heights_m: (N,) heights of the edges above the ground; NaN where unknown.
        """
        self._edges.append((xy_m, ids, heights_m))

    def named(self, found: Sequence[MapObject]) -> tuple[MapObject, ...]:
        """Return the objects with their ids and heights.

        Args:
            found: Objects of the present map.
        """
        left = list(range(len(found)))
        owners: dict[int, _Known] = {}
        # First the objects of the last search: one that vanished takes no id from one that stands.
        for group in (True, False):
            candidates = [each for each in self._known if each.is_present is group]
            pairs = self._assigned([found[index] for index in left], candidates)
            owners |= {left[row]: candidates[column] for row, column in pairs}
            left = [index for index in left if index not in owners]
        for each in self._known:
            each.is_present = False
        present = []
        for index, item in enumerate(found):
            owner = owners.get(index) or self._first(item)
            owner.newest, owner.is_present, owner.doubt_m = item, True, 0.0
            present.append(owner)
        self._measure_heights(present)
        return tuple(owner.named() for owner in present)

    def restart(self, correction: Pose2D) -> None:
        """Move the known objects to the frame of a new map.

        Args:
            correction: The pose of the dead-reckoned frame, in which the new map begins, in the
                frame of the abandoned map.
        """
        for each in self._known:
            x_m, y_m = correction.to_body(each.newest.x_m, each.newest.y_m)
            each.newest = replace(
                each.newest, x_m=x_m, y_m=y_m, yaw_rad=each.newest.yaw_rad - correction.yaw_rad
            )
            each.is_present, each.doubt_m = False, self._config.restart_m
        self._edges.clear()

    def _first(self, item: MapObject) -> _Known:
        """Return a new known object."""
        heights_m: deque[float] = deque(maxlen=self._config.measurements)
        self._known.append(_Known(id=len(self._known) + 1, newest=item, heights_m=heights_m))
        return self._known[-1]

    def _assigned(
        self, found: Sequence[MapObject], known: Sequence[_Known]
    ) -> list[tuple[int, int]]:
        """Return the pairs of found and known objects with the least sum of distances."""
        if not found or not known:
            return []
        places_m, known_m = _places_m(found), _places_m([each.newest for each in known])
        apart_m = np.hypot(*np.moveaxis(places_m[:, None] - known_m, -1, 0))
        doubt_m = np.array([each.doubt_m for each in known])
        known_reach_m = np.array([_reach_m(each.newest) for each in known]) + doubt_m
        reach_m = np.array([_reach_m(each) for each in found])[:, None] + known_reach_m
        classes = np.array([each.newest.class_id for each in known])
        same = np.array([each.class_id for each in found])[:, None] == classes
        costs = np.where(same & (apart_m <= reach_m + self._config.apart_m), apart_m, _FAR)
        pairs = zip(*linear_sum_assignment(costs), strict=True)
        return [(int(row), int(column)) for row, column in pairs if costs[row, column] < _FAR]

    def _measure_heights(self, owners: Sequence[_Known]) -> None:
        """Give the edges seen since the last search to the objects below them."""
        if not self._edges:
            return
        xy_m, ids, heights_m = (np.concatenate(column) for column in zip(*self._edges, strict=True))
        self._edges.clear()
        known = np.isfinite(heights_m)
        xy_m, ids, heights_m = xy_m[known], ids[known], heights_m[known]
        classes = set(ids.tolist())
        for each in owners:
            if each.newest.class_id not in classes:
                continue
            near = (ids == each.newest.class_id) & self._is_at(each.newest, xy_m)
            if np.count_nonzero(near) >= self._config.min_edges:
                each.heights_m.append(float(np.median(heights_m[near])))
                each.measure(self._config.floor_m)

    def _is_at(self, item: MapObject, xy_m: Floats) -> Flags:
        """Return which points lie on an object's base or beside it, (N,)."""
        middle = Pose2D(x_m=item.x_m, y_m=item.y_m, yaw_rad=item.yaw_rad)
        half_m = np.array([item.size_m, item.width_m]) / 2 + self._config.beside_m
        return np.asarray((np.abs(middle.points_to_body(xy_m)) <= half_m).all(axis=1))


def _places_m(items: Sequence[MapObject]) -> Floats:
    return np.array([(each.x_m, each.y_m) for each in items])


def _reach_m(item: MapObject) -> float:
    """Return half of the shorter side of an object's base."""
    return min(item.size_m, item.width_m) / 2
