"""The mission's map: where it lies in the world, how true it is, and whether it can be flown by.

The map's frame has x along the yaw that the drone reports as 0, y to its right and yaw clockwise;
the world has z up and yaw counter-clockwise. A point of the map is mirrored, turned and moved.
"""

from __future__ import annotations

import cmath
import logging
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from uav_bt.mission.tick import TickRecord
from uav_bt.types import Pose2D, wrap_angle
from uav_bt.types.arrays import Floats
from uav_bt.types.ground import Ground, Standing
from uav_bt.types.site_map import MapObject, SiteMap

_LOG: Final = logging.getLogger(__name__)

FOUND_M: Final = 0.5  # largest distance from a true object to its counterpart on the map
_MIRROR: Final = np.array([1.0, -1.0])
_MEAN_S: Final = 1.0  # of telemetry over which the turn is averaged, against its noise
_SLACK_S: Final = 1e-6
_NO_GROUND_S: Final = 8.0  # without ground in view, a warning is given
_LAND_S: Final = 30.0  # without ground since the take-off, the mission ends with a landing
_SHOWN_S: Final = 10.0  # an event of the map is shown


@dataclass(frozen=True, kw_only=True)
class MapPlacement:
    """Placement of a map in the world."""

    frame: Pose2D  # the map's origin, and its x axis counter-clockwise from the world's

    def to_world(self, points_m: Floats) -> Floats:
        """Return points of the map, (N, 2) metres, in the world."""
        return self.frame.points_to_world(points_m * _MIRROR)

    def pose_to_world(self, pose: Pose2D) -> Pose2D:
        """Return a pose in the map as one in the world."""
        x_m, y_m = self.frame.to_world(pose.x_m, -pose.y_m)
        yaw_rad = wrap_angle(self.frame.yaw_rad - pose.yaw_rad)
        return Pose2D(x_m=x_m, y_m=y_m, yaw_rad=yaw_rad)


class MapAlignment:
    """Aligns a map with the world by the drone's pose in both when the map began."""

    def __init__(self) -> None:
        self._first_s: float | None = None
        self._x_axis = complex(0.0)  # of the map in the world: the sum of its directions
        self._began: tuple[Pose2D, Pose2D] | None = None  # the drone's pose in map and world
        self._restarts = 0

    def add(
        self, time_s: float, pose: Pose2D, reported_yaw_rad: float, site_map: SiteMap | None
    ) -> None:
        """Add a tick, beginning with the first: the true pose, and the yaw of telemetry."""
        if self._first_s is None:
            self._first_s = time_s
        if time_s - self._first_s <= _MEAN_S:
            # The reported yaw is the drone's turn from the map's x axis, clockwise.
            self._x_axis += cmath.rect(1.0, pose.yaw_rad + reported_yaw_rad)
        if site_map is None:
            return
        if self._began is None or site_map.restarts > self._restarts:
            self._began, self._restarts = (site_map.pose, pose), site_map.restarts

    @property
    def placement(self) -> MapPlacement | None:
        """Placement of the map; None before there is a map."""
        if self._began is None:
            return None
        believed, true = self._began
        x_axis = Pose2D(x_m=0.0, y_m=0.0, yaw_rad=cmath.phase(self._x_axis))
        x_m, y_m = x_axis.to_world(believed.x_m, -believed.y_m)
        return MapPlacement(
            frame=Pose2D(x_m=true.x_m - x_m, y_m=true.y_m - y_m, yaw_rad=x_axis.yaw_rad)
        )


class MapCheck:
    """Follows a flight and compares its map, which `read` returns, with the truth."""

    def __init__(self, ground: Ground, read: Callable[[], SiteMap | None]) -> None:
        self._objects = [each for each in ground.standing if each.class_id]
        self._read = read
        self._alignment = MapAlignment()
        self._newest: SiteMap | None = None
        self._drifts_m: dict[str, float] = {}  # by the fields of the report

    def add(self, record: TickRecord, *, since_s: float | None) -> None:
        """Add a tick, beginning with the first; the take-off was commanded at `since_s`."""
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
        drift_m = math.hypot(believed.x_m - truth.pose.x_m, believed.y_m - truth.pose.y_m)
        self._drifts_m["map_drift_m"] = round(drift_m, 4)
        for due_s in (90, 180):
            if since_s is not None and record.time_s - since_s >= due_s - _SLACK_S:
                self._drifts_m.setdefault(f"map_drift_{due_s}s_m", round(drift_m, 4))

    def fields(self) -> dict[str, Any]:
        """Return the fields of the flight's report; none without a map."""
        placement, site_map = self._alignment.placement, self._newest
        if placement is None or site_map is None:
            return {}
        found = matches(site_map.objects, self._objects, placement)
        heights_m = [(one.height_m, true.height_m) for _, one, true in found]
        return {
            "objects_found": len(found),
            "objects_total": len(self._objects),
            "object_errors_m": [round(error_m, 4) for error_m, _, _ in found],
            "object_height_errors_m": [
                round(seen_m - true_m, 4) for seen_m, true_m in heights_m if seen_m is not None
            ],
            "false_objects": len(site_map.objects) - len(found),
            **self._drifts_m,
            "map_restarts": site_map.restarts,
        }


def matches(
    believed: Sequence[MapObject], standing: Sequence[Standing], placement: MapPlacement
) -> list[tuple[float, MapObject, Standing]]:
    """Return matched objects of map and scene, and their distances in metres before them.

    Objects of one class within half a metre are matched, the nearest pairs first, each object at
    most once.
    """
    places_m = placement.to_world(np.array([(one.x_m, one.y_m) for one in believed]).reshape(-1, 2))
    pairs = sorted(
        (math.dist(place_m, (true.footprint.x_m, true.footprint.y_m)), i, j)
        for i, (one, place_m) in enumerate(zip(believed, places_m, strict=True))
        for j, true in enumerate(standing)
        if one.class_id == true.class_id
    )
    found = []
    taken: set[tuple[str, int]] = set()
    for error_m, i, j in pairs:
        if error_m <= FOUND_M and taken.isdisjoint({("map", i), ("place", j)}):
            taken |= {("map", i), ("place", j)}
            found.append((error_m, believed[i], standing[j]))
    return found


class MapWatch:
    """Follows the map of one mission: its faults, its events, and whether to end the mission."""

    def __init__(self) -> None:
        self._airborne_s: float | None = None  # start of the flight; None on the ground
        self._restarts, self._mark_moved_m = 0, 0.0
        self._has_seen_ground = False
        self._events: dict[str, float] = {}  # end of the time for which each is shown
        self.warnings: tuple[str, ...] = ()  # faults and events of the map
        self.trouble: str | None = None  # why nothing can be flown by the map

    def update(self, site_map: SiteMap | None, now_s: float, *, airborne: bool) -> None:
        """Check the map of a tick; None if the mission keeps none."""
        if site_map is None:
            self.warnings, self.trouble = (), None
            return
        lasting = []
        blind_s = self._blind_s(site_map, now_s, airborne=airborne)
        if blind_s > _NO_GROUND_S:
            lasting.append("no ground in view: there is nothing to fly over")
        if site_map.full:
            lasting.append("the place is larger than its map, whose rest is not explored")
        self._events = {text: until_s for text, until_s in self._events.items() if until_s >= now_s}
        self._events |= dict.fromkeys(self._happened(site_map), now_s + _SHOWN_S)
        self._has_seen_ground |= bool(site_map.ground.any())
        lands = blind_s > _LAND_S and not self._has_seen_ground
        self.trouble = f"no ground in view for {blind_s:.0f} s" if lands else None
        before, self.warnings = self.warnings, (*lasting, *self._events)
        for text in self.warnings:
            if text not in before:
                _LOG.warning("%s", text)

    def _blind_s(self, site_map: SiteMap, now_s: float, *, airborne: bool) -> float:
        """Return the time without ground in view, s; views steeply down do not count."""
        if not airborne:
            self._airborne_s = None
            return 0.0
        if self._airborne_s is None:
            self._airborne_s = now_s
        return site_map.captured_s - max(site_map.ground_s, self._airborne_s)

    def _happened(self, site_map: SiteMap) -> Iterator[str]:
        """Yield the events of the map since the last tick."""
        if site_map.restarts > self._restarts:
            yield (
                "the map was begun anew, because the view contradicted it (was the drone moved, or "
                "its odometry reset?)"
            )
        moved_m = 0.0 if site_map.mark is None else site_map.mark.moved_m
        if moved_m > self._mark_moved_m:
            yield (
                f"the landing mark stands {moved_m - self._mark_moved_m:.1f} m from where the map "
                "had it, and was placed anew"
            )
        self._restarts, self._mark_moved_m = site_map.restarts, moved_m
