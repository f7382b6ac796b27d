"""MoveBy: a straight movement over ground that the map shows free."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, Final

import numpy as np

from behaviours.fly.moving_leaf import Progress
from behaviours.fly.places import BELOW_RAD, PlaceLeaf
from behaviours.path.clearance import ClearanceMap
from behaviours.path.margins import Margins
from behaviours.path.nearby import recent_obstacles
from behaviours.ports import number
from uav_bt.board import PHASE
from uav_bt.board.blackboard import Key
from uav_bt.board.context import MissionContext
from uav_bt.tree import Status
from uav_bt.types import DroneState, MissionPhase

# The numbers were chosen.
_NEAR_M: Final = 0.02  # a movement along the ground that is shorter needs no map
# The camera is tilted down in a second, and shown to both sides in a swing of 0.64 rad: without it,
# cells right beside the drone stay out of view.
_TILT_S: Final = 1.0
_SWING_S: Final = 4.0
_SHIFTS_M: Final = 0.1  # under way, unseen cells may be nearer by this: the map shifts a little
_UNSEEN: Final = (
    "the ground there or beside it was not seen: turn to it before (Turn, Face), or lower the "
    "camera (gimbal_deg of TakeOff)"
)


class MoveBy(PlaceLeaf):
    """Move in a straight line without turning; SUCCESS at its end.

    FAILURE when the map does not show the line free, at the beginning or later, and after repeated
    attempts without progress. Where the ground ahead was not seen, the drone first looks down. A
    movement straight up or down needs no map. An override interrupts the movement, and it goes on
    afterwards.
    """

    repeats = True
    ports = (
        number("forward_m", 0.0, -5, 5, "distance ahead, m"),
        number("right_m", 0.0, -5, 5, "distance to the right, m"),
        number("up_m", 0.0, -5, 5, "distance upwards, m"),
    )
    resumes = True

    def on_setup(self, mission: MissionContext) -> None:
        """Note the margins of the place."""
        super().on_setup(mission)
        margins = Margins().within(mission.clearances).tight()
        self._margins = margins
        self._under_way = replace(margins, unknown_m=margins.unknown_m - _SHIFTS_M)

    def needs(self) -> tuple[Key[Any], ...]:
        """Return the map; a movement straight up or down needs none."""
        level = [self.initial_value(port) for port in self.ports[:2]]
        return () if level == [0.0, 0.0] else self.needed

    def initialise(self) -> None:
        """Begin with the movement."""
        super().initialise()
        self.write(PHASE, MissionPhase.GO_TO)
        self._to: tuple[float, float] | None = None  # x and y of its end on the map, m
        self._begun = False
        self._checked_s = -math.inf  # capture time of the map on which the line was checked
        self._obstruction = ""  # why it is not free; empty: it is
        self._looks_s = 0.0  # when it began to look down, and its heading then; None: it has not
        self._looked_rad: float | None = None

    def work(self, state: DroneState) -> Status:
        """Move while the line is free."""
        forward_m, right_m = self.port_value("forward_m"), self.port_value("right_m")
        site_map = self.trusted_map()
        if math.hypot(forward_m, right_m) > _NEAR_M:
            if site_map is None:
                return self.fails("no map shows whether the way is free")
            self._to = self._to or site_map.pose.to_world(forward_m, right_m)
            if site_map.captured_s != self._checked_s:
                self._checked_s = site_map.captured_s
                recent = recent_obstacles(self.obstacles(), site_map)
                margins = self._under_way if self._begun else self._margins
                clearance = ClearanceMap(site_map, recent, margins)
                is_open = clearance.is_open_to(*self._to)
                self._obstruction = "" if is_open else _obstruction(clearance, self._to)
            if self._obstruction:
                ahead = self._obstruction == _UNSEEN and forward_m > abs(right_m)
                return self._look(state) if ahead and not self._begun else self._blocked()
        if not self._begun:
            self._begun, down_m, back_rad = True, -self.port_value("up_m"), 0.0
            if self._looked_rad is not None and self._to is not None and site_map is not None:
                forward_m, right_m = site_map.pose.to_body(*self._to)
                back_rad = math.remainder(self._looked_rad - state.attitude.yaw_rad, math.tau)
            self.start_move(forward_m=forward_m, right_m=right_m, down_m=down_m, yaw_rad=back_rad)
        elif not self.moving(state):
            if self.progress is Progress.DONE:
                return Status.SUCCESS
            return self.fails(self.trouble or "a person has flown the drone")
        return Status.RUNNING

    def _look(self, state: DroneState) -> Status:
        """Look down to both sides of the way and back, once; then fail."""
        now_s = self.leaf_clock.now()
        if self._looked_rad is None:
            self._looks_s, self._looked_rad = now_s, state.attitude.yaw_rad
        swings_s = now_s - self._looks_s - _TILT_S
        if swings_s > _SWING_S:
            return self._blocked()
        self.feedback_message = "looks down"
        rate_radps = math.cos(math.tau * swings_s / _SWING_S) if swings_s > 0.0 else 0.0
        self.propose(self.turn_keeping_away(rate_radps))
        return Status.RUNNING

    def _blocked(self) -> Status:
        return self.fails(f"the map does not show the way free: {self._obstruction}")

    def gimbal_pitch_rad(self) -> float | None:
        """Return the camera's pitch in flight, or a lower one to see the ground ahead."""
        looks = self._looked_rad is not None and not self._begun
        return BELOW_RAD if looks else super().gimbal_pitch_rad()


def _obstruction(clearance: ClearanceMap, to_m: tuple[float, float]) -> str:
    """Return why a straight line to a place of the map is not free."""
    found, margins = clearance.map, clearance.margins
    line_m = np.linspace((found.pose.x_m, found.pose.y_m), to_m, 20)[:, None]
    obstacles = "an obstacle", found.obstacles_m, margins.touch_m
    edges = "the edge of the ground", found.edges_m, margins.edge_m
    for what, points_m, needed_m in (obstacles, edges):
        apart_m = float(np.linalg.norm(points_m - line_m, axis=-1).min(initial=math.inf))
        if apart_m < needed_m:
            return f"{what} is {apart_m:.2f} m from it, {needed_m:.2f} m are needed"
    return _UNSEEN
