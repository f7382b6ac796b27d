"""Writes the numbers of a mission to the board in every tick (`uav_bt.board.numbers`)."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from uav_bt.board import MARK, ODOMETRY, SITE_MAP
from uav_bt.board import numbers as keys
from uav_bt.board.blackboard import Blackboard
from uav_bt.board.flight_notes import FlightNotes
from uav_bt.board.numbers import UNKNOWN, UNKNOWN_PLACE
from uav_bt.mission.battery_use import BatteryUse
from uav_bt.mission.hold_model import HoldConfig
from uav_bt.mission.judge import Judge
from uav_bt.mission.whereabouts import Whereabouts
from uav_bt.types import Observation
from uav_bt.types.site_map import SiteMap

_DOUBTED_S: Final = 1.0  # contradiction for which a map is doubted, as the planner does
_COVERED_EVERY_S: Final = 1.0  # between two counts of covered cells


class MissionNumbers:
    """Keeps the numbers of one mission.

    Place, map and mark are those that the leaves wrote in the tick before.

    Args:
        board: The mission's board.
        notes: Photographs of the flight.
        whereabouts: Of the drone, updated in every tick.
        judge: Has the time limit.
    """

    def __init__(
        self, board: Blackboard, notes: FlightNotes, whereabouts: Whereabouts, judge: Judge
    ) -> None:
        self._board, self._notes = board, notes
        self._whereabouts = whereabouts
        self._judge = judge
        self._battery = BatteryUse()
        self._covered, self._covered_s = UNKNOWN, -math.inf
        self._blind = _BlindTime()

    def write(self, observation: Observation, now_s: float) -> None:
        """Write all numbers.

        Args:
            observation: Of this tick.
            now_s: Mission clock, seconds.
        """
        write, state = self._board.write, observation.state
        flying = state.in_air
        self._battery.update(now_s, state.battery, flying=flying)
        write(keys.BATTERY_SHARE, UNKNOWN if state.battery is None else state.battery)
        per_min = self._battery.per_min
        write(keys.BATTERY_PER_MIN, UNKNOWN if per_min is None else per_min)
        write(keys.LINK_SHARE, UNKNOWN if state.link is None else state.link)
        write(keys.FLYING, float(flying))
        write(keys.TIME_LEFT, self._judge.time_left(now_s))
        frame = observation.frame
        captured_s = None if frame is None else frame.captured_s
        write(keys.BLIND, self._blind.update(captured_s, self._whereabouts.site_map, now_s))
        write(keys.UNHEARD, max(now_s - state.captured_s, 0.0))
        write(keys.PHOTOS_COUNT, len(self._notes.photos))
        self._write_place()
        self._write_map(now_s)

    def _write_place(self) -> None:
        write, at = self._board.write, self._whereabouts.place
        if at is None:
            for key in (keys.X, keys.Y, keys.HEADING):
                write(key, UNKNOWN_PLACE)
            write(keys.HOME, UNKNOWN)
        else:
            write(keys.X, at.x_m)
            write(keys.Y, at.y_m)
            write(keys.HEADING, math.degrees(at.yaw_rad))
            write(keys.HOME, math.hypot(at.x_m, at.y_m))
        margin_m = self._whereabouts.area_margin_m
        if margin_m is None:
            margin_m = UNKNOWN_PLACE if self._whereabouts.area is None else -UNKNOWN_PLACE
        write(keys.AREA_MARGIN, margin_m)

    def _write_map(self, now_s: float) -> None:
        write, site_map = self._board.write, self._whereabouts.site_map
        mapped = site_map is not None and site_map.mark is not None
        write(keys.MARK_KNOWN, float(mapped or self._board.value(MARK) is not None))
        write(keys.LOCALISED, float(self._localised()))
        write(keys.OBJECTS_COUNT, UNKNOWN if site_map is None else len(site_map.objects))
        if site_map is not None and now_s - self._covered_s >= _COVERED_EVERY_S:
            ground = site_map.ground
            known = int(np.count_nonzero(ground))
            self._covered = np.count_nonzero(ground & site_map.passed) / known if known else 0.0
            self._covered_s = now_s
        write(keys.COVERAGE_SHARE, self._covered)

    def _localised(self) -> bool:
        motion, site_map = self._board.value(ODOMETRY), self._board.value(SITE_MAP)
        return (
            motion is not None
            and site_map is not None
            and motion.untracked_s <= HoldConfig.blind_s
            and site_map.contradicted_s <= _DOUBTED_S
        )


class _BlindTime:
    """Measures the time without a new frame, or without ground in the views of the map."""

    def __init__(self) -> None:
        self._map_since_s = math.inf  # when the first map was seen
        self._viewed: float | None = None  # capture time of the map whose ground was looked up
        self._ground_s = -math.inf

    def update(self, captured_s: float | None, site_map: SiteMap | None, now_s: float) -> float:
        """Return the time in seconds, -1 before the first frame.

        Args:
            captured_s: Capture time of the newest frame; None before the first.
            site_map: The newest map; None without one.
            now_s: Mission clock, seconds.
        """
        if captured_s is None:
            return UNKNOWN
        blind_s = max(now_s - captured_s, 0.0)
        if site_map is None or site_map.captured_s == -math.inf:
            return blind_s
        self._map_since_s = min(self._map_since_s, site_map.captured_s)
        if site_map.captured_s != self._viewed:
            self._viewed, self._ground_s = site_map.captured_s, site_map.ground_s
        # Views steeply down are not on the map, so time counts up to its newest view.
        return max(blind_s, site_map.captured_s - max(self._ground_s, self._map_since_s))
