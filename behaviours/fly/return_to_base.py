"""ReturnToBase: search for the helipad, turn to it, fly to it, and stop above it."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass
from typing import ClassVar

from behaviours.fly.heading import HeadingController
from behaviours.fly.steering import FLOWING, POLICY, SteeringLeaf
from behaviours.path.gimbal_pointing import GimbalPointing, shows_unplaced
from behaviours.path.planner import PathToPad
from uav_bt.board import HELIPAD, OBSTACLES, PHASE
from uav_bt.board.context import MissionContext
from uav_bt.errors import UnknownNameError
from uav_bt.protocols import Decision
from uav_bt.tree import Port, Status
from uav_bt.types import DroneState, HelipadFix, MissionPhase, Velocity

_APPROACHES = ("memory", "policy")


@dataclass(frozen=True, kw_only=True)
class ReturnConfig:
    """When the phases of the return change, and how each is flown."""

    # Search. Nearer than about a metre the pad is below the forward view, so a search that lasts
    # scans the floor below: once round with the camera tilted down.
    first_scan_s: float = 12.0  # after the search began
    next_scan_s: float = 30.0  # after the last scan
    scan_pitch_rad: float = math.radians(-65)
    scan_rate_radps: float = 0.8
    # Approach.
    ahead_rad: float = math.radians(12)  # advance below this bearing error, else turn on the spot
    approach_mps: float = 0.45
    slow_down_per_s: float = 0.6  # speed per metre of remaining range
    max_track_s: float = 20.0  # without a detection; flying round a box takes a while
    blocked_s: float = 2.0  # of unknown range even from above for so long: it is flown round
    unplaced_rad: float = math.radians(30)  # from ahead; an obstacle of unknown range there blocks
    # Approach under a policy.
    before_pad_m: float = 0.35  # what stands so much before the pad's centre is not on the path
    min_free_m: float = (
        0.3  # less free distance, and less than to the pad, is an obstacle before it
    )
    judged_s: float = 0.6  # age up to which the policy's last judgement is flown by
    # Detour.
    detour_steps: int = 2  # until the pad is faced again
    min_detour_s: float = 1.0  # before a path that is known again ends it
    # Overfly.
    out_of_view_s: float = 0.5  # without a detection, as the paper's 15 frames; and
    close_m: float = 1.6  # so near the pad left the view by its lower edge, further away: a miss
    overfly_margin_m: float = 0.32  # beside the path; what stands there was seen on the approach
    passed_m: float = 0.35  # so near beside or behind, the camera straight down shows the pad


class _Phase(enum.Enum):
    SEARCH = "search"
    SCAN = "scan"  # the floor below
    APPROACH = "approach"
    DETOUR = "detour"
    OVERFLY = "overfly"  # the pad is below the view: the last metre goes by the track


def _room_ahead(decision: Decision) -> float:
    """Return how far a policy finds it free of obstacles ahead, wherever the carpet ends."""
    if decision.free_m is not None:
        return decision.free_m
    return 0.0 if decision.blocked and not decision.carpet_ends else math.inf


class ReturnToBase(SteeringLeaf):
    """Search for the helipad under a leaf policy and approach it; SUCCESS above it."""

    config: ClassVar[ReturnConfig] = ReturnConfig()
    ports = (
        POLICY,
        FLOWING,
        Port(
            "gimbal_deg",
            float,
            default=-30.0,
            least=-90,
            most=90,
            doc="camera pitch while searching, degrees",
        ),
        Port(
            "arrive_m",
            float,
            default=0.12,
            least=0.01,
            most=2,
            doc="horizontal distance that counts as above, m",
        ),
        Port(
            "approach",
            str,
            default="memory",
            doc="what finds the path to the pad: 'memory' of obstacles, or the 'policy'",
        ),
    )
    reads = (*SteeringLeaf.reads, HELIPAD)

    def on_setup(self, mission: MissionContext) -> None:
        """Make the heading controller and the planner.

        Raises:
            UnknownNameError: no policy or no approach has that name.
        """
        super().on_setup(mission)
        approach = self.port_value("approach")
        if approach not in _APPROACHES:
            raise UnknownNameError("approach", approach, _APPROACHES)
        self._by_policy = approach == "policy"
        self._heading = HeadingController()
        self._path = PathToPad()
        self._phase = _Phase.SEARCH
        self._entered_s = self._clear_s = 0.0  # leaf time: the phase began, was last not blocked
        self._judged_s, self._room_m = -math.inf, math.inf  # by the policy, facing the pad
        self._to_scan_rad = self._scan_yaw_rad = 0.0

    def initialise(self) -> None:
        """Begin with the search; a helipad in view ends it at once."""
        self._enter(_Phase.SEARCH)
        self._detour_steps = 0
        self._pointing = GimbalPointing()
        self._next_scan_s = self.leaf_clock.now() + self.config.first_scan_s

    def work(self, state: DroneState) -> Status:
        """Do what the phase asks."""
        match self._phase:
            case _Phase.SEARCH:
                self._search(state)
            case _Phase.SCAN:
                self._scan(state)
            case _Phase.APPROACH:
                self._approach()
            case _Phase.DETOUR:
                self._detour(state)
            case _Phase.OVERFLY:
                return self._overfly()
        return Status.RUNNING

    def gimbal_pitch_rad(self) -> float:
        """Return the camera's pitch for the phase."""
        if self._phase is _Phase.SCAN:
            return self.config.scan_pitch_rad
        flight_rad = math.radians(self.port_value("gimbal_deg"))
        fix, state = self.read(HELIPAD).value, self.state()
        nears = self._phase in {_Phase.APPROACH, _Phase.OVERFLY} and not self._by_policy
        if not nears or fix is None or state is None:
            return flight_rad
        obstacles, now_s = self.read(OBSTACLES).value, self.clock.now()
        return self._pointing.pitch_rad(fix, obstacles, state, flight_rad=flight_rad, now_s=now_s)

    def _enter(self, phase: _Phase) -> None:
        self._phase = phase
        self._judged_s, self._room_m = -math.inf, math.inf
        self._entered_s = self._clear_s = self.leaf_clock.now()
        self._path.drop()
        self._heading.reset()
        self.restart_view()
        searching = phase in {_Phase.SEARCH, _Phase.SCAN}
        self.write(PHASE, MissionPhase.SEARCH if searching else MissionPhase.APPROACH)

    def _search(self, state: DroneState) -> None:
        fix = self.read(HELIPAD)
        if fix.value is not None and fix.value.detected:
            self._enter(_Phase.APPROACH)
            self._approach()
            return
        if self.leaf_clock.now() >= self._next_scan_s and not self._mover.busy:
            self._next_scan_s = self.leaf_clock.now() + self.config.next_scan_s
            self._to_scan_rad = 2.0 * math.pi
            self._scan_yaw_rad = state.attitude.yaw_rad
            self._enter(_Phase.SCAN)
            return
        self._wander(state)

    def _scan(self, state: DroneState) -> None:
        fix = self.read(HELIPAD).value
        if fix is not None and fix.detected:
            self._enter(_Phase.APPROACH)
            return
        yaw_rad = state.attitude.yaw_rad
        self._to_scan_rad -= math.remainder(yaw_rad - self._scan_yaw_rad, 2.0 * math.pi)
        self._scan_yaw_rad = yaw_rad
        if self._to_scan_rad <= 0.0:
            self._enter(_Phase.SEARCH)
            return
        self.feedback_message = "looks down"
        self.propose(Velocity(yaw_rate_radps=self.config.scan_rate_radps))

    def _wander(self, state: DroneState) -> bool:
        """Advance or turn under the policy; True when an advance began."""
        if self.flow(state) or self.moving(state):
            return False
        decision = self.decide()
        free = decision is not None and not decision.blocked
        if decision is not None and free and not self.turning:
            self.move(state, decision)
            return True
        if free and self.turn_is_complete:
            self.turn_back(state)  # judge the view once more, then advance
        elif self.turning or (decision is not None and not self.make_room()):
            self.keep_turning(state, decision)
        return False

    def _approach(self) -> None:
        cfg, fix = self.config, self.read(HELIPAD).value
        if fix is None:
            self._enter(_Phase.SEARCH)
            return
        unseen_s = self.clock.now() - fix.captured_s
        ahead = abs(fix.bearing_rad) < cfg.ahead_rad
        if unseen_s > cfg.out_of_view_s and fix.range_m < cfg.close_m and ahead:
            self._enter(_Phase.OVERFLY)
            return
        if unseen_s > cfg.max_track_s:
            self._enter(_Phase.SEARCH)
            return
        if self._by_policy:
            self._approach_by_policy(fix)
            return
        heading_rad, now_s = self._free_heading(fix), self.leaf_clock.now()
        if not self._is_blocked_ahead():
            self._clear_s = now_s
        if heading_rad is None or now_s - self._clear_s > cfg.blocked_s:
            self._enter(_Phase.DETOUR)
            return
        self._steer(fix, heading_rad)

    def _approach_by_policy(self, fix: HelipadFix) -> None:
        """Turn to the pad and fly straight to it for as long as the policy finds the path free."""
        cfg = self.config
        wanted_m = min(cfg.min_free_m, fix.range_m - cfg.before_pad_m)
        if abs(fix.bearing_rad) < cfg.ahead_rad:
            decision = self.decide()
            if decision is not None:
                self._judged_s = self.clock.now()
                self._room_m = _room_ahead(decision)
            if self._room_m < wanted_m:
                self._enter(_Phase.DETOUR)
                return
        # Only a path that was judged lately, facing the pad, is flown.
        judged = self.clock.now() - self._judged_s <= cfg.judged_s
        self._steer(fix, fix.bearing_rad, max_m=self._room_m if judged else 0.0)

    def _steer(self, fix: HelipadFix, heading_rad: float, *, max_m: float = math.inf) -> None:
        cfg = self.config
        yaw_rate = self._heading.update(heading_rad, self.clock.now())
        ahead = abs(heading_rad) < cfg.ahead_rad and not self._is_blocked_ahead()
        speed = min(cfg.approach_mps, cfg.slow_down_per_s * min(fix.range_m, max_m))
        self.feedback_message = f"helipad {fix.range_m:.1f} m"
        if ahead and speed > 0.0:
            self.propose(Velocity(forward_mps=speed, yaw_rate_radps=yaw_rate))
        else:
            self.propose(self.turn_keeping_away(yaw_rate))

    def _free_heading(self, fix: HelipadFix) -> float | None:
        """Return the bearing of the path to the pad round what is remembered; None without one."""
        reading = self.read(OBSTACLES)
        obstacles = reading.value
        if obstacles is None:
            # A tree may do without the memory, but a stale one permits nothing.
            return fix.bearing_rad if math.isinf(reading.age_s) else None
        if self._phase is _Phase.OVERFLY:
            margin_m = self.config.overfly_margin_m
            free = obstacles.allows(fix.range_m, margin_m=margin_m, assumed=False)
            return fix.bearing_rad if free else None
        state, now_s = self.state(), self.clock.now()
        return None if state is None else self._path.bearing(obstacles, fix, state, now_s)

    def _is_blocked_ahead(self) -> bool:
        """Return whether something of unknown range stands ahead."""
        # A policy has judged the view; above the pad its own box is what is below the view.
        judged = self._by_policy or self._phase is _Phase.OVERFLY
        return not judged and shows_unplaced(self.read(OBSTACLES).value, self.config.unplaced_rad)

    def _detour(self, state: DroneState) -> None:
        """Turn away until the policy finds a path, take two steps, then face the pad again.

        Or at once when the memory gives a path again, which the views of the detour may have shown.
        """
        if self._detour_steps >= self.config.detour_steps and not self.moving(state):
            self._detour_steps = 0
            self._enter(_Phase.APPROACH)
        elif self._path_is_known_again():
            self._enter(_Phase.APPROACH)
        elif self._wander(state):
            self._detour_steps += 1

    def _path_is_known_again(self) -> bool:
        fix = self.read(HELIPAD).value
        lasts = self.leaf_clock.now() - self._entered_s > self.config.min_detour_s
        if self._by_policy or fix is None or not lasts or self._mover.busy:
            return False
        return self._free_heading(fix) is not None and not self._is_blocked_ahead()

    def _overfly(self) -> Status:
        """Fly the rest by the track: no obstacle stands between here and the pad's top."""
        fix = self.read(HELIPAD).value
        if fix is None:
            self._enter(_Phase.SEARCH)
            return Status.RUNNING
        passed = fix.forward_m < 0.0 and fix.range_m < self.config.passed_m
        if fix.range_m < self.port_value("arrive_m") or passed:
            return Status.SUCCESS
        heading_rad = fix.bearing_rad if self._by_policy else self._free_heading(fix)
        if heading_rad is None:
            self._enter(_Phase.DETOUR)
        else:
            self._steer(fix, heading_rad)
        return Status.RUNNING
