"""Follows a flight tick by tick, and writes its report."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from uav_bt.board.flight_notes import FlightNotes
from uav_bt.mission.covered_ground import CoveredGround
from uav_bt.mission.flight_report import (
    EXPLORE_S,
    FlightChanges,
    FlightReport,
    Percentiles,
)
from uav_bt.mission.judge import Verdict
from uav_bt.mission.map_check import MapCheck
from uav_bt.mission.safety import Override
from uav_bt.mission.tick import TickRecord
from uav_bt.tree import Status
from uav_bt.types import FlyingState, MissionPhase, TakeOff, Truth
from uav_bt.types.flight_results import FoundObject


@dataclass
class _Marks:
    """Times of the flight's events, mission seconds."""

    take_off_s: float | None = None
    exploring_s: float | None = None
    explored_s: float | None = None
    found_s: float | None = None
    landed_s: float | None = None


class FlightLog:
    """Listens to the runner and keeps the facts of the report.

    Args:
        coverage: measures the covered ground; None if the ground is unknown.
        map_check: compares the mission's map with the truth; None if the ground is unknown.
    """

    def __init__(
        self, coverage: CoveredGround | None = None, map_check: MapCheck | None = None
    ) -> None:
        self._coverage = coverage
        self._map_check = map_check
        self._marks = _Marks()
        self._path: list[tuple[float, float]] = []  # time, metres travelled since the take-off
        self._last_xy: tuple[float, float] | None = None
        self._last_s: float | None = None
        self._travelled_m = 0.0
        self._min_clearance_m = math.inf
        self._ticks = 0
        self._tick_s: list[float] = []  # computing times of the tree's ticks
        self._last_truth: Truth | None = None
        self._end_s: float | None = None
        self._warnings: dict[str, None] = {}  # in the order of their first time

    def on_tick(self, record: TickRecord) -> None:
        """Add a tick."""
        self._ticks += 1
        # The tree is not ticked while a person flies and after an abort.
        if record.override is not Override.MANUAL and record.tree_status is not Status.IDLE:
            self._tick_s.append(record.compute_s)
        self._end_s = record.time_s
        self._warnings |= dict.fromkeys(record.warnings)
        marks = self._marks
        if marks.take_off_s is None and isinstance(record.command.movement, TakeOff):
            marks.take_off_s = record.time_s
        if self._map_check is not None:
            self._map_check.add(record, since_s=marks.take_off_s)
        if marks.take_off_s is None:
            return
        self._travel(record)
        self._mark_phase(record)
        truth = record.truth
        if truth is not None:
            self._last_truth = truth
            self._min_clearance_m = min(self._min_clearance_m, truth.clearance_m)
            if self._coverage is not None:
                self._coverage.add(record.time_s - marks.take_off_s, truth)
        if marks.landed_s is None and marks.found_s is not None and _motors_off(record):
            marks.landed_s = record.time_s

    def _mark_phase(self, record: TickRecord) -> None:
        """Note the start and end of exploring, and the time when the landing mark was found."""
        marks, phase = self._marks, record.phase
        if marks.exploring_s is None and phase == MissionPhase.EXPLORE:
            marks.exploring_s = record.time_s
        # Exploring may end above the mark: then centring comes next, without search and approach.
        found = phase == MissionPhase.APPROACH or (
            phase == MissionPhase.CENTER and marks.exploring_s is not None
        )
        if marks.explored_s is None and (found or phase == MissionPhase.SEARCH):
            marks.explored_s = record.time_s
        if marks.found_s is None and found:
            marks.found_s = record.time_s

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
        start_s, exploring_s = self._marks.take_off_s, self._marks.exploring_s
        if start_s is None or exploring_s is None or exploring_s > start_s + EXPLORE_S:
            return None
        return self._travelled_at(start_s + EXPLORE_S)

    def _covered(self) -> dict[str, Any]:
        """Return the known fields of coverage."""
        coverage, start_s = self._coverage, self._marks.take_off_s
        if coverage is None or start_s is None or self._end_s is None:
            return {}
        end, explored = coverage.now(self._end_s - start_s), coverage.at(EXPLORE_S)
        return {
            "coverage_passed_90s": None if explored is None else round(explored.passed, 4),
            "coverage_passed": round(end.passed, 4),
            "coverage_seen_90s": None if explored is None else round(explored.seen, 4),
            "coverage_seen": round(end.seen, 4),
            "coverage_curve": [
                [point.time_s, round(point.passed, 4), round(point.seen, 4)]
                for point in coverage.curve
            ],
        }

    def report(
        self,
        verdict: Verdict,
        *,
        scene: str | None,
        lab: str | None = None,
        seed: int,
        tree: str,
        policies: Mapping[str, str],
        drone: str,
        profile: str | None,
        changes: FlightChanges | None = None,
        stage_times_s: Mapping[str, Sequence[float]],
        slow_leaves_s: Mapping[str, float] | None = None,
        airborne_at_end: bool = False,
        lost_outputs: Mapping[str, str] | None = None,
        notes: FlightNotes | None = None,
        objects: Sequence[FoundObject] | None = None,
    ) -> FlightReport:
        """Return the report of the flight.

        Args:
            verdict: of the flight.
            scene: name of the scene.
            lab: name of the lab.
            seed: of all random numbers.
            tree: the tree file's name.
            policies: leaf policies, by node.
            drone: name of the drone.
            profile: imperfections of a simulated drone.
            changes: changes for this flight only.
            stage_times_s: durations of each perception stage, seconds.
            slow_leaves_s: the longest time of leaves that blocked, seconds, by path.
            airborne_at_end: whether the drone was left in the air.
            lost_outputs: displays and records that failed, with the reason.
            notes: events and photographs.
            objects: objects of the map at the end; None without a map.
        """
        notes = notes or FlightNotes()
        marks, stands = self._marks, self._last_truth
        if stands is not None and (stands.motors_on or stands.landing_error_m is None):
            stands = None
        start = marks.take_off_s
        explored, found = (self._travelled_at(t) for t in (marks.explored_s, marks.found_s))
        return FlightReport(
            scene=scene,
            lab=lab,
            seed=seed,
            tree=tree,
            policies=dict(policies),
            **vars(changes or FlightChanges()),
            drone=drone,
            profile=profile,
            outcome=verdict.outcome.value,
            reason=verdict.reason,
            duration_s=_span(start, self._end_s),
            explore_distance_m=_rounded(self._explored_m()),
            total_distance_m=_rounded(self._travelled_m if start is not None else None),
            search_distance_m=_rounded(
                None if explored is None or found is None else found - explored
            ),
            time_to_find_mark_s=_span(marks.explored_s, marks.found_s),
            time_to_land_s=_span(marks.found_s, marks.landed_s),
            landing_error_m=None if stands is None else _rounded(stands.landing_error_m),
            on_mark=None if stands is None else stands.on_mark,
            min_clearance_m=_rounded(
                self._min_clearance_m if math.isfinite(self._min_clearance_m) else None
            ),
            **self._covered(),
            **({} if self._map_check is None else self._map_check.fields()),
            ticks=self._ticks,
            tick_ms=Percentiles.of_seconds(self._tick_s),
            perception_ms={
                stage: Percentiles.of_seconds(times) for stage, times in stage_times_s.items()
            },
            slow_leaves={path: round(1000.0 * s, 1) for path, s in (slow_leaves_s or {}).items()},
            warnings=list(self._warnings),
            airborne_at_end=airborne_at_end,
            lost_outputs=dict(lost_outputs or {}),
            objects=None if objects is None else list(objects),
            photos=list(notes.photos),
            events=list(notes.events),
        )


def _motors_off(record: TickRecord) -> bool:
    if record.truth is not None:
        return not record.truth.motors_on
    return record.observation.state.flying is FlyingState.LANDED


def _span(start_s: float | None, end_s: float | None) -> float | None:
    return None if start_s is None or end_s is None else round(end_s - start_s, 3)


def _rounded(value_m: float | None) -> float | None:
    return None if value_m is None else round(value_m, 4)
