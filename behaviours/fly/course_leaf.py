"""Base of the leaves that fly courses: a heading and a speed, held between answers."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

from behaviours.fly.course import Course
from behaviours.fly.giving_way import GivingWay, GivingWayConfig
from behaviours.fly.keeping_away import KeepAwayConfig, by_the_map, push_away_mps
from behaviours.fly.moving_leaf import MovingLeaf
from behaviours.path.gimbal_pointing import ground_pitch_rad, mover_pitch_rad
from uav_bt.answers import FollowLeg, Rotate
from uav_bt.board import (
    CAMERA,
    FLIGHT_HEIGHT,
    HELD_TURN,
    ODOMETRY,
    PHASE,
    RAISED,
    SITE_MAP,
    STATE,
)
from uav_bt.board.blackboard import Key
from uav_bt.board.context import MissionContext
from uav_bt.tree import Port
from uav_bt.types import DroneState, HeldTurn, NearObstacles, Velocity, clamp

GIMBAL = Port(
    "gimbal_deg", float, default=-30.0, least=-90, most=90, doc="camera pitch in flight, degrees"
)


@dataclass(frozen=True, kw_only=True)
class CourseConfig:
    """How courses are flown. The numbers were chosen in flights on the training scenes.

    Attributes:
        keep_away: How obstacles push the drone away.
        climb_per_s: Climb rate per metre of error in height.
        climb_mps: Highest climb rate.
        evaded_m: A turn corrects only larger errors in height, which are those of giving way.
    """

    keep_away: KeepAwayConfig = field(default_factory=KeepAwayConfig)
    climb_per_s: float = 0.8
    climb_mps: float = 0.25
    evaded_m: float = 0.2


class CourseLeaf(MovingLeaf):
    """Base of the leaves that fly at a speed and keep away from obstacles."""

    course: ClassVar[CourseConfig] = CourseConfig()
    reads: ClassVar[tuple[Key[Any], ...]] = (
        STATE,
        FLIGHT_HEIGHT,
        RAISED,
        CAMERA,
        ODOMETRY,
        SITE_MAP,
    )
    writes: ClassVar[tuple[Key[Any], ...]] = (PHASE, HELD_TURN, RAISED)
    resumes = False  # after an interruption the leaf decides anew, on a new view

    def on_setup(self, mission: MissionContext) -> None:
        """Begin without a course."""
        # Imported here, because Numba takes 0.2 s and `uav-bt check` must answer at once.
        import behaviours.path.compiled_loops  # noqa: F401, PLC0415

        super().on_setup(mission)
        self._course = Course()
        giving_way = GivingWayConfig()
        margins = giving_way.margins.within(mission.clearances)
        moving = replace(giving_way.way_out.moving, body_m=mission.airframe.radius_m)
        way_out = replace(giving_way.way_out, moving=moving)
        self._giving_way = GivingWay(replace(giving_way, margins=margins, way_out=way_out))

    def fly_on(self, state: DroneState, answer: FollowLeg | Rotate | None) -> None:
        """Fly ahead at a speed while the heading is controlled, without a stop between answers.

        Args:
            state: The drone's state.
            answer: The new answer; None to keep the last one for a while.
        """
        yaw_rad = state.attitude.yaw_rad
        if isinstance(answer, FollowLeg) and answer.speed_mps > 0.0:
            self.write(HELD_TURN, HeldTurn())
        course = self._course.follow(answer, yaw_rad=yaw_rad, now_s=self.clock.now())
        if course is None:
            return
        speed_mps, yaw_rate = course
        if speed_mps == 0.0:
            self.propose(self.turn_keeping_away(yaw_rate))
            return
        # Only the sideways push is used: a push along the route would change the speed.
        _, right_mps = self._push_mps()
        self.propose(
            Velocity(
                forward_mps=speed_mps,
                right_mps=right_mps,
                down_mps=self._height_mps(state),
                yaw_rate_radps=yaw_rate,
            )
        )

    def turn_keeping_away(self, yaw_rate_radps: float) -> Velocity:
        """Return a turn on the spot that moves away from obstacles that are too near.

        A hovering drone drifts, also towards places that the camera does not show. It returns to
        the flight height after it has climbed to give way.
        """
        forward_mps, right_mps = self._push_mps()
        state = self.state()
        evaded = state is not None and abs(self.off_height_m(state)) > self.course.evaded_m
        return Velocity(
            forward_mps=forward_mps,
            right_mps=right_mps,
            down_mps=self._height_mps(state) if state is not None and evaded else 0.0,
            yaw_rate_radps=yaw_rate_radps,
        )

    def _height_mps(self, state: DroneState) -> float:
        """Return the vertical speed to the height that the drone keeps, positive down."""
        cfg = self.course
        return clamp(cfg.climb_per_s * self.off_height_m(state), cfg.climb_mps)

    def give_way(self) -> bool:
        """Stop for a mover or get out of its way, and climb; False when none comes too near."""
        site_map = self.read(SITE_MAP).value
        self.write(RAISED, self._giving_way.raised_m(site_map))
        velocity = self._giving_way.velocity(
            site_map,
            self.obstacles(),
            self.read(ODOMETRY).value,
            now_s=self.clock.now(),
        )
        if velocity is None:
            return False
        self.drop_course()
        self.feedback_message = "gives way"
        self.propose(replace(velocity, down_mps=self._evading_down_mps()))
        return True

    def _evading_down_mps(self) -> float:
        """Return the vertical speed to the height at which the drone gives way."""
        cfg, state = self._giving_way.config, self.state()
        return (
            0.0
            if state is None
            else clamp(cfg.climb_per_s * self.off_height_m(state), cfg.climb_mps)
        )

    def drop_course(self) -> None:
        """Drop movement and course."""
        self._step.drop(self.clock.now())
        self._course.drop()

    def obstacles(self) -> NearObstacles | None:
        """Return the obstacles near the drone, mapped or not; None without a map."""
        site_map = self.read(SITE_MAP).value
        return None if site_map is None else site_map.near

    def yaw_rad(self, state: DroneState) -> float:
        """Return the heading of telemetry, extrapolated to now if there is odometry."""
        motion = self.read(ODOMETRY).value
        return state.attitude.yaw_rad if motion is None else motion.reported_yaw_rad

    def too_high_m(self, state: DroneState) -> float:
        """Return the height above the flight height, metres; 0 if no flight height is set."""
        flight_height_m = self.read(FLIGHT_HEIGHT).value
        return 0.0 if flight_height_m is None else state.height_above_ground_m - flight_height_m

    def off_height_m(self, state: DroneState) -> float:
        """Return the height above the height that the drone keeps, metres.

        That is the flight height, and a higher one among movers. 0 if no flight height is set.
        """
        if self.read(FLIGHT_HEIGHT).value is None:
            return 0.0
        return self.too_high_m(state) - (self.read(RAISED).value or 0.0)

    def ground_pitch_rad(self, flight_rad: float) -> float:
        """Return the camera's pitch: the flight pitch, or lower to show ground, or a mover's base.

        Args:
            flight_rad: The pitch in flight, negative down.
        """
        site_map, motion = self.read(SITE_MAP).value, self.read(ODOMETRY).value
        camera, state = self.read(CAMERA).value, self.state()
        if site_map is None or motion is None or camera is None or state is None:
            return flight_rad
        height_m = state.height_above_ground_m
        low_rad = ground_pitch_rad(site_map, camera, flight_rad, height_m)
        return mover_pitch_rad(site_map, low_rad, height_m) if site_map.movers else low_rad

    def _push_mps(self) -> tuple[float, float]:
        cfg, motion = self.course.keep_away, self.read(ODOMETRY).value
        placed = None if motion is None else self.read(SITE_MAP).value
        return push_away_mps(by_the_map(self.obstacles(), placed, cfg), cfg)
