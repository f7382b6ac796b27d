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
        # Mission times of the first take-off command, and of the first tick in which the mission
        # explores, has explored, has found the landing mark and has landed.
        self._first_s: dict[str, float] = {}
        self._end_s: float | None = None
        self._path: list[tuple[float, float]] = []  # time, metres travelled since the take-off
        self._last_xy: tuple[float, float] | None = None
        self._truth: Truth | None = None
        self._min_clearance_m = math.inf
        self._ticks = 0
        self._tick_s: list[float] = []  # computing times of the tree's ticks
        self.warnings: dict[str, None] = {}  # in the order of their first time

    def on_tick(self, record: TickRecord) -> None:
        """Add a tick."""
        self._ticks += 1
        # The tree is not ticked while a person flies and after an abort.
        if record.override is not Override.MANUAL and record.tree_status is not Status.IDLE:
            self._tick_s.append(record.compute_s)
        self._end_s = now_s = record.time_s
        self.warnings |= dict.fromkeys(record.warnings)
        if isinstance(record.command.movement, TakeOff):
            self._first_s.setdefault("take-off", now_s)
        start_s = self._first_s.get("take-off")
        if self._map_check is not None:
            self._map_check.add(record, since_s=start_s)
        if start_s is None:
            return
        self._travel(record)
        self._note_phase(record.phase, now_s)
        truth, motors_off = record.truth, record.observation.state.flying is FlyingState.LANDED
        if truth is not None:
            self._truth, motors_off = truth, not truth.motors_on
            self._min_clearance_m = min(self._min_clearance_m, truth.clearance_m)
            if self._coverage is not None:
                self._coverage.add(now_s - start_s, truth)
        if motors_off and "found" in self._first_s:
            self._first_s.setdefault("landed", now_s)

    def _note_phase(self, phase: str, now_s: float) -> None:
        if phase == MissionPhase.EXPLORE:
            self._first_s.setdefault("exploring", now_s)
        # Exploring may end above the mark: then centring comes next, without search and approach.
        found = phase == MissionPhase.APPROACH or (
            phase == MissionPhase.CENTER and "exploring" in self._first_s
        )
        if found or phase == MissionPhase.SEARCH:
            self._first_s.setdefault("explored", now_s)
        if found:
            self._first_s.setdefault("found", now_s)

    def _travel(self, record: TickRecord) -> None:
        truth, velocity = record.truth, record.observation.state.velocity
        last_s, travelled_m = self._path[-1] if self._path else (record.time_s, 0.0)
        if truth is not None:
            here = (truth.pose.x_m, truth.pose.y_m)
            travelled_m += math.dist(here, self._last_xy or here)
            self._last_xy = here
        else:
            speed_mps = math.hypot(velocity.forward_mps, velocity.right_mps)
            travelled_m += speed_mps * (record.time_s - last_s)
        self._path.append((record.time_s, travelled_m))

    def _travelled_m(self, time_s: float | None) -> float | None:
        """Return the distance until a time; None if that was not reached."""
        if time_s is None or not self._path:
            return None
        before = [metres for at, metres in self._path if at <= time_s + 1e-9]
        return before[-1] if before else 0.0

    def fields(self) -> dict[str, Any]:
        """Return what was measured, by the fields of `FlightReport`."""
        first, stands = self._first_s.get, self._truth
        start_s, exploring_s, found_s = first("take-off"), first("exploring"), first("found")
        if stands is not None and (stands.motors_on or stands.landing_error_m is None):
            stands = None
        way_m = None  # of the first 90 s; None: nothing was explored in this time
        if start_s is not None and exploring_s is not None and exploring_s <= start_s + EXPLORE_S:
            way_m = self._travelled_m(start_s + EXPLORE_S)
        explored_m, found_m = (self._travelled_m(at) for at in (first("explored"), found_s))
        searched_m = None if explored_m is None or found_m is None else found_m - explored_m
        clearance_m = self._min_clearance_m
        return {
            "duration_s": _span(start_s, self._end_s),
            "explore_distance_m": _rounded(way_m),
            "total_distance_m": _rounded(self._travelled_m(self._end_s)),
            "search_distance_m": _rounded(searched_m),
            "time_to_find_mark_s": _span(first("explored"), found_s),
            "time_to_land_s": _span(found_s, first("landed")),
            "landing_error_m": None if stands is None else _rounded(stands.landing_error_m),
            "on_mark": None if stands is None else stands.on_mark,
            "min_clearance_m": _rounded(clearance_m) if math.isfinite(clearance_m) else None,
            **({} if self._coverage is None or start_s is None else self._coverage.fields()),
            **({} if self._map_check is None else self._map_check.fields()),
            "ticks": self._ticks,
            "tick_ms": Percentiles.of_seconds(self._tick_s),
        }


def _span(start_s: float | None, end_s: float | None) -> float | None:
    return None if start_s is None or end_s is None else round(end_s - start_s, 3)


def _rounded(value_m: float | None) -> float | None:
    return None if value_m is None else round(value_m, 4)
