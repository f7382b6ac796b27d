"""Search for the landing mark by the site map: its last seen place first, then unseen ground."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from behaviours.path.clearance import ClearanceMap, Route
from behaviours.path.following import UNMAPPED_S, follow
from behaviours.path.margins import Margins, Passage
from behaviours.path.nearby import recent_obstacles
from behaviours.path.next_viewpoint import (
    GroundInView,
    Viewpoint,
    ViewpointConfig,
    best_viewpoint,
    shown_by,
    still_shows_m2,
    unseen,
)
from behaviours.path.passages import ClearanceMaps
from uav_bt.answers import Done, FollowLeg, Rotate
from uav_bt.types import Corridor, NearObstacles
from uav_bt.types.arrays import Flags, Floats
from uav_bt.types.site_map import MapMark, SiteMap

Course = FollowLeg | Rotate | Done
"""The answers of `MapSearch`."""


@dataclass(frozen=True, kw_only=True)
class MapSearchConfig:
    """Limits of the search. The numbers were chosen in flights on the training scenes.

    Attributes:
        close_m: Within this distance of its place the lowered camera shows the mark.
        reach_m: Unseen ground is searched first if no known path ends within this distance of the
            mark.
        facing_rad: Largest heading error at which a place counts as faced.
        look_s: Time for which a place is faced.
        at_viewpoint_m: Largest distance at which a viewpoint counts as reached.
        kept: A viewpoint is given up when it shows less than this share of its initial area.
        doubted_s: The map is not used when the views have contradicted it for longer.
        margins: Distances that routes keep.
        view: How viewpoints are evaluated.
        repeats: Whether the search starts over when all ground was seen, because the mark may have
            been missed.
    """

    close_m: float = 0.9
    reach_m: float = 1.5
    facing_rad: float = math.radians(10)
    look_s: float = 0.8
    at_viewpoint_m: float = 0.25
    kept: float = 0.4
    doubted_s: float = 1.0
    margins: Margins = field(default_factory=Margins)
    view: ViewpointConfig = field(default_factory=ViewpointConfig)
    repeats: bool = True


class Aim(enum.Enum):
    """The goal of the search."""

    MARK = "mark"
    GROUND = "unseen ground"


class MapSearch:
    """Decides on each new map where to fly, and keeps a list of places that stayed unseen.

    Args:
        config: Limits of the search.
    """

    def __init__(self, config: MapSearchConfig | None = None) -> None:
        self.config = config or MapSearchConfig()
        self.aim = Aim.GROUND
        self._round_s = -math.inf  # ground seen before this time counts as unseen
        self._in_vain_m = np.empty((0, 2))  # places that a viewpoint should have shown but did not
        self._restarts = 0
        self._passage = Passage.ORDINARY  # of the route to the viewpoint
        self.pause()

    @property
    def looks(self) -> bool:
        """Whether the place that is searched is faced now."""
        return self._facing_s is not None

    def pause(self) -> None:
        """Drop the goal; searched places are remembered."""
        self._viewpoint: Viewpoint | None = None
        self._facing_s: float | None = None

    def decide(
        self,
        site_map: SiteMap,
        mark: MapMark | None,
        obstacles: NearObstacles | None,
        corridor: Corridor | None,
        in_view: GroundInView,
    ) -> Course | None:
        """Return the next course.

        Args:
            site_map: The map with the newest view.
            mark: The landing mark if it may still be at its place; None to search unseen ground.
            obstacles: Obstacles seen around the drone.
            corridor: The safety corridor; None without depth.
            in_view: Ground that the camera shows at the pitch of the search.

        Returns:
            The course; `Done` where the mark should be below or right ahead but was not found; None
            if the map has no path, or if all ground was seen and the search does not start over.
        """
        if site_map.contradicted_s > self.config.doubted_s:
            self.pause()
            return None
        if site_map.restarts != self._restarts:  # the map has a new frame
            self._restarts, self._in_vain_m = site_map.restarts, np.empty((0, 2))
            self.pause()
        recent = recent_obstacles(obstacles, site_map, unmapped_s=UNMAPPED_S)
        # A narrow route may cross lanes of movers.
        maps = ClearanceMaps(site_map, recent, self.config.margins, crossing=True)
        if mark is not None:
            self.aim = Aim.MARK
            course = self._to_mark(maps, mark, corridor)
            if course is not None:
                return course
        self.aim = Aim.GROUND
        return self._to_ground(maps, site_map.captured_s, corridor, in_view)

    def _to_mark(
        self, maps: ClearanceMaps, mark: MapMark, corridor: Corridor | None
    ) -> Course | None:
        cfg, site_map = self.config, maps.map
        place = mark.x_m, mark.y_m
        route = maps.route_to(place, near_m=cfg.close_m, far_m=cfg.reach_m)
        if route is None:
            return None
        forward_m, right_m = site_map.pose.to_body(*place)
        if len(route.path_m) == 1 or math.hypot(forward_m, right_m) <= cfg.close_m:
            looked = self._looked(math.atan2(right_m, forward_m), site_map.captured_s)
            return looked or Done(reason="at the mark")
        self._facing_s = None
        reason = f"mark {math.hypot(forward_m, right_m):.1f} m"
        return self._follow(route, site_map, corridor, reason)

    def _to_ground(
        self, maps: ClearanceMaps, now_s: float, corridor: Corridor | None, in_view: GroundInView
    ) -> Course | None:
        if self._viewpoint is not None and not self._is_settled(
            self._viewpoint, maps[self._passage], in_view
        ):
            return self._to_view(self._viewpoint, maps[self._passage], corridor, in_view)
        if not self._choose(maps, in_view):
            if not self.config.repeats or self._round_s >= now_s:
                return None
            # All ground was seen.
            self._round_s = now_s
            self._in_vain_m = np.empty((0, 2))
            self._choose(maps, in_view)
        if self._viewpoint is None:
            return None
        return self._to_view(self._viewpoint, maps[self._passage], corridor, in_view)

    def _choose(self, maps: ClearanceMaps, in_view: GroundInView) -> bool:
        """Choose the next view, in the widest passage possible; False if none is worth it."""
        self.pause()
        for passage in maps.usable():
            clearance = maps[passage]
            view = best_viewpoint(clearance, self._wanted(clearance), in_view, self.config.view)
            if view is not None:
                self._viewpoint, self._passage = view, passage
                return True
        return False

    def _to_view(
        self,
        view: Viewpoint,
        clearance: ClearanceMap,
        corridor: Corridor | None,
        in_view: GroundInView,
    ) -> Course | None:
        cfg, site_map = self.config, clearance.map
        cell = site_map.cell_of(view.x_m, view.y_m)
        reason = f"unseen {view.shows_m2:.1f} m2"
        if cell == clearance.start or self._is_at(view, site_map):
            turn_rad = math.remainder(view.yaw_rad - site_map.pose.yaw_rad, 2.0 * math.pi)
            looked = self._looked(turn_rad, site_map.captured_s, reason)
            if looked is not None:
                return looked
            in_vain_m = self._still_wanted(shown_by(view, clearance, in_view, cfg.view), clearance)
            self._in_vain_m = np.vstack([self._in_vain_m, in_vain_m])
            self.pause()
            return Rotate(yaw_rad=0.0, reason="looked")
        self._facing_s = None
        return self._follow(clearance.route_to_cell(cell), site_map, corridor, reason)

    def _follow(
        self, route: Route, site_map: SiteMap, corridor: Corridor | None, reason: str
    ) -> Course | None:
        return follow(route, site_map, corridor, margins=self.config.margins, reason=reason)

    def _is_settled(self, view: Viewpoint, clearance: ClearanceMap, in_view: GroundInView) -> bool:
        """Return whether a view has shown most of its area, or cannot be reached any more."""
        cfg, time_s = self.config, clearance.fastest.time_s
        row, column = clearance.map.cell_of(view.x_m, view.y_m)
        height, width = time_s.shape
        if not (0 <= row < height and 0 <= column < width):
            return True
        if not math.isfinite(time_s[row, column]) and not self._is_at(view, clearance.map):
            return True
        left_m2 = still_shows_m2(view, clearance, self._wanted(clearance), in_view, cfg.view)
        return left_m2 < max(cfg.kept * view.shows_m2, cfg.view.min_view_m2)

    def _is_at(self, view: Viewpoint, site_map: SiteMap) -> bool:
        apart_m = math.hypot(view.x_m - site_map.pose.x_m, view.y_m - site_map.pose.y_m)
        return apart_m <= self.config.at_viewpoint_m

    def _looked(self, turn_rad: float, now_s: float, reason: str = "looks") -> Rotate | None:
        """Return the turn that is left; None once the place was faced for `look_s`."""
        cfg = self.config
        if abs(turn_rad) > cfg.facing_rad:
            self._facing_s = None
        elif self._facing_s is None:
            self._facing_s = now_s
        elif now_s - self._facing_s >= cfg.look_s:
            return None
        return Rotate(yaw_rad=turn_rad, reason=reason)

    def _wanted(self, clearance: ClearanceMap) -> Flags:
        wanted = unseen(clearance, self._round_s, self.config.view)
        cells, inside = self._cells(self._in_vain_m, clearance.map, wanted)
        wanted[tuple(cells[inside].T)] = False
        return wanted

    def _still_wanted(self, places_m: Floats, clearance: ClearanceMap) -> Floats:
        wanted = self._wanted(clearance)
        cells, inside = self._cells(places_m, clearance.map, wanted)
        return np.asarray(places_m[inside][wanted[tuple(cells[inside].T)]])

    def _cells(
        self, places_m: Floats, site_map: SiteMap, wanted: Flags
    ) -> tuple[NDArray[np.intp], Flags]:
        """Return the places' cells in the grid of wanted cells, and which are inside it."""
        around = self.config.view.around_cells(site_map.cell_m)
        apart_m = places_m - np.array(site_map.corner_m)
        cells = np.rint(apart_m / site_map.cell_m).astype(np.intp) + around
        return cells, np.asarray(((cells >= 0) & (cells < wanted.shape)).all(axis=1))
