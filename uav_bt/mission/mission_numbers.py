"""The drone's place, and the numbers of a mission on the board (`uav_bt.board.keys`)."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

import numpy as np

from uav_bt.board import MARK, ODOMETRY, SITE_MAP, keys
from uav_bt.board.blackboard import Blackboard, Key
from uav_bt.board.context import FlightNotes
from uav_bt.board.keys import UNKNOWN, UNKNOWN_PLACE
from uav_bt.mission.judge import Judge
from uav_bt.mission.position_hold import BLIND_S
from uav_bt.types import Observation, Pose2D, wrap_angle
from uav_bt.types.area import Area
from uav_bt.types.site_map import SiteMap

_DOUBTED_S: Final = 1.0  # contradiction for which a map is doubted, as the planner does
_COVERED_EVERY_S: Final = 1.0  # between two counts of covered cells
_BATTERY_STEP: Final = 0.01  # of a battery that reports whole per cent
_BATTERY_S: Final = 20.0  # of flight before the use of the battery is known; chosen


class Whereabouts:
    """The drone's place by odometry and site map, relative to the take-off pose.

    The take-off pose is the first pose of the odometry, or that of the site map once there is one.
    The map's last correction of the drift is kept while the map is stale.
    """

    def __init__(self, board: Blackboard, area: Area | None = None) -> None:
        self._board = board
        self.area = area
        self.place: Pose2D | None = None  # of the last update; None where it is unknown
        self.site_map: SiteMap | None = None  # the newest one, which may be stale
        self._start: Pose2D | None = None

    def update(self) -> Pose2D | None:
        """Return the present pose: metres ahead and to the right, heading clockwise, or None."""
        motion, site_map = self._board.value(ODOMETRY), self._board.value(SITE_MAP)
        if site_map is not None:
            self.site_map, self._start = site_map, site_map.start
        self.place = None
        if motion is not None:
            here: Pose2D = motion.pose
            self._start = self._start or here
            if self.site_map is not None:
                here = self.site_map.correction.pose_to_world(here)
            ahead = self._start.pose_to_body(here)
            self.place = replace(ahead, yaw_rad=wrap_angle(ahead.yaw_rad))
        return self.place

    def mark_m(self) -> float | None:
        """Return the horizontal distance of the landing mark, by its track or the fresh map."""
        fix, site_map = self._board.value(MARK), self._board.value(SITE_MAP)
        if fix is not None:
            return fix.range_m
        if site_map is None or site_map.mark is None:
            return None
        mark, pose = site_map.mark, site_map.pose
        return math.hypot(mark.x_m - pose.x_m, mark.y_m - pose.y_m)


class MissionNumbers:
    """Keeps the numbers of one mission; place, map and mark are those of the tick before."""

    def __init__(
        self, board: Blackboard, notes: FlightNotes, whereabouts: Whereabouts, judge: Judge
    ) -> None:
        self._board, self._notes = board, notes
        self._where = whereabouts
        self._judge = judge
        self._took_off: tuple[float, float] | None = None  # time and charge at the take-off
        self._battery_per_min = self._covered = UNKNOWN
        self._covered_s = -math.inf
        self._map_since_s = math.inf  # when the first map was seen
        self._viewed: float | None = None  # capture time of the map whose ground was looked up
        self._ground_s = -math.inf

    def write(self, observation: Observation, now_s: float) -> None:
        """Write all numbers; `now_s` is the mission clock's time."""
        state, frame, site_map = observation.state, observation.frame, self._where.site_map
        self._use_battery(now_s, state.battery, flying=state.in_air)
        if site_map is not None and now_s - self._covered_s >= _COVERED_EVERY_S:
            known = int(np.count_nonzero(site_map.ground))
            covered = np.count_nonzero(site_map.ground & site_map.passed)
            self._covered, self._covered_s = covered / known if known else 0.0, now_s
        marked = site_map is not None and site_map.mark is not None
        numbers = {
            keys.BATTERY_SHARE: UNKNOWN if state.battery is None else state.battery,
            keys.BATTERY_PER_MIN: self._battery_per_min,
            keys.LINK_SHARE: UNKNOWN if state.link is None else state.link,
            keys.FLYING: float(state.in_air),
            keys.TIME_LEFT: self._judge.time_left(now_s),
            keys.BLIND: UNKNOWN if frame is None else self._blind_s(frame.captured_s, now_s),
            keys.UNHEARD: max(now_s - state.captured_s, 0.0),
            keys.PHOTOS_COUNT: len(self._notes.photos),
            keys.MARK_KNOWN: float(marked or self._board.value(MARK) is not None),
            keys.LOCALISED: float(self._localised()),
            keys.OBJECTS_COUNT: UNKNOWN if site_map is None else len(site_map.objects),
            keys.COVERAGE_SHARE: self._covered,
            **self._place(),
        }
        for key, value in numbers.items():
            self._board.write(key, value)

    def _use_battery(self, now_s: float, charge: float | None, *, flying: bool) -> None:
        """Measure the mean use since the last take-off; on the ground the last one is kept.

        A battery that reports whole per cent may have lost almost a step more than it shows. The
        step is counted, so that the use is overestimated at first and never underestimated.
        """
        if not flying:
            self._took_off = None
        elif charge is not None:
            self._took_off = begin_s, full = self._took_off or (now_s, charge)
            if now_s - begin_s >= _BATTERY_S:
                used = max(full - charge, 0.0) + _BATTERY_STEP
                self._battery_per_min = 60.0 * used / (now_s - begin_s)

    def _blind_s(self, captured_s: float, now_s: float) -> float:
        """Return the time without a new frame, or without ground in the views of the map."""
        blind_s, site_map = max(now_s - captured_s, 0.0), self._where.site_map
        if site_map is None or site_map.captured_s == -math.inf:
            return blind_s
        self._map_since_s = min(self._map_since_s, site_map.captured_s)
        if site_map.captured_s != self._viewed:
            self._viewed, self._ground_s = site_map.captured_s, site_map.ground_s
        # Views steeply down are not on the map, so time counts up to its newest view.
        return max(blind_s, site_map.captured_s - max(self._ground_s, self._map_since_s))

    def _place(self) -> dict[Key[float], float]:
        at, area = self._where.place, self._where.area
        if at is None:
            unknown = dict.fromkeys((keys.X, keys.Y, keys.HEADING), UNKNOWN_PLACE)
            margin_m = UNKNOWN_PLACE if area is None else -UNKNOWN_PLACE
            return {**unknown, keys.HOME: UNKNOWN, keys.AREA_MARGIN: margin_m}
        return {
            keys.X: at.x_m,
            keys.Y: at.y_m,
            keys.HEADING: math.degrees(at.yaw_rad),
            keys.HOME: math.hypot(at.x_m, at.y_m),
            keys.AREA_MARGIN: UNKNOWN_PLACE if area is None else area.margin_m(at.x_m, at.y_m),
        }

    def _localised(self) -> bool:
        motion, site_map = self._board.value(ODOMETRY), self._board.value(SITE_MAP)
        if motion is None or site_map is None:
            return False
        return motion.untracked_s <= BLIND_S and site_map.contradicted_s <= _DOUBTED_S
