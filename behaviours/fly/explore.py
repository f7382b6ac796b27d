"""Explore and Avoid, which advance and turn under a policy, and conditions that end them."""

from __future__ import annotations

import math
from collections import deque
from typing import Final

import numpy as np

from behaviours.fly.moving_leaf import LeafClock
from behaviours.fly.steering import FLOWING, GIVES_WAY, SteeringLeaf
from behaviours.policies.corridor_rule import ground_reach
from behaviours.policies.view import VIEW_KEYS, current_view, policy_view
from behaviours.ports import number
from uav_bt.answers import Advance, Blocked, Done
from uav_bt.board import CORRIDOR, MARK, PHASE, SITE_MAP
from uav_bt.board.context import MissionContext
from uav_bt.tree import Leaf, Status
from uav_bt.types import DroneState, HeldTurn, MissionPhase

_PAD_AHEAD_RAD: Final = math.radians(20)  # largest bearing of a pad that the ground extends to
_PAD_BELOW_M: Final = 0.5  # a pad nearer than this is below the view, whatever its bearing
_SAME_S: Final = 1e-6  # times that differ by less are equal


class Explore(SteeringLeaf):
    """Advance under a leaf policy; FAILURE when the path is blocked (Avoid's turn).

    SUCCESS when the policy finds nothing left to explore.
    """

    ports = (*SteeringLeaf.ports, FLOWING, GIVES_WAY)

    def initialise(self) -> None:
        """Write the mission's phase; only views captured from now on count."""
        self.write(PHASE, MissionPhase.EXPLORE)
        self.drop_course()

    def work(self, state: DroneState) -> Status:
        """Continue the step in progress, or begin the next if the policy finds the path free."""
        if self.gives_way() or self.flow(state) or self.moving(state):
            return Status.RUNNING
        answer = self.decide()
        if isinstance(answer, Blocked | Done):
            return Status.SUCCESS if isinstance(answer, Done) else Status.FAILURE
        self.go_on(state, answer)
        return Status.RUNNING


class Avoid(SteeringLeaf):
    """Turn away until the policy finds the path free; SUCCESS at once if it is free already.

    Also SUCCESS when the policy answers `Done`.
    """

    answers = (Status.SUCCESS, Status.RUNNING)
    ports = (*SteeringLeaf.ports, GIVES_WAY)

    def initialise(self) -> None:
        """Drop the last turn."""
        self.drop_course()

    def work(self, state: DroneState) -> Status:
        """Turn until the policy finds the path free."""
        if self.gives_way() or self.moving(state):
            return Status.RUNNING
        answer = self.decide()
        if isinstance(answer, Done):
            return Status.SUCCESS
        if answer is not None and not isinstance(answer, Blocked) and self.turn_left_rad <= 0.0:
            # Legs and rotations state a heading, so the drone need not face it first.
            if not self.turning or not isinstance(answer, Advance):
                return Status.SUCCESS
            self.turn_back(state)
        # A turn takes seconds, in which the drone drifts: first step away from a near obstacle.
        elif answer is None or not self.make_room():
            self.keep_turning(state, answer.yaw_rad if isinstance(answer, Blocked) else None)
        return Status.RUNNING


class CorridorClear(Leaf):
    """SUCCESS while there is room ahead, between obstacles and on the ground; FAILURE otherwise.

    FAILURE on an unknown or stale corridor. The defaults require less room than the rule
    `corridor`: this condition succeeds wherever that rule advances, so the two cannot alternate
    forever.
    """

    condition = True
    ports = (
        number("ahead_m", 0.8, 0, 50, "room ahead of the body's centre, m"),
        number("impact_s", 1.2, 0, 60, "least time to impact at the present speed, s"),
        # Shorter than the shortest step.
        number("way_m", 0.3, 0, 20, "path that must keep clear of remembered obstacles, m"),
        number("beside_m", 0.42, 0, 20, "room to them along that path, m"),
        number("ground_m", 0.6, 0, 50, "ground ahead, m; not needed where the pad lies ahead"),
    )
    reads = (*VIEW_KEYS, MARK)
    _ground_ends = False  # in the newest view with a class map

    def update(self) -> Status:
        """Compare the corridor, the obstacles of the map and the ground with the ports."""
        self.feedback_message = self._objection()
        return Status.FAILURE if self.feedback_message else Status.SUCCESS

    def _objection(self) -> str:
        corridor, site_map = self.read(CORRIDOR).value, self.read(SITE_MAP).value
        if corridor is None:
            return "corridor unknown"
        if corridor.free_distance_m < self.port_value("ahead_m"):
            return f"{corridor.free_distance_m:.2f} m ahead"
        if corridor.time_to_impact_s < self.port_value("impact_s"):
            return f"impact in {corridor.time_to_impact_s:.1f} s"
        if site_map is not None and not site_map.near.allows(
            self.port_value("way_m"), margin_m=self.port_value("beside_m"), assumed=False
        ):
            return f"obstacle {site_map.near.nearest_m:.2f} m away"
        seen, pad = current_view(self), self.read(MARK).value
        if seen is not None:
            view = policy_view(self, seen, held=HeldTurn(), tie_break=0.5)
            reach_m = ground_reach(view.class_map.roles, view) + view.camera.forward_offset_m
            self._ground_ends = reach_m < self.port_value("ground_m")
        if pad is not None and (
            abs(pad.bearing_rad) < _PAD_AHEAD_RAD or pad.range_m < _PAD_BELOW_M
        ):
            return ""  # the pad stands on ground
        return "ground ends" if self._ground_ends else ""


class CoverageGrows(Leaf):
    """SUCCESS while the path covers new ground of the site map; FAILURE when it hardly does.

    Covered ground lies within half a metre of the flown path. The window restarts after a pause of
    the leaf. Without a map, and before the first window has passed, the answer is SUCCESS.
    """

    condition = True
    ports = (
        number("min_share", 0.01, 0, 1, "new share of the known ground in a window; 0: none"),
        number("window_s", 30.0, 1, 3600, "length of the window, s"),
    )
    reads = (SITE_MAP,)

    def on_setup(self, mission: MissionContext) -> None:
        """Start without a history."""
        self._clock = LeafClock(mission.clock)
        self._history: deque[tuple[float, int]] = deque()  # time, s; covered cells
        self._restarts = 0  # of the map whose cells these are

    def update(self) -> Status:
        """Compare the covered share with that of one window ago."""
        if self._clock.tick() > 0:
            self._history.clear()
        site_map, now_s, history = self.read(SITE_MAP).value, self._clock.now(), self._history
        if site_map is None:
            return Status.SUCCESS
        if site_map.restarts != self._restarts:
            self._restarts = site_map.restarts
            history.clear()
        history.append((now_s, int(np.count_nonzero(site_map.ground & site_map.passed))))
        window_s = self.port_value("window_s")
        while len(history) > 1 and history[1][0] <= now_s - window_s + _SAME_S:
            history.popleft()
        since_s, before = history[0]
        if now_s - since_s < window_s - _SAME_S:
            return Status.SUCCESS
        gained = (history[-1][1] - before) / max(int(np.count_nonzero(site_map.ground)), 1)
        self.feedback_message = f"{100 * gained:.1f} % in {now_s - since_s:.0f} s"
        least = self.port_value("min_share")
        return Status.SUCCESS if least == 0 or gained >= least else Status.FAILURE
