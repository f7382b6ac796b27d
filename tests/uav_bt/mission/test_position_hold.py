"""Position hold: a simulated drone with drift or a wrong velocity keeps its place."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import pytest

from uav_bt.mission.hold_model import GroundWatch
from uav_bt.mission.position_hold import PositionHold
from uav_bt.types import Hover, Land, MoveBy, Movement, MovementStatus, TakeOff, Velocity, rotate
from uav_bt.types.dead_reckoning import MotionEstimate, OdometryPose
from uav_bt.types.drone_state import Attitude, BodyVelocity, DroneState, FlyingState, MovementState

TICK_S = 0.1
LATE_TICKS = 2  # delay of a command
LEARNED_S = 1.0  # time constant of the odometry's correction


@dataclass
class Body:
    """A drone that follows commands and drifts. Velocities are in the world; yaw 0 is along x."""

    drift_mps: tuple[float, float] = (0.0, 0.0)
    bias_mps: float = 0.0  # error of the reported forward velocity
    bias_is_known: bool = False  # the odometry has told it from a drift
    leapt_m: float = 0.0  # jump of dead reckoning along x
    hold: PositionHold = field(default_factory=PositionHold)
    x_m: float = 0.0
    y_m: float = 0.0
    height_m: float = 1.5
    yaw_rad: float = 0.0
    now_s: float = 0.0
    mps: tuple[float, float] = (0.0, 0.0)  # velocity over the ground without the drift
    error_mps: tuple[float, float] = (0.0, 0.0)  # velocity error that the odometry has estimated
    untracked_s: float = 0.0
    flying: FlyingState = FlyingState.FLYING
    movement: MovementStatus | None = None
    sees: bool = True
    telemetry_ticks: int = 0  # age of the reported velocity
    flown_mps: list[tuple[float, float]] = field(default_factory=list)  # velocity in each tick
    sent: list[Movement] = field(default_factory=list)

    def motion(self) -> MotionEstimate:
        self.flown_mps.append(self.mps)
        reported = self.flown_mps[max(0, len(self.flown_mps) - 1 - self.telemetry_ticks)]
        told = rotate(*reported, -self.yaw_rad)
        error = rotate(*self.error_mps, -self.yaw_rad)
        x_m = self.x_m + self.leapt_m
        pose = OdometryPose(time_s=self.now_s, x_m=x_m, y_m=self.y_m, yaw_rad=self.yaw_rad)
        return MotionEstimate(
            pose=pose,
            seen=pose,
            velocity=BodyVelocity(
                forward_mps=told[0] + self.bias_mps + error[0], right_mps=told[1] + error[1]
            ),
            error=BodyVelocity(forward_mps=error[0], right_mps=error[1]),
            bias=BodyVelocity(forward_mps=-self.bias_mps * self.bias_is_known),
            tracked_s=self.now_s - self.untracked_s,
            velocity_s=self.now_s - TICK_S * self.telemetry_ticks,
        )

    def state(self) -> DroneState:
        return DroneState(
            captured_s=self.now_s,
            flying=self.flying,
            attitude=Attitude(yaw_rad=self.yaw_rad),
            height_m=self.height_m,
            height_above_ground_m=self.height_m,
            movement=self.movement,
        )

    def tick(self, proposed: Movement) -> Movement:
        motion = self.motion() if self.sees else None
        flown = self.hold.correct(proposed, self.state(), motion, self.now_s)
        self.hold.sent(flown, motion, self.now_s, rests=False)
        self.sent.append(flown)
        arrived = self.sent[-1 - LATE_TICKS] if len(self.sent) > LATE_TICKS else Hover()
        order = arrived if isinstance(arrived, Velocity) else Velocity()
        wanted = rotate(order.forward_mps, order.right_mps, self.yaw_rad)
        missed = rotate(-self.bias_mps, 0.0, self.yaw_rad)
        share = 1.0 - math.exp(-TICK_S / 0.3)
        learned = 1.0 - math.exp(-TICK_S / LEARNED_S)
        truth = (missed[0] + self.drift_mps[0], missed[1] + self.drift_mps[1])
        self.mps = _blend(self.mps, wanted, share)
        self.error_mps = _blend(self.error_mps, truth, learned)
        self.x_m += TICK_S * (self.mps[0] + self.drift_mps[0])
        self.y_m += TICK_S * (self.mps[1] + self.drift_mps[1])
        self.height_m -= TICK_S * order.down_mps
        self.yaw_rad += TICK_S * order.yaw_rate_radps
        self.now_s += TICK_S
        return flown

    def fly(self, proposed: Movement, seconds: float) -> float:
        """Return the greatest distance from the origin, m."""
        away = 0.0
        for _ in range(round(seconds / TICK_S)):
            self.tick(proposed)
            away = max(away, math.hypot(self.x_m, self.y_m))
        return away


def _blend(old: tuple[float, float], new: tuple[float, float], share: float) -> tuple[float, float]:
    return old[0] + share * (new[0] - old[0]), old[1] + share * (new[1] - old[1])


@pytest.mark.parametrize("proposed", [Hover(), Velocity(yaw_rate_radps=0.6)], ids=str)
@pytest.mark.parametrize(
    ("drift_mps", "bias_mps", "most_m", "end_m"),
    [
        ((0.1, 0.0), 0.0, 0.16, 0.04),
        ((-0.1, 0.15), 0.0, 0.288, 0.04),
        # The drone's own position is correct, so the hold must not act against it.
        ((0.0, 0.0), 0.2, 0.25, 0.12),
        ((0.0, 0.0), -0.2, 0.25, 0.12),
    ],
)
def test_a_drift_is_held_and_a_wrong_velocity_moves_nothing_for_long(
    proposed: Movement,
    drift_mps: tuple[float, float],
    bias_mps: float,
    most_m: float,
    end_m: float,
) -> None:
    """A turn keeps its rate."""
    body = Body(drift_mps=drift_mps, bias_mps=bias_mps)
    assert body.fly(proposed, 20.0) < most_m
    assert math.hypot(body.x_m, body.y_m) < end_m
    rates = {sent.yaw_rate_radps for sent in body.sent if isinstance(sent, Velocity)}
    assert rates == {proposed.yaw_rate_radps if isinstance(proposed, Velocity) else 0.0}


def test_a_velocity_flight_goes_where_it_is_ordered_to() -> None:
    """It drifts sideways by less than 0.2 m until the drift is known, and then no further."""
    body = Body(drift_mps=(0.0, 0.1))
    body.fly(Velocity(forward_mps=0.4), 3.0)
    begun_m = body.y_m
    body.fly(Velocity(forward_mps=0.4), 5.0)
    assert begun_m < 0.2
    assert body.y_m - begun_m < 0.03
    assert body.x_m == pytest.approx(0.4 * 8.0, abs=0.2)


def drifting() -> Body:
    body = Body(drift_mps=(0.1, 0.0))
    body.fly(Hover(), 10.0)
    return body


def test_a_movement_is_aimed_for_the_drift_once_and_its_goal_is_kept() -> None:
    body, move = drifting(), MoveBy(id=7, forward_m=0.3, down_m=0.1)
    aimed = body.tick(move)
    assert isinstance(aimed, MoveBy)
    assert aimed.forward_m == pytest.approx(0.3 - 0.1 * 1.6, abs=0.05)
    assert (aimed.id, aimed.right_m, aimed.down_m) == (7, pytest.approx(0.0, abs=0.01), 0.1)
    assert body.tick(move) == aimed
    goal_m = body.x_m + 0.3 - 0.02
    body.movement = MovementStatus(id=7, state=MovementState.DONE)
    body.x_m += 0.2  # the movement ended before its goal
    body.fly(Hover(), 8.0)
    assert body.x_m == pytest.approx(goal_m, abs=0.04)


def test_a_movement_goes_on_as_it_was_sent_after_a_moment_without_ground() -> None:
    body, move = drifting(), MoveBy(id=7, forward_m=2.0)
    aimed = body.tick(move)
    body.hold.rest()
    body.x_m += 1.0
    assert body.tick(move) == aimed
    body.movement = MovementStatus(id=7, state=MovementState.DONE)
    body.x_m += 1.0
    x_m = body.x_m
    body.fly(Hover(), 8.0)
    assert body.x_m == pytest.approx(x_m, abs=0.05)


def test_a_movement_without_a_known_drift_is_flown_as_it_is_and_broken_off_has_no_goal() -> None:
    body, move = Body(drift_mps=(0.02, 0.0)), MoveBy(id=7, forward_m=2.0)
    body.fly(Hover(), 5.0)
    assert body.tick(move) == move
    body.movement = MovementStatus(id=7, state=MovementState.INTERRUPTED)
    x_m = body.x_m
    body.fly(Hover(), 5.0)
    assert body.x_m == pytest.approx(x_m, abs=0.03)


def test_braking_after_a_broken_off_movement_is_no_disturbance() -> None:
    """The drone breaks off at 0.9 m/s and brakes with 1 m/s2."""
    body = Body(telemetry_ticks=2)
    body.tick(MoveBy(id=7, forward_m=2.0))
    fastest_mps = 0.0
    for tick in range(30):
        if tick < 9:
            body.mps = (0.9 - tick * TICK_S, 0.0)
        body.tick(Hover())
        fastest_mps = max(fastest_mps, body.hold.disturbance_mps)
    assert fastest_mps < 0.03


def test_a_landing_keeps_its_place_and_ends_with_the_drone_s_own() -> None:
    """That is not taken back by noise of the height, nor when the ground is seen again."""
    body = drifting()
    body.fly(Land(), 0.3)
    x_m = body.x_m
    while isinstance(body.tick(Land()), Velocity):
        assert abs(body.x_m - x_m) < 0.03
    assert body.height_m == pytest.approx(0.2, abs=0.05)
    body.height_m = 0.25
    for body.sees in (True, False, True):
        assert body.tick(Land()) == Land()
    body.fly(Hover(), 1.0)
    body.height_m = 1.5
    assert isinstance(body.tick(Land()), Velocity)


@pytest.mark.parametrize("proposed", [Hover(), Land()], ids=str)
@pytest.mark.parametrize("leap_m", [1.0, -0.5])
def test_where_dead_reckoning_leaps_the_drone_stays(proposed: Movement, leap_m: float) -> None:
    """The hold also ignores a sample of an impossible velocity."""
    body = Body()
    body.fly(Hover(), 3.0)
    body.fly(proposed, 0.5)
    for _ in range(2):
        body.leapt_m += leap_m / 2
        body.bias_mps = leap_m / TICK_S
        body.tick(proposed)
        body.bias_mps, body.mps, body.error_mps = 0.0, (0.0, 0.0), (0.0, 0.0)
    assert body.fly(proposed, 2.0) < 0.05


ALL: tuple[Movement, ...] = (
    Hover(),
    Velocity(forward_mps=0.3),
    MoveBy(id=1, forward_m=1.0),
    Land(),
    TakeOff(),
)


@pytest.mark.parametrize(
    ("name", "value", "movements"),
    [
        ("sees", False, ALL),
        ("untracked_s", 6.0, ALL[2:]),
        ("untracked_s", 21.0, ALL),
        ("flying", FlyingState.LANDED, ALL),
    ],
)
def test_without_a_fresh_estimate_nothing_is_corrected(
    name: str, value: object, movements: tuple[Movement, ...]
) -> None:
    for proposed in movements:
        body = drifting()
        setattr(body, name, value)
        assert body.tick(proposed) == proposed


def assert_held(sent: Movement, forward_mps: float) -> None:
    assert isinstance(sent, Velocity)
    assert (sent.forward_mps, sent.right_mps) == pytest.approx((forward_mps, 0.0), abs=2e-2)


def test_a_hover_without_frames_or_telemetry_is_held_against_the_drift_for_a_time() -> None:
    """The drift keeps its direction in the world when the drone turns."""
    body = drifting()
    since_s = body.now_s
    assert_held(body.hold.against_drift(Hover(), body.state(), since_s + 19.0), -0.1)
    assert body.hold.against_drift(Hover(), body.state(), since_s + 21.0) == Hover()
    turned = replace(body.state(), attitude=Attitude(yaw_rad=math.pi))
    assert_held(body.hold.against_drift(Hover(), turned, since_s), 0.1)
    body.flying = FlyingState.LANDED
    assert body.hold.against_drift(Hover(), body.state(), since_s + 1.0) == Hover()


def test_a_disturbance_of_the_last_moment_does_not_count_without_frames() -> None:
    """A frozen image of a moving drone looks like a drift."""
    body = drifting()
    body.drift_mps = (0.1, -0.3)
    body.fly(Hover(), 1.5)
    assert_held(body.hold.against_drift(Hover(), body.state(), body.now_s), -0.1)


def test_a_known_bias_of_telemetry_is_no_disturbance_in_a_turn_without_ground() -> None:
    """A drift would keep its direction in the world, but a bias turns with the drone."""
    body = Body(bias_mps=0.2, bias_is_known=True)
    body.fly(Hover(), 5.0)
    body.untracked_s = 2.0
    assert body.fly(Velocity(yaw_rate_radps=0.6), 5.0) < 0.25


def test_without_ground_the_known_drift_is_held_and_no_place_is_kept() -> None:
    body = drifting()
    body.untracked_s = 6.0
    began_m = body.x_m
    assert body.fly(Hover(), 10.0) < 0.2 + abs(began_m)
    body.x_m += 0.5
    assert_held(body.tick(Hover()), -0.1)


def test_the_correction_is_limited_and_what_cannot_be_held_is_named() -> None:
    body = Body(drift_mps=(0.8, 0.0))
    body.fly(Hover(), 10.0)
    assert body.hold.trouble is not None
    assert "drifts" in body.hold.trouble
    speeds = [math.hypot(s.forward_mps, s.right_mps) for s in body.sent if isinstance(s, Velocity)]
    assert max(speeds) <= 0.5 + 1e-9
    assert drifting().hold.trouble is None


# --- the watch ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("error_mps", "seconds", "named"), [(0.12, 10.0, True), (0.06, 10.0, False), (0.2, 2.5, False)]
)
def test_ground_that_moves_otherwise_than_telemetry_says_for_long_is_named(
    error_mps: float, seconds: float, *, named: bool
) -> None:
    """The warning ends with its cause."""
    watch, motion = GroundWatch(), Body().motion()
    off, said = replace(motion, error=BodyVelocity(right_mps=error_mps)), set[str]()
    for tick in range(round(seconds / TICK_S)):
        watch.update(off, tick * TICK_S)
        said |= {*watch.warnings}
    assert [f"{error_mps:.2f} m/s" in words for words in said] == [True] * named
    watch.update(motion if named else None, seconds)
    assert not watch.warnings


@pytest.mark.parametrize("telemetry_ticks", [0, 2, 3])
def test_late_telemetry_of_changing_orders_is_no_disturbance(telemetry_ticks: int) -> None:
    """Commands alternate between 0 and 0.1 m/s; no drift, the velocity is 0 to 0.3 s old."""
    body, most_mps = Body(telemetry_ticks=telemetry_ticks), 0.0
    for tick in range(80):
        body.tick(Velocity(forward_mps=0.1 if tick // 10 % 2 else 0.0))
        most_mps = max(most_mps, body.hold.disturbance_mps)
    assert most_mps < 0.02
