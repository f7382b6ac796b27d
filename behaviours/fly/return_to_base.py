"""ReturnToBase: search for the helipad, turn to it, fly to it, and stop above it."""

from __future__ import annotations

import enum
import math

from behaviours.fly.heading import HeadingController
from behaviours.fly.steering import FLOWING, POLICY, SteeringLeaf
from behaviours.path.gimbal_pointing import GimbalPointing, shows_unplaced
from behaviours.path.path_to_pad import PathToPad
from uav_bt.board import HELIPAD, OBSTACLES, PHASE
from uav_bt.board.context import MissionContext
from uav_bt.errors import UnknownNameError
from uav_bt.protocols import Decision
from uav_bt.tree import Port, Status
from uav_bt.types import DroneState, GimbalTo, HelipadFix, MissionPhase, Velocity

# The pad counts as out of view after this long without a detection: the paper's 15 frames.
_OUT_OF_VIEW_S = 0.5
# It can only leave view through the image's lower edge this close; further away it was just missed.
_CLOSE_M = 1.6
# Beside or behind, but so near that looking straight down will show it.
_PASSED_M = 0.35
# Above the pad itself the way may be narrower: what stands around it was seen on the approach.
_OVERFLY_MARGIN_M = 0.32
# The track is trusted this long without a detection: going round a box takes a while.
_TRACK_S = 20.0
# Advance while the bearing error is below this; turn on the spot otherwise.
_AHEAD_RAD = math.radians(12)
_APPROACH_MPS = 0.45
_SLOW_DOWN_PER_S = 0.6  # speed per metre of remaining range
# What has an unknown range even seen from above, for so long, is gone round.
_BLOCKED_S = 2.0
# A detour goes on at least so long, then until there is a way again.
_DETOUR_S = 1.0
# An obstacle of unknown range this near to ahead is in the way.
_UNPLACED_RAD = math.radians(30)
# Under a policy what stands this much before the pad is not in the way to it.
_BEFORE_PAD_M = 0.35
_DETOUR_STEPS = 2
_APPROACHES = ("memory", "policy")
# Under a policy: so much less room than the way to the pad needs is an obstacle before it.
_LEAST_FREE_M = 0.3
# So long the pad is turned to without a view that the policy has judged, then the drone waits.
_JUDGED_S = 0.6
# Nearer than about a metre the pad is below the forward view: a search that lasts looks there.
_FIRST_GLANCE_S = 12.0
_NEXT_GLANCE_S = 30.0
_GLANCE_PITCH_RAD = math.radians(-65)
_GLANCE_RATE_RADPS = 0.8


class _Phase(enum.Enum):
    SEARCH = "search"
    GLANCE = "glance"  # once round with the camera tilted down: is the pad right below?
    APPROACH = "approach"
    DETOUR = "detour"
    OVERFLY = "overfly"  # the pad is below the view: the last metre goes by the track


def _room_ahead(decision: Decision) -> float:
    """Return how far a policy finds the way ahead free of obstacles, wherever the carpet ends."""
    if decision.free_m is not None:
        return decision.free_m
    return 0.0 if decision.blocked and not decision.carpet_ends else math.inf


class ReturnToBase(SteeringLeaf):
    """Search for the helipad under a leaf policy and approach it; SUCCESS above it."""

    ports = (
        POLICY,
        FLOWING,
        Port("gimbal_deg", float, default=-30.0, doc="camera pitch while searching, degrees"),
        Port("arrive_m", float, default=0.12, doc="horizontal distance that counts as above, m"),
        Port(
            "approach",
            str,
            default="memory",
            doc="who finds the way to the pad: 'memory' of obstacles, or the 'policy'",
        ),
    )
    reads = (*SteeringLeaf.reads, HELIPAD)

    def on_setup(self, mission: MissionContext) -> None:
        """Make the heading controller."""
        super().on_setup(mission)
        approach = self.port_value("approach")
        if approach not in _APPROACHES:
            raise UnknownNameError("approach", approach, _APPROACHES)
        self._by_policy = approach == "policy"
        self._heading = HeadingController()
        self._path = PathToPad()

    def initialise(self) -> None:
        """Begin with the search; a helipad in view ends it at once."""
        self._enter(_Phase.SEARCH)
        self._detour_steps = 0
        self._pointing = GimbalPointing()
        self._glance_s = self.clock.now() + _FIRST_GLANCE_S

    def update(self) -> Status:
        """Do what the phase asks."""
        state = self.state()
        status = Status.RUNNING
        if state is not None:
            match self._phase:
                case _Phase.SEARCH:
                    self._search(state)
                case _Phase.GLANCE:
                    self._glance(state)
                case _Phase.APPROACH:
                    self._approach()
                case _Phase.DETOUR:
                    self._detour(state)
                case _Phase.OVERFLY:
                    status = self._overfly()
        # A leaf that is done proposes nothing: the next one has the word in this very tick.
        if status is Status.RUNNING:
            self.point(GimbalTo(pitch_rad=self._pitch_rad(state)))
        return status

    def _pitch_rad(self, state: DroneState | None) -> float:
        """Return the camera's pitch for the phase."""
        flight_rad = math.radians(self.port_value("gimbal_deg"))
        if self._phase is _Phase.GLANCE:
            return _GLANCE_PITCH_RAD
        fix = self.read(HELIPAD).value
        nears = self._phase in {_Phase.APPROACH, _Phase.OVERFLY} and not self._by_policy
        if not nears or fix is None or state is None:
            return flight_rad
        return self._pointing.pitch_rad(
            fix,
            self.read(OBSTACLES).value,
            state,
            flight_rad=flight_rad,
            now_s=self.clock.now(),
        )

    def _enter(self, phase: _Phase) -> None:
        self._phase = phase
        self._judged_s, self._room_m = -math.inf, math.inf
        self._entered_s = self._clear_s = self.clock.now()
        self._path.drop()
        self._heading.reset()
        self.look_afresh()
        searching = phase in {_Phase.SEARCH, _Phase.GLANCE}
        self.write(PHASE, MissionPhase.SEARCH if searching else MissionPhase.APPROACH)

    # --- search -----------------------------------------------------------------------------------

    def _search(self, state: DroneState) -> None:
        fix = self.read(HELIPAD)
        if fix.value is not None and fix.value.detected:
            self._enter(_Phase.APPROACH)
            self._approach()
            return
        if self.clock.now() >= self._glance_s and not self._mover.busy:
            self._glance_s = self.clock.now() + _NEXT_GLANCE_S
            self._to_glance_rad = 2.0 * math.pi
            self._glance_yaw_rad = state.attitude.yaw_rad
            self._enter(_Phase.GLANCE)
            return
        self._wander(state)

    def _glance(self, state: DroneState) -> None:
        fix = self.read(HELIPAD).value
        if fix is not None and fix.detected:
            self._enter(_Phase.APPROACH)
            return
        yaw_rad = state.attitude.yaw_rad
        self._to_glance_rad -= math.remainder(yaw_rad - self._glance_yaw_rad, 2.0 * math.pi)
        self._glance_yaw_rad = yaw_rad
        if self._to_glance_rad <= 0.0:
            self._enter(_Phase.SEARCH)
            return
        self.feedback_message = "looks down"
        self.propose(Velocity(yaw_rate_radps=_GLANCE_RATE_RADPS))

    def _wander(self, state: DroneState) -> bool:
        """Advance or turn under the policy; True when an advance began."""
        if self.flow(state) or self.moving(state):
            return False
        decision = self.decide()
        if self.turning:
            if decision is None or decision.blocked or not self.turn_is_complete:
                self.keep_turning(state, decision)
            else:
                self.turn_back(state)  # the turn has worked: look once more, advance
            return False
        if decision is None:
            return False
        if decision.blocked and self.make_room():
            return False
        if decision.blocked:
            self.keep_turning(state, decision)
            return False
        self.move(state, decision)
        return True

    # --- approach ---------------------------------------------------------------------------------

    def _approach(self) -> None:
        fix = self.read(HELIPAD).value
        if fix is None:
            self._enter(_Phase.SEARCH)
            return
        unseen_s = self.clock.now() - fix.captured_s
        ahead = abs(fix.bearing_rad) < _AHEAD_RAD
        if unseen_s > _OUT_OF_VIEW_S and fix.range_m < _CLOSE_M and ahead:
            self._enter(_Phase.OVERFLY)
            return
        if unseen_s > _TRACK_S:
            self._enter(_Phase.SEARCH)
            return
        if self._by_policy:
            self._approach_by_policy(fix)
            return
        heading_rad, now_s = self._free_heading(fix), self.clock.now()
        if not self._is_blocked_ahead():
            self._clear_s = now_s
        if heading_rad is None or now_s - self._clear_s > _BLOCKED_S:
            self._enter(_Phase.DETOUR)
            return
        self._steer(fix, heading_rad)

    def _approach_by_policy(self, fix: HelipadFix) -> None:
        """Turn to the pad and fly straight to it for as long as the policy finds the way free."""
        wanted_m = min(_LEAST_FREE_M, fix.range_m - _BEFORE_PAD_M)
        if abs(fix.bearing_rad) < _AHEAD_RAD:
            decision = self.decide()
            if decision is not None:
                self._judged_s = self.clock.now()
                self._room_m = _room_ahead(decision)
            if self._room_m < wanted_m:
                self._enter(_Phase.DETOUR)
                return
        # A way that was judged lately, facing the pad, and nothing else is flown along.
        judged = self.clock.now() - self._judged_s <= _JUDGED_S
        self._steer(fix, fix.bearing_rad, most_m=self._room_m if judged else 0.0)

    def _steer(self, fix: HelipadFix, heading_rad: float, *, most_m: float = math.inf) -> None:
        yaw_rate = self._heading.update(heading_rad, self.clock.now())
        ahead = abs(heading_rad) < _AHEAD_RAD and not self._is_blocked_ahead()
        speed = min(_APPROACH_MPS, _SLOW_DOWN_PER_S * min(fix.range_m, most_m)) if ahead else 0.0
        self.feedback_message = f"helipad {fix.range_m:.1f} m"
        if speed > 0.0:
            self.propose(Velocity(forward_mps=speed, yaw_rate_radps=yaw_rate))
        else:
            self.propose(self.turn_keeping_away(yaw_rate))

    def _free_heading(self, fix: HelipadFix) -> float | None:
        """Return the bearing of the way to the pad, round what is remembered; None without one."""
        reading = self.read(OBSTACLES)
        obstacles = reading.value
        if obstacles is None:
            # A tree may do without the memory; one that has gone stale is no permission.
            return fix.bearing_rad if math.isinf(reading.age_s) else None
        if self._phase is _Phase.OVERFLY:
            free = obstacles.allows(fix.range_m, margin_m=_OVERFLY_MARGIN_M, assumed=False)
            return fix.bearing_rad if free else None
        state = self.state()
        if state is None:
            return None
        return self._path.bearing(obstacles, fix, state, self.clock.now())

    def _is_blocked_ahead(self) -> bool:
        """Return whether something of unknown range stands ahead."""
        # A policy has judged what it sees; above the pad its own box is what is below the view.
        judged = self._by_policy or self._phase is _Phase.OVERFLY
        return not judged and shows_unplaced(self.read(OBSTACLES).value, _UNPLACED_RAD)

    def _detour(self, state: DroneState) -> None:
        """Turn away until the policy finds a way, take two steps, then face the pad again.

        Or at once when the memory knows a way again: a view of something else may have shown one.
        """
        if self._detour_steps >= _DETOUR_STEPS and not self.moving(state):
            self._detour_steps = 0
            self._enter(_Phase.APPROACH)
        elif self._knows_a_way_again():
            self._enter(_Phase.APPROACH)
        elif self._wander(state):
            self._detour_steps += 1

    def _knows_a_way_again(self) -> bool:
        fix = self.read(HELIPAD).value
        lasts = self.clock.now() - self._entered_s > _DETOUR_S
        if self._by_policy or fix is None or not lasts or self._mover.busy:
            return False
        return self._free_heading(fix) is not None and not self._is_blocked_ahead()

    # --- the last metre ---------------------------------------------------------------------------

    def _overfly(self) -> Status:
        """Fly the rest by the track; the pad's own roof lies below, so nothing is in the way."""
        fix = self.read(HELIPAD).value
        if fix is None:
            self._enter(_Phase.SEARCH)
            return Status.RUNNING
        passed = fix.forward_m < 0.0 and fix.range_m < _PASSED_M
        if fix.range_m < self.port_value("arrive_m") or passed:
            return Status.SUCCESS
        heading_rad = fix.bearing_rad if self._by_policy else self._free_heading(fix)
        if heading_rad is None:
            self._enter(_Phase.DETOUR)
            return Status.RUNNING
        self._steer(fix, heading_rad)
        return Status.RUNNING
