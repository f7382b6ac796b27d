"""Follows a flight tick by tick, and measures what its report states."""

from __future__ import annotations

import math
from typing import Any

from uav_bt.mission.covered_ground import CoveredGround
from uav_bt.mission.flight_report import EXPLORE_S, Percentiles
from uav_bt.mission.map_check import MapCheck
from uav_bt.mission.safety import Override
from uav_bt.mission.tick import TickRecord
from uav_bt.tree import Status
from uav_bt.types import FlyingState, MissionPhase, TakeOff, Truth


class FlightLog:
    """Listens to the runner and keeps the facts of the report; some need a known ground."""

    def __init__(
        self, coverage: CoveredGround | None = None, map_check: MapCheck | None = None
    ) -> None:
        self._coverage = coverage
        self._map_check = map_check
        # Times of the flight's events, mission seconds.
        self._take_off_s: float | None = None
        self._exploring_s: float | None = None
        self._explored_s: float | None = None
        self._found_s: float | None = None
        self._landed_s: float | None = None
        self._path: list[tuple[float, float]] = []  # time, metres travelled since the take-off
        self._last_xy: tuple[float, float] | None = None
        self._last_s: float | None = None
        self._travelled_m = 0.0
        self._min_clearance_m = math.inf
        self._ticks = 0
        self._tick_s: list[float] = []  # computing times of the tree's ticks
        self._last_truth: Truth | None = None
        self._end_s: float | None = None
        self.warnings: dict[str, None] = {}  # in the order of their first time

    def on_tick(self, record: TickRecord) -> None:
        """Add a tick."""
        self._ticks += 1
        # The tree is not ticked while a person flies and after an abort.
        if record.override is not Override.MANUAL and record.tree_status is not Status.IDLE:
            self._tick_s.append(record.compute_s)
        self._end_s = record.time_s
        self.warnings |= dict.fromkeys(record.warnings)
        if self._take_off_s is None and isinstance(record.command.movement, TakeOff):
            self._take_off_s = record.time_s
        if self._map_check is not None:
            self._map_check.add(record, since_s=self._take_off_s)
        if self._take_off_s is None:
            return
        self._travel(record)
        self._mark_phase(record)
        truth = record.truth
        if truth is not None:
            self._last_truth = truth
            self._min_clearance_m = min(self._min_clearance_m, truth.clearance_m)
            if self._coverage is not None:
                self._coverage.add(record.time_s - self._take_off_s, truth)
        if self._landed_s is None and self._found_s is not None and _motors_off(record):
            self._landed_s = record.time_s

    def _mark_phase(self, record: TickRecord) -> None:
        """Note the start and end of exploring, and the time when the landing mark was found."""
        phase = record.phase
        if self._exploring_s is None and phase == MissionPhase.EXPLORE:
            self._exploring_s = record.time_s
        # Exploring may end above the mark: then centring comes next, without search and approach.
        found = phase == MissionPhase.APPROACH or (
            phase == MissionPhase.CENTER and self._exploring_s is not None
        )
        if self._explored_s is None and (found or phase == MissionPhase.SEARCH):
            self._explored_s = record.time_s
        if self._found_s is None and found:
            self._found_s = record.time_s

    def _travel(self, record: TickRecord) -> None:
        truth, state = record.truth, record.observation.state
        if truth is not None:
            here = (truth.pose.x_m, truth.pose.y_m)
            if self._last_xy is not None:
                self._travelled_m += math.dist(here, self._last_xy)
            self._last_xy = here
        elif self._last_s is not None:
            speed = math.hypot(state.velocity.forward_mps, state.velocity.right_mps)
            self._travelled_m += speed * (record.time_s - self._last_s)
        self._last_s = record.time_s
        self._path.append((record.time_s, self._travelled_m))

    def _travelled_at(self, time_s: float | None) -> float | None:
        if time_s is None or not self._path:
            return None
        before = [metres for at, metres in self._path if at <= time_s + 1e-9]
        return before[-1] if before else 0.0

    def _explored_m(self) -> float | None:
        """Return the distance of the first 90 s. None: nothing was explored in this time."""
        start_s, exploring_s = self._take_off_s, self._exploring_s
        if start_s is None or exploring_s is None or exploring_s > start_s + EXPLORE_S:
            return None
        return self._travelled_at(start_s + EXPLORE_S)

    def fields(self) -> dict[str, Any]:
        """Return what was measured, by the fields of `FlightReport`."""
        start_s, stands = self._take_off_s, self._last_truth
        if stands is not None and (stands.motors_on or stands.landing_error_m is None):
            stands = None
        explored, found = (self._travelled_at(at) for at in (self._explored_s, self._found_s))
        searched = None if explored is None or found is None else found - explored
        clearance_m = self._min_clearance_m
        return {
            "duration_s": _span(start_s, self._end_s),
            "explore_distance_m": _rounded(self._explored_m()),
            "total_distance_m": None if start_s is None else _rounded(self._travelled_m),
            "search_distance_m": _rounded(searched),
            "time_to_find_mark_s": _span(self._explored_s, self._found_s),
            "time_to_land_s": _span(self._found_s, self._landed_s),
            "landing_error_m": None if stands is None else _rounded(stands.landing_error_m),
            "on_mark": None if stands is None else stands.on_mark,
            "min_clearance_m": _rounded(clearance_m) if math.isfinite(clearance_m) else None,
            **({} if self._coverage is None or start_s is None else self._coverage.fields()),
            **({} if self._map_check is None else self._map_check.fields()),
            "ticks": self._ticks,
            "tick_ms": Percentiles.of_seconds(self._tick_s),
        }


def _motors_off(record: TickRecord) -> bool:
    if record.truth is not None:
        return not record.truth.motors_on
    return record.observation.state.flying is FlyingState.LANDED


def _span(start_s: float | None, end_s: float | None) -> float | None:
    return None if start_s is None or end_s is None else round(end_s - start_s, 3)


def _rounded(value_m: float | None) -> float | None:
    return None if value_m is None else round(value_m, 4)
