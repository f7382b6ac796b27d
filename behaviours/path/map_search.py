"""The way to the landing mark over the site map: to where it was seen, else to unseen ground."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from behaviours.path.following import FollowConfig, around, follow
from behaviours.path.next_viewpoint import (
    GroundInView,
    Viewpoint,
    ViewpointConfig,
    best_viewpoint,
    shown_by,
    still_shows_m2,
    unseen,
)
from behaviours.path.clearance import Flags, Floats, Route, Margins, ClearanceMap, ClearanceMaps, Passage
from uav_bt.protocols import Decision
from uav_bt.types import Corridor, ObstaclePoints
from uav_bt.types.site_map import MapMark, SiteMap


@dataclass(frozen=True, kw_only=True)
class MapSearchConfig:
    """How the mark is searched for."""

    close_m: float = 0.9  # so near to its place the lowered camera shows the mark
    reach_m: float = 1.5  # further from it no known path ends: other ground is looked at first
    facing_rad: float = math.radians(10)  # what is looked at is faced to this,
    look_s: float = 0.8  # for so long
    at_view_m: float = 0.25
    kept: float = 0.4  # a view is flown to while it shows this share of what it showed at first
    doubted_s: float = 1.0  # a map that the views contradict for so long is not flown by
    margins: Margins = field(default_factory=Margins)
    follow: FollowConfig = field(default_factory=FollowConfig)
    view: ViewpointConfig = field(default_factory=ViewpointConfig)


class Aim(enum.Enum):
    """What is flown to."""

    MARK = "mark"
    GROUND = "unseen ground"


class MapSearch:
    """Decides on each new map where to fly; remembers where it has looked in vain.

    Args:
        config: how it searches.
    """

    def __init__(self, config: MapSearchConfig | None = None) -> None:
        self.config = config or MapSearchConfig()
        self.aim = Aim.GROUND
        self._mark_s = -math.inf  # the mark was not where it was seen up to then
        self._round_s = -math.inf  # ground seen before is looked at again
        self._in_vain_m = np.empty((0, 2))  # places that stayed unseen from where they should show
        self._restarts = 0
        self._width = Passage.ORDINARY  # of the way to the view
        self.pause()

    @property
    def looks(self) -> bool:
        """Whether what is looked for is faced now."""
        return self._facing_s is not None

    def pause(self) -> None:
        """Forget where the drone is flying to; what was searched is remembered."""
        self._view: Viewpoint | None = None
        self._facing_s: float | None = None

    def mark_is_gone(self, site_map: SiteMap) -> None:
        """Note that the mark is not where the map has it."""
        if site_map.mark is not None:
            self._mark_s = site_map.mark.seen_s
        self.pause()

    def mark_of(self, site_map: SiteMap) -> MapMark | None:
        """Return where the mark may be: seen, and not looked for in vain since."""
        mark = site_map.mark
        return mark if mark is not None and mark.seen_s > self._mark_s else None

    def decide(
        self,
        site_map: SiteMap,
        obstacles: ObstaclePoints | None,
        corridor: Corridor | None,
        sight: GroundInView,
    ) -> Decision | None:
        """Return the next course.

        Args:
            site_map: with the newest view.
            obstacles: for what is assumed.
            corridor: what it shows ahead; None without depth.
            sight: of the camera at the pitch that ground is searched with.

        Returns:
            The course; done where the mark must be below or right ahead, but was not found; None
            when the map knows no way.
        """
        if site_map.contradicted_s > self.config.doubted_s:
            self.pause()
            return None
        if site_map.restarts != self._restarts:  # its frame is another one
            self._restarts, self._in_vain_m = site_map.restarts, np.empty((0, 2))
            self.pause()
        # Where there is no other way, it leads through where something moved, too.
        lately = around(obstacles, site_map, unmapped_s=self.config.follow.unmapped_s)
        rooms = ClearanceMaps(site_map, lately, self.config.margins, crossing=True)
        mark = self.mark_of(site_map)
        if mark is not None:
            self.aim = Aim.MARK
            for width in Passage:
                decision = self._to_mark(rooms[width], mark, corridor)
                if decision is not None:
                    return decision
        self.aim = Aim.GROUND
        return self._to_ground(rooms, site_map.captured_s, corridor, sight)

    def _to_mark(self, room: ClearanceMap, mark: MapMark, corridor: Corridor | None) -> Decision | None:
        cfg, site_map, time_s = self.config, room.map, room.fastest.time_s
        apart_m = np.linalg.norm(site_map.places_m() - (mark.x_m, mark.y_m), axis=-1)
        apart_m = np.where(np.isfinite(time_s), apart_m, math.inf)
        if float(apart_m.min()) > cfg.reach_m:
            return None
        forward_m, right_m = site_map.pose.to_body(mark.x_m, mark.y_m)
        end = int(np.where(apart_m <= cfg.close_m, time_s, math.inf).argmin())
        if apart_m.min() > cfg.close_m:
            end = int(apart_m.argmin())
        cell = divmod(end, apart_m.shape[1])
        if cell == room.start or math.hypot(forward_m, right_m) <= cfg.close_m:
            looked = self._looked(math.atan2(right_m, forward_m), site_map.captured_s)
            return looked or Decision(done=True, reason="at the mark")
        self._facing_s = None
        leg = room.leg(room.fastest.to(cell), time_s=float(room.fastest.time_s[cell]))
        reason = f"mark {math.hypot(forward_m, right_m):.1f} m"
        return self._follow(leg, room, corridor, reason)

    def _to_ground(
        self, rooms: ClearanceMaps, now_s: float, corridor: Corridor | None, sight: GroundInView
    ) -> Decision | None:
        if self._view is not None and not self._is_settled(self._view, rooms[self._width], sight):
            return self._to_view(self._view, rooms[self._width], corridor, sight)
        if not self._choose(rooms, sight):
            if self._round_s >= now_s:
                return None
            # All was seen: the search begins anew.
            self._round_s = now_s
            self._in_vain_m = np.empty((0, 2))
            self._choose(rooms, sight)
        if self._view is None:
            return None
        return self._to_view(self._view, rooms[self._width], corridor, sight)

    def _choose(self, rooms: ClearanceMaps, sight: GroundInView) -> bool:
        """Choose the next view, with as much room as there is; False when none is worth it."""
        self.pause()
        for width in Passage:
            room = rooms[width]
            view = best_viewpoint(room, self._wanted(room), sight, self.config.view)
            if view is not None:
                self._view, self._width = view, width
                return True
        return False

    def _to_view(
        self, view: Viewpoint, room: ClearanceMap, corridor: Corridor | None, sight: GroundInView
    ) -> Decision | None:
        cfg, site_map = self.config, room.map
        cell = site_map.cell_of(view.x_m, view.y_m)
        reason = f"unseen {view.shows_m2:.1f} m2"
        if cell == room.start or self._is_at(view, site_map):
            turn_rad = math.remainder(view.yaw_rad - site_map.pose.yaw_rad, 2.0 * math.pi)
            looked = self._looked(turn_rad, site_map.captured_s, reason)
            if looked is not None:
                return looked
            in_vain_m = self._still_wanted(shown_by(view, room, sight, cfg.view), room)
            self._in_vain_m = np.vstack([self._in_vain_m, in_vain_m])
            self.pause()
            return Decision(forward_m=0.1, speed_mps=0.0, reason="looked")
        self._facing_s = None
        leg = room.leg(room.fastest.to(cell), time_s=float(room.fastest.time_s[cell]))
        return self._follow(leg, room, corridor, reason)

    def _follow(
        self, leg: Route, room: ClearanceMap, corridor: Corridor | None, reason: str
    ) -> Decision | None:
        margins = self.config.margins.by(room.map.residual_m)
        config = self.config.follow
        return follow(leg, room.map, corridor, margins=margins, config=config, reason=reason)

    def _is_settled(self, view: Viewpoint, room: ClearanceMap, sight: GroundInView) -> bool:
        """Return whether a view has shown most of what it can, or cannot be reached any more."""
        cfg, time_s = self.config, room.fastest.time_s
        row, column = room.map.cell_of(view.x_m, view.y_m)
        height, width = time_s.shape
        if not (0 <= row < height and 0 <= column < width):
            return True
        if not math.isfinite(time_s[row, column]) and not self._is_at(view, room.map):
            return True
        left_m2 = still_shows_m2(view, room, self._wanted(room), sight, cfg.view)
        return left_m2 < max(cfg.kept * view.shows_m2, cfg.view.min_view_m2)

    def _is_at(self, view: Viewpoint, site_map: SiteMap) -> bool:
        apart_m = math.hypot(view.x_m - site_map.pose.x_m, view.y_m - site_map.pose.y_m)
        return apart_m <= self.config.at_view_m

    def _looked(self, turn_rad: float, now_s: float, reason: str = "looks") -> Decision | None:
        """Return the turn that is left; None once what lies there was faced for long enough."""
        cfg = self.config
        if abs(turn_rad) > cfg.facing_rad:
            self._facing_s = None
        elif self._facing_s is None:
            self._facing_s = now_s
        elif now_s - self._facing_s >= cfg.look_s:
            return None
        return Decision(forward_m=0.1, yaw_rad=turn_rad, speed_mps=0.0, reason=reason)

    def _wanted(self, room: ClearanceMap) -> Flags:
        wanted = unseen(room, self._round_s, self.config.view)
        cells, inside = self._cells(self._in_vain_m, room.map, wanted)
        wanted[tuple(cells[inside].T)] = False
        return wanted

    def _still_wanted(self, places_m: Floats, room: ClearanceMap) -> Floats:
        wanted = self._wanted(room)
        cells, inside = self._cells(places_m, room.map, wanted)
        return np.asarray(places_m[inside][wanted[tuple(cells[inside].T)]])

    def _cells(
        self, places_m: Floats, site_map: SiteMap, wanted: Flags
    ) -> tuple[NDArray[np.intp], Flags]:
        """Return the cells of places among what is wanted, and which of them lie there."""
        around = self.config.view.around_cells(site_map.cell_m)
        apart_m = places_m - np.array(site_map.corner_m)
        cells = np.rint(apart_m / site_map.cell_m).astype(np.intp) + around
        return cells, np.asarray(((cells >= 0) & (cells < wanted.shape)).all(axis=1))
