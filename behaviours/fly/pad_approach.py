"""The approach to the helipad: turn to it, fly to it round what stands there, stop above it."""

from __future__ import annotations

import enum
import math
from dataclasses import dataclass

from behaviours.fly.heading_control import HeadingController
from behaviours.fly.steering import SteeringLeaf
from behaviours.fly.tried_sides import TriedSides
from behaviours.fly.wander import wander
from behaviours.path.gimbal_pointing import LookingDown, mark_pitch_rad, shows_unplaced
from behaviours.path.planner import PathToPad
from uav_bt.answers import Advance, Answer, Blocked, Done, FollowLeg, Rotate
from uav_bt.board import HELD_TURN, HELIPAD, OBSTACLES, PHASE
from uav_bt.tree import Status
from uav_bt.types import DroneState, HelipadFix, MissionPhase, Velocity


@dataclass(frozen=True, kw_only=True)
class PadApproachConfig:
    """When the phases of the approach change, and how each is flown."""

    ahead_rad: float = math.radians(12)  # advance below this bearing error, else turn on the spot
    approach_mps: float = 0.45
    slow_down_per_s: float = 0.6  # speed per metre of remaining range
    max_track_s: float = 20.0  # without a detection; flying round a box takes a while
    blocked_s: float = 2.0  # of unknown range even from above for so long: it is flown round
    unplaced_rad: float = math.radians(30)  # from ahead; an obstacle of unknown range there blocks
    # Under a policy.
    before_pad_m: float = 0.35  # what stands so much before the pad's centre is not on the path
    min_free_m: float = (
        0.3  # less free distance, and less than to the pad, is an obstacle before it
    )
    judged_s: float = 0.6  # age up to which the policy's last judgement is flown by
    turn_away_rad: float = math.radians(30)  # at least, at the beginning of a detour
    policy_detour_steps: int = 1  # until the pad is faced again
    # Nearer than this, a pad that is not seen is below the view; further away something hides it,
    # and no obstacle memory would keep the drone from that.
    policy_close_m: float = 1.25
    # Detour.
    detour_steps: int = 2  # until the pad is faced again
    min_detour_s: float = 1.0  # before a path that is known again ends it
    # Overfly.
    out_of_view_s: float = 0.5  # without a detection, as the paper's 15 frames; and
    close_m: float = 1.6  # so near the pad left the view by its lower edge, further away: a miss
    at_pad_m: float = 0.5  # so near, what the view shows stands beside the pad, or behind it
    overfly_margin_m: float = 0.32  # beside the path; what stands there was seen on the approach
    passed_m: float = 0.35  # so near beside or behind, the camera straight down shows the pad


class _Phase(enum.Enum):
    APPROACH = "approach"
    DETOUR = "detour"
    OVERFLY = "overfly"  # the pad is below the view: the last metre goes by the track


def _room_ahead(answer: Answer) -> float:
    """Return how far a policy finds it free of obstacles ahead, wherever the ground ends."""
    match answer:
        case Advance():
            return math.inf if answer.free_m is None else max(answer.free_m, answer.forward_m)
        case Blocked():
            untold_m = math.inf if answer.ground_ends else 0.0
            return untold_m if answer.free_m is None else answer.free_m
        case FollowLeg() | Rotate():  # they do not report how far the way is free
            return math.inf
        case Done():
            return 0.0


class PadApproach:
    """Flies to the pad by its track.

    Args:
        leaf: that moves and sees; it declares `HELIPAD` beside what steering leaves read.
        flight_rad: the camera's pitch when nothing asks for another, negative down.
        arrive_m: horizontal distance that counts as above.
        by_policy: the leaf policy judges the path, in place of the obstacle memory.
        config: how it flies.
    """

    def __init__(
        self,
        leaf: SteeringLeaf,
        *,
        flight_rad: float,
        arrive_m: float,
        by_policy: bool,
        config: PadApproachConfig | None = None,
    ) -> None:
        self._leaf, self._flight_rad, self._arrive_m = leaf, flight_rad, arrive_m
        self._by_policy = by_policy
        self._config = config or PadApproachConfig()
        self._heading = HeadingController()
        self._path = PathToPad()
        self._phase = _Phase.APPROACH
        self._entered_s = self._clear_s = 0.0  # leaf time: the phase began, was last not blocked
        self._judged_s, self._room_m = -math.inf, math.inf  # by the policy, facing the pad
        self._sides = TriedSides()
        self.reset()

    def reset(self) -> None:
        """Forget earlier approaches."""
        self._detour_steps = 0
        self._pointing = LookingDown()
        self._sides.forget()

    def begin(self) -> None:
        """Begin with the approach."""
        self._face_pad()

    def work(self, state: DroneState) -> Status:
        """Do what the phase asks; SUCCESS above the pad, FAILURE when its track is lost."""
        if self._phase is not _Phase.OVERFLY and self._is_at_pad():
            self._enter(_Phase.OVERFLY)
        match self._phase:
            case _Phase.APPROACH:
                return self._approach(state)
            case _Phase.DETOUR:
                self._detour(state)
                return Status.RUNNING
            case _Phase.OVERFLY:
                return self._overfly()

    def pitch_rad(self) -> float:
        """Return the camera's pitch for the phase."""
        fix, state = self._leaf.read(HELIPAD).value, self._leaf.state()
        if self._phase is _Phase.DETOUR or self._by_policy or fix is None or state is None:
            return self._flight_rad
        obstacles, now_s = self._leaf.read(OBSTACLES).value, self._leaf.clock.now()
        height_m = state.height_above_carpet_m
        looks_rad = self._pointing.pitch_rad(obstacles, now_s)
        return looks_rad or mark_pitch_rad(fix.range_m, height_m, self._flight_rad)

    def _is_at_pad(self) -> bool:
        """Return whether it is almost above the pad, with nothing that is remembered in between."""
        fix = self._leaf.read(HELIPAD).value
        if fix is None or self._leaf.busy or fix.range_m > self._config.at_pad_m:
            return False
        return self._is_clear(fix)

    def _is_clear(self, fix: HelipadFix) -> bool:
        """Return whether nothing that was seen to stand is on the straight path to the pad."""
        reading = self._leaf.read(OBSTACLES)
        if reading.value is None:  # a tree may do without the memory; a stale one permits nothing
            return math.isinf(reading.age_s)
        margin_m = self._config.overfly_margin_m
        return reading.value.allows(fix.forward_m, fix.right_m, margin_m=margin_m, assumed=False)

    def _enter(self, phase: _Phase) -> None:
        self._phase = phase
        self._judged_s, self._room_m = -math.inf, math.inf
        self._entered_s = self._clear_s = self._leaf.leaf_clock.now()
        self._path.drop()
        self._heading.reset()
        self._leaf.drop_course()
        self._leaf.write(PHASE, MissionPhase.APPROACH)

    def _face_pad(self) -> None:
        self._enter(_Phase.APPROACH)
        if self._by_policy:
            self._leaf.write(HELD_TURN, self._sides.facing())

    def _approach(self, state: DroneState) -> Status:
        cfg, fix = self._config, self._leaf.read(HELIPAD).value
        if fix is None:
            return Status.FAILURE
        unseen_s = self._leaf.clock.now() - fix.captured_s
        ahead = abs(fix.bearing_rad) < cfg.ahead_rad
        close_m = cfg.policy_close_m if self._by_policy else cfg.close_m
        if unseen_s > cfg.out_of_view_s and fix.range_m < close_m and ahead:
            self._enter(_Phase.OVERFLY)
            return Status.RUNNING
        if unseen_s > cfg.max_track_s:
            return Status.FAILURE
        if self._by_policy:
            self._approach_by_policy(fix, state)
            return Status.RUNNING
        heading_rad, now_s = self._free_heading(fix), self._leaf.leaf_clock.now()
        if not self._is_blocked_ahead():
            self._clear_s = now_s
        if heading_rad is None or now_s - self._clear_s > cfg.blocked_s:
            self._enter(_Phase.DETOUR)
        else:
            self._steer(fix, heading_rad)
        return Status.RUNNING

    def _approach_by_policy(self, fix: HelipadFix, state: DroneState) -> None:
        """Turn to the pad and fly straight to it for as long as the policy finds the path free."""
        cfg, now_s = self._config, self._leaf.clock.now()
        wanted_m = min(cfg.min_free_m, fix.range_m - cfg.before_pad_m)
        if abs(fix.bearing_rad) < cfg.ahead_rad:
            answer = self._leaf.decide()
            if answer is not None:
                self._judged_s = now_s
                self._room_m = _room_ahead(answer)
                if self._room_m < wanted_m:
                    self._turn_away(fix, answer, state)
                    return
        # Only a path that was judged lately, facing the pad, is flown.
        judged = now_s - self._judged_s <= cfg.judged_s
        self._steer(fix, fix.bearing_rad, max_m=self._room_m if judged else 0.0)

    def _turn_away(self, fix: HelipadFix, answer: Answer, state: DroneState) -> None:
        """Begin a detour with a turn to the side that is tried now."""
        to_left = isinstance(answer, Advance | Blocked) and answer.yaw_rad < 0.0
        self._sides.stopped(fix.range_m, -1 if to_left else 1)
        self._enter(_Phase.DETOUR)
        self._leaf.write(HELD_TURN, self._sides.leaving())
        self._leaf.keep_turning(state, self._config.turn_away_rad)

    def _steer(self, fix: HelipadFix, heading_rad: float, *, max_m: float = math.inf) -> None:
        cfg, leaf = self._config, self._leaf
        yaw_rate = self._heading.update(heading_rad, leaf.clock.now())
        ahead = abs(heading_rad) < cfg.ahead_rad and not self._is_blocked_ahead()
        speed = min(cfg.approach_mps, cfg.slow_down_per_s * min(fix.range_m, max_m))
        leaf.feedback_message = f"helipad {fix.range_m:.1f} m"
        if ahead and speed > 0.0:
            leaf.propose(Velocity(forward_mps=speed, yaw_rate_radps=yaw_rate))
        else:
            leaf.propose(leaf.turn_keeping_away(yaw_rate))

    def _free_heading(self, fix: HelipadFix) -> float | None:
        """Return the bearing of the path to the pad round what is remembered; None without one."""
        if self._phase is _Phase.OVERFLY:
            return fix.bearing_rad if self._is_clear(fix) else None
        reading = self._leaf.read(OBSTACLES)
        obstacles = reading.value
        if obstacles is None:
            return fix.bearing_rad if math.isinf(reading.age_s) else None
        state, now_s = self._leaf.state(), self._leaf.clock.now()
        return None if state is None else self._path.bearing(obstacles, fix, state, now_s)

    def _is_blocked_ahead(self) -> bool:
        """Return whether something of unknown range stands ahead."""
        # A policy has judged the view; above the pad its own box is what is below the view.
        judged = self._by_policy or self._phase is _Phase.OVERFLY
        obstacles = self._leaf.read(OBSTACLES).value
        return not judged and shows_unplaced(obstacles, self._config.unplaced_rad)

    def _detour(self, state: DroneState) -> None:
        """Turn away until the policy finds a path, take a step or two, then face the pad again.

        Or at once when the memory gives a path again, which the views of the detour may have shown.
        """
        cfg = self._config
        steps = cfg.policy_detour_steps if self._by_policy else cfg.detour_steps
        if self._detour_steps >= steps and not self._leaf.moving(state):
            self._detour_steps = 0
            self._face_pad()
        elif self._path_is_known_again():
            self._enter(_Phase.APPROACH)
        elif wander(self._leaf, state):
            self._detour_steps += 1

    def _path_is_known_again(self) -> bool:
        fix = self._leaf.read(HELIPAD).value
        lasts = self._leaf.leaf_clock.now() - self._entered_s > self._config.min_detour_s
        if self._by_policy or fix is None or not lasts or self._leaf.busy:
            return False
        return self._free_heading(fix) is not None and not self._is_blocked_ahead()

    def _overfly(self) -> Status:
        """Fly the rest by the track: no obstacle stands between here and the pad's top."""
        fix = self._leaf.read(HELIPAD).value
        if fix is None:
            return Status.FAILURE
        passed = fix.forward_m < 0.0 and fix.range_m < self._config.passed_m
        if fix.range_m < self._arrive_m or passed:
            return Status.SUCCESS
        heading_rad = fix.bearing_rad if self._by_policy else self._free_heading(fix)
        if heading_rad is None:
            self._enter(_Phase.DETOUR)
        else:
            self._steer(fix, heading_rad)
        return Status.RUNNING
