"""Base of the leaves that fly courses (a heading and a speed, held between answers); GiveWay."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, ClassVar, Final

from behaviours.fly.heading_control import HeadingController
from behaviours.fly.keeping_away import MARGINS, GivingWay, by_the_map, push_away_mps
from behaviours.fly.moving_leaf import MovingLeaf
from behaviours.path.gimbal_pointing import ground_pitch_rad, mover_pitch_rad
from behaviours.path.movers import raised_m
from behaviours.ports import number
from uav_bt.answers import FollowLeg, Rotate
from uav_bt.board import CAMERA, FLIGHT_HEIGHT, HELD_TURN, ODOMETRY, PHASE, RAISED, SITE_MAP, STATE
from uav_bt.board.blackboard import Key
from uav_bt.board.context import MissionContext
from uav_bt.tree import Port, Status
from uav_bt.types import DroneState, HeldTurn, NearObstacles, Velocity, clamp
from uav_bt.types.flight_results import EventKind
from uav_bt.types.site_map import SiteMap

Keys = tuple[Key[Any], ...]
GIMBAL = number("gimbal_deg", -30.0, -90, 90, "camera pitch in flight, degrees")

# The numbers were chosen in flights on the training scenes.
_LASTS_S: Final = 0.5  # a course ends after this time without a new answer
_CLIMB_PER_S: Final = 0.8  # climb rate per metre of error in height
_CLIMB_MPS: Final = 0.25  # highest climb rate
_GIVES_WAY_PER_S: Final = 2.0  # the same while the drone gives way
_GIVES_WAY_MPS: Final = 0.5
_SLOWER_TIMES: Final = 10.0  # in a gap: a push of 0.1 m/s halves the speed
_AGAIN_S: Final = 10.0  # the drone gives way anew, for events, after this time without; chosen
_EVADED_M: Final = 0.2  # a turn corrects only larger errors in height: those of giving way


class CourseLeaf(MovingLeaf):
    """Base of the leaves that fly at a speed and keep away from obstacles."""

    reads: ClassVar[Keys] = (STATE, FLIGHT_HEIGHT, RAISED, CAMERA, ODOMETRY, SITE_MAP)
    writes: ClassVar[Keys] = (PHASE, HELD_TURN, RAISED)
    resumes = False  # after an interruption the leaf decides anew, on a new view

    in_gap = False  # whether its way may lead through gaps little wider than the hull

    def on_setup(self, mission: MissionContext) -> None:
        """Begin without a course."""
        # Imported here, because Numba takes 0.2 s and `uav-bt check` must answer at once.
        import behaviours.path.compiled_loops  # noqa: F401, PLC0415

        super().on_setup(mission)
        self._heading = HeadingController()
        self._ordered: tuple[float, float, float] | None = None  # yaw, rad; speed, m/s; time, s
        self._gave_way_s = -math.inf
        self._giving_way = GivingWay(MARGINS.within(mission.clearances), mission.airframe.radius_m)

    def fly_on(self, state: DroneState, answer: FollowLeg | Rotate | None) -> None:
        """Fly ahead while the heading is controlled; the last answer counts for a while."""
        yaw_rad, now_s = state.attitude.yaw_rad, self.clock.now()
        if answer is not None:
            speed_mps = answer.speed_mps if isinstance(answer, FollowLeg) else 0.0
            if speed_mps > 0.0:
                self.write(HELD_TURN, HeldTurn())
            self._ordered = yaw_rad + answer.yaw_rad, speed_mps, now_s
        if self._ordered is None or now_s - self._ordered[2] > _LASTS_S:
            self._ordered = None
            return
        to_rad, speed_mps, _ = self._ordered
        error_rad = math.remainder(to_rad - yaw_rad, 2.0 * math.pi)
        yaw_rate_radps = self._heading.update(error_rad, now_s)
        velocity = self.turn_keeping_away(yaw_rate_radps)
        if speed_mps != 0.0:
            if self.in_gap:
                speed_mps /= 1.0 + _SLOWER_TIMES * abs(velocity.right_mps)
            # Only the sideways push is used: a push along the route would change the speed.
            velocity = replace(velocity, forward_mps=speed_mps, down_mps=self._height_mps(state))
        self.propose(velocity)

    def turn_keeping_away(self, yaw_rate_radps: float) -> Velocity:
        """Return a turn that moves away from what is too near, because a hovering drone drifts."""
        placed = None if self.read(ODOMETRY).value is None else self.read(SITE_MAP).value
        near = by_the_map(self.obstacles(), placed, in_gap=self.in_gap)
        forward_mps, right_mps = push_away_mps(near, in_gap=self.in_gap)
        state = self.state()
        evaded = state is not None and abs(self.off_height_m(state)) > _EVADED_M
        return Velocity(
            forward_mps=forward_mps,
            right_mps=right_mps,
            down_mps=self._height_mps(state) if state is not None and evaded else 0.0,
            yaw_rate_radps=yaw_rate_radps,
        )

    def _height_mps(self, state: DroneState) -> float:
        """Return the vertical speed to the height that the drone keeps, positive down."""
        return clamp(_CLIMB_PER_S * self.off_height_m(state), _CLIMB_MPS)

    def give_way(self) -> bool:
        """Stop for a mover or get out of its way, and climb; False when none comes too near."""
        site_map, state = self.read(SITE_MAP).value, self.state()
        self.write(RAISED, raised_m(site_map))
        motion, now_s = self.read(ODOMETRY).value, self.clock.now()
        velocity = self._giving_way.velocity(site_map, self.obstacles(), motion, now_s=now_s)
        if velocity is None:
            return False
        self.drop_course()
        self._note_giving_way(site_map, now_s)
        off_m = 0.0 if state is None else self.off_height_m(state)
        self.propose(replace(velocity, down_mps=clamp(_GIVES_WAY_PER_S * off_m, _GIVES_WAY_MPS)))
        return True

    def _note_giving_way(self, site_map: SiteMap | None, now_s: float) -> None:
        """Add an event when the leaf begins to give way."""
        self.feedback_message = "gives way"
        if now_s - self._gave_way_s > _AGAIN_S and site_map is not None and site_map.movers:
            to_m = min(math.hypot(*site_map.pose.to_body(it.x_m, it.y_m)) for it in site_map.movers)
            text = f"gives way to a mover {to_m:.1f} m away"
            self.mission.add_event(EventKind.INFO, text, self.path)
        self._gave_way_s = now_s

    def drop_course(self) -> None:
        """Drop movement and course."""
        self._step.drop(self.clock.now())
        self._ordered = None
        self._heading.reset()

    def obstacles(self) -> NearObstacles | None:
        """Return the obstacles near the drone, mapped or not; None without a map."""
        site_map = self.read(SITE_MAP).value
        return None if site_map is None else site_map.near

    def too_high_m(self, state: DroneState) -> float:
        """Return the height above the flight height, metres; 0 if no flight height is set."""
        flight_height_m = self.read(FLIGHT_HEIGHT).value
        return 0.0 if flight_height_m is None else state.height_above_ground_m - flight_height_m

    def off_height_m(self, state: DroneState) -> float:
        """Return the height above the height that the drone keeps, which is higher among movers."""
        if self.read(FLIGHT_HEIGHT).value is None:
            return 0.0
        return self.too_high_m(state) - (self.read(RAISED).value or 0.0)

    def ground_pitch_rad(self, flight_rad: float) -> float:
        """Return the camera's pitch in flight, or a lower one to show ground or a mover's base."""
        site_map, motion = self.read(SITE_MAP).value, self.read(ODOMETRY).value
        camera, state = self.read(CAMERA).value, self.state()
        if site_map is None or motion is None or camera is None or state is None:
            return flight_rad
        height_m = state.height_above_ground_m
        low_rad = ground_pitch_rad(site_map, camera, flight_rad, height_m)
        return mover_pitch_rad(site_map, low_rad, height_m) if site_map.movers else low_rad


class GiveWay(CourseLeaf):
    """Stop for a mover, and get out of its way; FAILURE when none comes too near.

    As the first child of a `ReactiveFallback` it interrupts the others.
    """

    points = True
    group = "Parts of shipped subtrees"
    answers = (Status.FAILURE, Status.RUNNING)
    ports = (Port("gives_way", bool, True, "false: it always fails"), GIMBAL)

    def update(self) -> Status:
        """Give way if the port is set; without telemetry FAILURE."""
        return super().update() if self.state() is not None else Status.FAILURE

    def work(self, state: DroneState) -> Status:
        """Give way."""
        del state
        gives_way = self.port_value("gives_way") and self.give_way()
        return Status.RUNNING if gives_way else Status.FAILURE

    def gimbal_pitch_rad(self) -> float:
        """Return the pitch in flight, or lower to show the base of a mover."""
        return self.ground_pitch_rad(math.radians(self.port_value("gimbal_deg")))
