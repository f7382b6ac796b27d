"""Ticks, boards and reports for the tests of the displays."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.paper_lab import CLASSES, paper_map
from tests.worlds import values
from uav_bt import types
from uav_bt.board import CLASS_MAP, CORRIDOR, ELAPSED, MARK, METRIC_DEPTH, MISSION_KEYS
from uav_bt.board.blackboard import Blackboard
from uav_bt.clock import ManualClock
from uav_bt.display.lab_map import LabMap, MapItem
from uav_bt.display.shown import FlightFacts, FlownPath, Shown
from uav_bt.mission.flight_log import FlightLog
from uav_bt.mission.flight_report import FlightReport, Percentiles
from uav_bt.mission.tick import TickRecord
from uav_bt.testing import blank_frame, pinhole
from uav_bt.types.ground import Ground

CAMERA = pinhole(64, 36)


def item(x_m: float, y_m: float, size_m: tuple[float, float, float], **more: Any) -> MapItem:
    half_x_m, half_y_m = size_m[0] / 2, size_m[1] / 2
    return MapItem(
        x_m=x_m, y_m=y_m, half_x_m=half_x_m, half_y_m=half_y_m, height_m=size_m[2], **more
    )


LAB = LabMap(
    ground=Ground(size_m=(5.0, 4.0)),
    boxes=(item(1.0, 1.0, (0.4, 0.4, 1.9), colour=(200, 10, 20)),),
    mark=item(-1.5, -1.0, (0.5, 0.5, 0.4), colour=(255, 196, 0)),
)


def facts(**changes: Any) -> FlightFacts:
    told: dict[str, Any] = {"camera": CAMERA, "classes": CLASSES, "lab_map": LAB, "title": "tour"}
    return FlightFacts(**{**told, **changes})


class World:
    """A board with its clock and matching ticks."""

    def __init__(self, start_s: float = 0.0) -> None:
        self.clock = ManualClock(start_s)
        self.board = Blackboard(self.clock, MISSION_KEYS)
        self.index = 0

    def see(self, *, mark: bool = True) -> None:
        """Put a class map and a mark fix on the board."""
        now_s = self.clock.now()
        ids = np.zeros((28, 56), dtype=np.uint8)
        ids[14:] = 1
        self.board.write(CLASS_MAP, paper_map(ids=ids, captured_s=now_s), captured_s=now_s)
        if mark:
            self.board.write(MARK, values.fix(now_s, 1.2, 0.3), captured_s=now_s)

    def see_depth(self) -> None:
        """Put metric depth and a corridor on the board."""
        now_s = self.clock.now()
        depth = types.DepthMap(
            depth=np.full((28, 56), 1.5, np.float32), metric=True, captured_s=now_s
        )
        corridor = values.corridor(1.5, "left", nearest_m=0.6, captured_s=now_s)
        self.board.write(METRIC_DEPTH, depth, captured_s=now_s)
        self.board.write(CORRIDOR, corridor, captured_s=now_s)

    def tick(
        self,
        *,
        pose: types.Pose | None = None,
        yaw_rad: float = 0.0,
        forward_mps: float = 0.0,
        frame: bool = True,
        after_s: float = 0.1,
        **changes: Any,
    ) -> TickRecord:
        """Return the next tick; a pose adds the truth of a referee."""
        time_s = self.clock.now()
        state = types.DroneState(
            captured_s=time_s,
            flying=types.FlyingState.FLYING,
            attitude=types.Attitude(yaw_rad=yaw_rad),
            velocity=types.BodyVelocity(forward_mps=forward_mps),
            height_above_ground_m=1.5,
            gimbal_pitch_rad=-0.5,
        )
        self.board.write(ELAPSED, time_s)
        told: dict[str, Any] = {
            "index": self.index,
            "phase": "explore",
            "active": ("mission", "Explore"),
            "truth": None if pose is None else _truth(time_s, pose),
            "feedback": "clear",
            **changes,
        }
        image = replace(blank_frame(CAMERA, state), index=self.index) if frame else None
        self.index += 1
        self.clock.advance(after_s)
        seen = types.Observation(frame=image, state=state)
        return replace(values.tick(state, **told), observation=seen)


def shown_of(world: World, record: TickRecord, *poses: types.Pose) -> Shown:
    """Return what is shown of a tick after a path of poses."""
    flown = FlownPath()
    for pose in poses:
        flown.add(replace(record, truth=_truth(record.time_s, pose)))
    return Shown(record, flown, world.board)


def has(image: NDArray[np.uint8], colour: tuple[int, ...]) -> bool:
    """Return whether a colour occurs in an image."""
    return bool((image == np.array(colour, dtype=np.uint8)).all(axis=2).any())


def _truth(time_s: float, pose: types.Pose) -> types.Truth:
    return values.truth(pose, time_s, clearance_m=0.8, landing_error_m=2.0)


def flight_report(outcome: str = "success", reason: str = "landed") -> FlightReport:
    """Return the report of a flight, by default a successful one."""
    return replace(
        values.report(FlightLog(), outcome=outcome, reason=reason),
        scene="train-a",
        seed=3,
        tree="explore_and_land.xml",
        duration_s=114.5,
        explore_distance_m=9.59,
        total_distance_m=12.96,
        time_to_find_mark_s=5.6,
        landing_error_m=0.0235,
        min_clearance_m=0.734,
        coverage_passed=0.612,
        coverage_seen=0.839,
        tick_ms=Percentiles(p50=1.5, p99=10.6, max=20.0),
        perception_ms={"segmentation": Percentiles(p50=0.8, p99=6.7, max=9.0)},
    )
