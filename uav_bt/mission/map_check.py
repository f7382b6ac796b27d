"""Compares the mission's map with the truth."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np

from uav_bt.mission.map_alignment import MapAlignment, MapPlacement
from uav_bt.mission.tick import TickRecord
from uav_bt.types.ground import Ground, Standing
from uav_bt.types.site_map import MapObject, SiteMap

FOUND_M: Final = 0.5  # m, largest distance from a true object to its counterpart on the map
_SAMPLES_S: Final = (90.0, 180.0)  # from the take-off command
_SLACK_S: Final = 1e-6


class MapCheck:
    """Follows a flight and compares its map with the truth.

    Args:
        ground: of the scene, with the objects on it.
        read: returns the mission's present map; None without a map.
    """

    def __init__(self, ground: Ground, read: Callable[[], SiteMap | None]) -> None:
        self._objects = [each for each in ground.standing if each.class_id is not None]
        self._read = read
        self._alignment = MapAlignment()
        self._newest: SiteMap | None = None
        self._drift_m: float | None = None
        self._samples_m: dict[float, float] = {}

    def add(self, record: TickRecord, *, since_s: float | None) -> None:
        """Add a tick, beginning with the flight's first.

        Args:
            record: of the tick.
            since_s: time of the take-off command; None before it.
        """
        site_map, truth = self._read(), record.truth
        if truth is None:
            return
        reported_rad = record.observation.state.attitude.yaw_rad
        self._alignment.add(record.time_s, truth.pose, reported_rad, site_map)
        placement = self._alignment.placement
        if placement is None or site_map is None or site_map is self._newest:
            return
        self._newest = site_map
        believed = placement.pose_to_world(site_map.pose)
        self._drift_m = math.hypot(believed.x_m - truth.pose.x_m, believed.y_m - truth.pose.y_m)
        for due_s in _SAMPLES_S:
            if since_s is not None and record.time_s - since_s >= due_s - _SLACK_S:
                self._samples_m.setdefault(due_s, self._drift_m)

    def fields(self) -> dict[str, Any]:
        """Return the fields of the flight's report; none without a map."""
        placement, site_map = self._alignment.placement, self._newest
        if placement is None or site_map is None or self._drift_m is None:
            return {}
        errors_m = matches(site_map.objects, self._objects, placement)
        sampled = {
            f"map_drift_{due_s:.0f}s_m": round(drift_m, 4)
            for due_s, drift_m in self._samples_m.items()
        }
        return {
            "objects_found": len(errors_m),
            "objects_total": len(self._objects),
            "object_errors_m": [round(error_m, 4) for error_m in errors_m],
            "false_objects": len(site_map.objects) - len(errors_m),
            **sampled,
            "map_drift_m": round(self._drift_m, 4),
            "map_restarts": site_map.restarts,
        }


def matches(
    believed: Sequence[MapObject], standing: Sequence[Standing], placement: MapPlacement
) -> list[float]:
    """Return the distances of matched objects of map and scene, metres.

    Objects of one class within half a metre are matched, the nearest pairs first, each object at
    most once.

    Args:
        believed: objects of the map.
        standing: objects of the scene.
        placement: of the map in the world.
    """
    places_m = placement.to_world(np.array([(one.x_m, one.y_m) for one in believed]).reshape(-1, 2))
    pairs = sorted(
        (math.dist(place_m, (true.footprint.x_m, true.footprint.y_m)), i, j)
        for i, (one, place_m) in enumerate(zip(believed, places_m, strict=True))
        for j, true in enumerate(standing)
        if one.class_id == true.class_id
    )
    found: list[float] = []
    taken: set[tuple[str, int]] = set()
    for error_m, i, j in pairs:
        if error_m <= FOUND_M and taken.isdisjoint({("map", i), ("place", j)}):
            taken |= {("map", i), ("place", j)}
            found.append(error_m)
    return found
