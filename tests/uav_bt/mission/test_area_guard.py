"""The area of a mission: movements that would leave it are cut, and landings are not."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.worlds.tables import cases
from uav_bt.board.context import Proposals
from uav_bt.mission.limits import AreaGuard, Limits
from uav_bt.mission.safety import Arbiter, Circumstances
from uav_bt.types import Airframe, Hover, Land, MoveBy, Movement, Pose2D, TakeOff, Velocity, rotate
from uav_bt.types.area import Area
from uav_bt.types.drone_state import DroneState, FlyingState

CASES = cases("mission")["area_guard"]
AREA = Area((((-2.0, -2.0), (2.0, -2.0), (2.0, 2.0), (0.5, 2.0), (0.5, 0.5), (-2.0, 0.5)),))
TICK_S, STEP_S = 0.1, 0.01


def at(x_m: float, y_m: float, yaw_deg: float = 0.0) -> Pose2D:
    return Pose2D(x_m=x_m, y_m=y_m, yaw_rad=math.radians(yaw_deg))


def velocity(movement: Movement) -> Velocity:
    assert isinstance(movement, Velocity)
    return movement


def test_near_the_boundary_a_velocity_is_slower_in_the_same_direction() -> None:
    """A deflected movement could end in an obstacle."""
    flown = velocity(
        AreaGuard(AREA).limited(
            Velocity(forward_mps=0.8, right_mps=0.4, down_mps=0.1, yaw_rate_radps=0.5),
            at(1.9, -1.0),
        )
    )
    assert 0.0 < flown.forward_mps < 0.1
    assert flown.right_mps == pytest.approx(flown.forward_mps / 2.0)
    assert (flown.down_mps, flown.yaw_rate_radps) == (0.1, 0.5)


def test_the_speed_towards_the_boundary_is_that_of_horizontal_braking() -> None:
    """From v = sqrt(2 a s) a prompt drone stops 0.2 m on, however hard it brakes vertically."""
    prompt = Airframe(command_delay_s=0.0, command_lag_s=0.0, climb_braking_mps2=9.0)
    for airframe, speed_mps in ((prompt, 0.632), (replace(prompt, braking_mps2=0.1), 0.2)):
        flown = AreaGuard(AREA, airframe).limited(Velocity(forward_mps=3.0), at(1.8, -1.0))
        assert velocity(flown).forward_mps == pytest.approx(speed_mps, abs=1e-3)


@pytest.mark.parametrize(("asked", "place", "flown"), CASES["movements"])
def test_a_movement_is_flown_as_it_is_or_only_climbs_and_turns(
    asked: Movement, place: list[float] | None, flown: Movement
) -> None:
    assert AreaGuard(AREA).limited(asked, None if place is None else at(*place)) == flown


def test_a_step_ends_before_the_boundary_and_is_cut_once() -> None:
    """The drone flies a movement of one number once, so its length stays."""
    guard, step = AreaGuard(AREA), MoveBy(id=7, forward_m=3.0, yaw_rad=0.3)
    first = guard.limited(step, at(0.0, -1.0))
    assert isinstance(first, MoveBy)
    assert first.forward_m == pytest.approx(1.9, abs=0.06)
    assert first.yaw_rad == 0.3
    assert guard.limited(step, at(1.0, -1.0)) == first
    assert guard.limited(MoveBy(id=8, forward_m=0.5), at(0.0, -1.0)) == MoveBy(id=8, forward_m=0.5)


def test_a_step_does_not_cross_a_notch() -> None:
    """Both ends lie inside, the way between does not."""
    flown = AreaGuard(AREA).limited(MoveBy(id=1, forward_m=2.2, right_m=1.6), at(-1.0, 0.2))
    assert isinstance(flown, MoveBy)
    assert math.hypot(flown.forward_m, flown.right_m) < 1.0


@settings(max_examples=60, deadline=None)
@given(
    ways=st.lists(
        st.tuples(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-1.6, 1.6)),
        min_size=1,
        max_size=6,
    ),
    x_m=st.floats(-1.5, 1.5),
    y_m=st.floats(-1.8, 0.3),
    delay_s=st.sampled_from([0.0, 0.15, 0.3]),
    lag_s=st.sampled_from([0.0, 0.25]),
)
def test_whatever_is_asked_a_late_drone_stays_inside(
    ways: list[tuple[float, float, float]], x_m: float, y_m: float, delay_s: float, lag_s: float
) -> None:
    """Each velocity is asked for two seconds; the drone answers late, and turns meanwhile."""
    guard = AreaGuard(AREA, Airframe(command_delay_s=delay_s, command_lag_s=lag_s))
    waiting: deque[tuple[float, Velocity]] = deque()
    pose, vx, vy, order = at(x_m, y_m), 0.0, 0.0, Velocity()
    least_m = math.inf
    for step in range(200 * len(ways)):
        now_s = step * STEP_S
        if step % round(TICK_S / STEP_S) == 0:
            forward, right, rate = ways[step // 200]
            asked = Velocity(forward_mps=forward, right_mps=right, yaw_rate_radps=rate)
            waiting.append((now_s + delay_s, velocity(guard.limited(asked, pose))))
        while waiting and waiting[0][0] <= now_s:
            order = waiting.popleft()[1]
        share = 1.0 - math.exp(-STEP_S / lag_s) if lag_s else 1.0
        wx, wy = rotate(order.forward_mps, order.right_mps, pose.yaw_rad)
        vx, vy = vx + share * (wx - vx), vy + share * (wy - vy)
        pose = Pose2D(
            x_m=pose.x_m + vx * STEP_S,
            y_m=pose.y_m + vy * STEP_S,
            yaw_rad=pose.yaw_rad + order.yaw_rate_radps * STEP_S,
        )
        least_m = min(least_m, AREA.margin_m(pose.x_m, pose.y_m))
    # A drone that turns while it answers late flies another way than was asked.
    assert least_m > -0.15


# --- in the arbiter -------------------------------------------------------------------------------


def decided(
    movement: Movement,
    place: Pose2D | None,
    *,
    grounded: bool = False,
    held: Movement | None = None,
) -> Movement:
    proposals = Proposals()
    proposals.propose("leaf", movement)
    state = DroneState(
        captured_s=0.0, flying=FlyingState.FLYING, height_m=1.5, height_above_ground_m=1.5
    )
    now = Circumstances(state=state, place=place)
    arbiter = Arbiter(Limits(), area=AREA, grounded=grounded)
    return arbiter.decide(proposals, now, lambda each: held or each).movement


@pytest.mark.parametrize(("asked", "place", "flown"), CASES["arbiter"])
def test_the_arbiter_cuts_velocities_and_steps_never_landings_and_take_offs(
    asked: Movement, place: list[float] | None, flown: Movement
) -> None:
    assert decided(asked, None if place is None else at(*place)) == flown


def test_a_landing_that_keeps_its_place_still_descends_outside() -> None:
    """The position hold flies a landing as a velocity."""
    held = Velocity(forward_mps=0.1, down_mps=0.4)
    assert decided(Land(), at(2.4, -1.0), held=held) == Velocity(down_mps=0.4)


def test_a_mission_that_stays_on_the_ground_gets_no_take_off() -> None:
    assert decided(TakeOff(), at(0.0, 0.0), grounded=True) == Hover()
