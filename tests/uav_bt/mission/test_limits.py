"""Limits of height: a drone that answers late stops at floor and ceiling."""

from __future__ import annotations

import math
from collections import deque

import pytest

from uav_bt.board.context import Proposals
from uav_bt.mission.limits import Limits, approach_speed_mps, limit_movement
from uav_bt.mission.safety import Arbiter, Circumstances
from uav_bt.types import (
    Airframe,
    DroneState,
    FlyingState,
    Land,
    MoveBy,
    Movement,
    Velocity,
)

LIMITS = Limits(floor_m=0.3, ceiling_m=2.4, climb_mps=0.6)
TICK_S = 0.1


def at(height_m: float) -> DroneState:
    return DroneState(
        captured_s=0.0,
        flying=FlyingState.FLYING,
        height_m=height_m,
        height_above_ground_m=height_m,
    )


def decide(movement: Movement, height_m: float, *, flown: Movement | None = None) -> Movement:
    """Return the arbiter's command; the hold converts the proposal to `flown`."""
    proposals = Proposals()
    proposals.propose("leaf", movement)
    now = Circumstances(state=at(height_m))
    return Arbiter(LIMITS).decide(proposals, now, lambda each: flown or each).movement


def test_below_the_floor_nothing_sinks_and_above_the_ceiling_nothing_climbs() -> None:
    assert decide(Velocity(down_mps=0.6), 0.1) == Velocity()
    assert decide(Velocity(down_mps=-0.6), 2.5) == Velocity()
    assert decide(MoveBy(id=1, down_m=0.2), 0.1) == MoveBy(id=1)
    assert decide(MoveBy(id=1, down_m=-0.2), 2.5) == MoveBy(id=1)


def test_away_from_a_bound_the_full_speed_is_flown() -> None:
    assert decide(Velocity(down_mps=-0.6), 0.1) == Velocity(down_mps=-0.6)
    assert decide(Velocity(down_mps=0.6), 2.5) == Velocity(down_mps=0.6)


def test_close_to_a_bound_a_velocity_is_reduced() -> None:
    """One centimetre is left: with 0.15 s of delay and 0.25 s of lag, 0.7 cm/s."""
    climbs, sinks = decide(Velocity(down_mps=-0.6), 2.39), decide(Velocity(down_mps=0.6), 0.31)
    assert isinstance(climbs, Velocity)
    assert isinstance(sinks, Velocity)
    assert -climbs.down_mps == pytest.approx(0.0071, abs=1e-4)
    assert sinks.down_mps == pytest.approx(0.0071, abs=1e-4)


def test_a_prompt_drone_brakes_with_its_deceleration() -> None:
    """V = sqrt(2 a s): from 0.6 m/s it stops within 0.18 m at 1 m/s^2."""
    prompt = Airframe(command_delay_s=0.0, command_lag_s=0.0, climb_braking_mps2=1.0)
    assert approach_speed_mps(0.18, 1.0, prompt, 0.0) == pytest.approx(0.6)
    assert approach_speed_mps(0.0, 1.0, prompt, 0.0) == 0.0


def test_a_landing_is_bound_in_speed_only() -> None:
    """The position hold flies the landing as a velocity, also below the floor."""
    sinks = Velocity(forward_mps=3.0, right_mps=4.0, down_mps=0.45)
    flown = decide(Land(), 0.25, flown=sinks)
    assert isinstance(flown, Velocity)
    assert (flown.forward_mps, flown.right_mps) == pytest.approx((0.6, 0.8))
    assert flown.down_mps == 0.45
    fast = limit_movement(Velocity(down_mps=2.0), at(0.25), LIMITS, Airframe(), landing=True)
    assert fast == Velocity(down_mps=0.6)


@pytest.mark.parametrize("climbs", [False, True])
@pytest.mark.parametrize("report_s", [0.1, 0.2, 0.4])
@pytest.mark.parametrize(
    ("delay_s", "lag_s"), [(0.0, 0.3), (0.15, 0.25), (0.5, 0.0), (0.5, 0.25), (0.0, 0.0)]
)
def test_a_late_drone_stops_at_the_bound(
    delay_s: float,
    lag_s: float,
    report_s: float,
    climbs: bool,  # noqa: FBT001
) -> None:
    """0.6 m/s is proposed for a minute; the height is reported every `report_s`."""
    airframe = Airframe(command_delay_s=delay_s, command_lag_s=lag_s)
    height_m, mps, step_s = 1.35, 0.0, 0.01
    waiting: deque[tuple[float, float]] = deque()
    order_mps, seen, heights = 0.0, at(height_m), []
    seen_s = 0.0
    for step in range(6000):
        now_s = step * step_s
        if step % round(report_s / step_s) == 0:
            seen, seen_s = at(height_m), now_s
        if step % round(TICK_S / step_s) == 0:
            asked = Velocity(down_mps=-0.6 if climbs else 0.6)
            flown = limit_movement(asked, seen, LIMITS, airframe, state_age_s=now_s - seen_s)
            assert isinstance(flown, Velocity)
            waiting.append((now_s + delay_s, flown.down_mps))
        while waiting and waiting[0][0] <= now_s:
            order_mps = waiting.popleft()[1]
        mps += (order_mps - mps) * (1.0 - math.exp(-step_s / lag_s) if lag_s else 1.0)
        height_m -= mps * step_s
        heights.append(height_m)
    bound_m = LIMITS.ceiling_m if climbs else LIMITS.floor_m
    beyond_m = max(heights) - bound_m if climbs else bound_m - min(heights)
    assert beyond_m < 0.015
    assert heights[-1] == pytest.approx(bound_m, abs=0.02)
