"""Avoid: one steady turn, one way, until the way is free."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from behaviours.fly.avoid import Avoid
from tests.worlds.leaves import (
    ADVANCE,
    TURN_LEFT,
    TURN_RIGHT,
    map_with,
    steering_bench,
)
from uav_bt.answers import Done, Rotate
from uav_bt.board import HELD_TURN, SITE_MAP, STATE
from uav_bt.testing import LeafBench
from uav_bt.testing.world import Says, live, show
from uav_bt.tree import Status
from uav_bt.types import Attitude, HeldTurn, MoveBy, NearObstacles, Velocity


def turning(policy: Says) -> LeafBench:
    """Return a bench whose leaf has just begun to turn."""
    bench = steering_bench(Avoid, policy)
    assert live(bench) is Status.RUNNING
    assert bench.proposed is None
    assert live(bench, seconds=0.3) is Status.RUNNING
    return bench


def rate(bench: LeafBench) -> float:
    """Return the proposed yaw rate of a turn on the spot."""
    proposed = bench.proposed
    assert isinstance(proposed, Velocity)
    assert proposed == Velocity(yaw_rate_radps=proposed.yaw_rate_radps)
    return proposed.yaw_rate_radps


def test_a_free_way_is_success_at_once() -> None:
    """As soon as it has a view of now; nothing is proposed."""
    bench = steering_bench(Avoid, Says(ADVANCE))
    live(bench)

    assert live(bench, seconds=0.3) is Status.SUCCESS
    assert (bench.proposed, bench.pointed) == (None, None)


@pytest.mark.parametrize(("decision", "side"), [(TURN_RIGHT, 1), (TURN_LEFT, -1)])
def test_turns_on_the_spot_as_the_policy_says(decision: object, side: int) -> None:
    """Clockwise is positive."""
    bench = turning(Says(decision))  # type: ignore[arg-type]

    assert side * rate(bench) > 0.3


def test_the_turn_is_held() -> None:
    """Once begun it goes on the same way, even if the policy would now go the other."""
    policy = Says(TURN_RIGHT, TURN_LEFT)
    bench = turning(policy)
    for tick in range(1, 5):
        live(bench, yaw_rad=0.07 * tick)
        assert rate(bench) > 0.3

    assert [view.turning for view in policy.views] == [0, 1, 1, 1, 1]


def test_a_free_way_counts_only_after_the_least_turn() -> None:
    """The requested turn must be complete; then a free way ends the turn."""
    bench = turning(Says(TURN_RIGHT, ADVANCE))
    assert live(bench, yaw_rad=0.2) is Status.RUNNING
    assert live(bench, yaw_rad=0.45) is Status.RUNNING
    assert (
        live(bench, yaw_rad=0.55) is Status.RUNNING
    )  # here it finds out that it has turned enough
    assert live(bench, yaw_rad=0.60) is Status.RUNNING
    assert bench.proposed is None  # the turn is over: it settles, and looks once more
    assert live(bench, seconds=0.3, yaw_rad=0.62) is Status.SUCCESS
    assert (bench.proposed, bench.pointed) == (None, None)


def test_who_flies_at_a_speed_goes_on_from_the_turn() -> None:
    """It steers by a heading: no need to turn back to the view that showed the way."""
    bench = turning(Says(TURN_RIGHT, Rotate(yaw_rad=-1.0)))
    for yaw_rad in (0.2, 0.45, 0.55):
        assert live(bench, yaw_rad=yaw_rad) is Status.RUNNING
    assert live(bench, yaw_rad=0.60) is Status.SUCCESS


def test_it_turns_back_to_where_the_way_was_free() -> None:
    """The turn has gone on since the frame was captured, and goes on until the drone hears."""
    bench = turning(Says(TURN_RIGHT, ADVANCE))
    for yaw_rad in (0.3, 0.55):
        live(bench, yaw_rad=yaw_rad)
    show(bench, yaw_rad=0.60)
    bench.board[STATE] = replace(bench.board[STATE], attitude=Attitude(yaw_rad=0.72))
    bench.tick()

    assert isinstance(bench.proposed, MoveBy)
    assert bench.proposed.yaw_rad == pytest.approx(0.60 - 0.72 - 0.06)


def test_back_there_the_way_must_still_be_free() -> None:
    """Otherwise the turn goes on, the same way round."""
    bench = turning(Says(TURN_RIGHT, ADVANCE, ADVANCE, ADVANCE, TURN_LEFT))
    for yaw_rad in (0.3, 0.55, 0.56):
        live(bench, yaw_rad=yaw_rad)
    assert bench.proposed is None

    assert live(bench, seconds=0.3, yaw_rad=0.56) is Status.RUNNING
    assert rate(bench) > 0.0


def test_turning_back_does_not_count_as_turned() -> None:
    """A gust that turns the drone back must be turned again."""
    bench = turning(Says(TURN_RIGHT, ADVANCE))
    live(bench, yaw_rad=0.4)
    live(bench, yaw_rad=0.1)
    assert live(bench, yaw_rad=0.45) is Status.RUNNING
    assert live(bench, yaw_rad=0.48) is Status.RUNNING
    live(bench, yaw_rad=0.55)
    assert rate(bench) > 0.0
    live(bench, yaw_rad=0.56)
    assert bench.proposed is None


def test_the_turn_is_counted_across_the_wrap() -> None:
    """From 175 to -170 degrees it has turned 15, not 345."""
    bench = steering_bench(Avoid, Says(TURN_RIGHT, ADVANCE))
    live(bench, yaw_rad=3.05)
    live(bench, seconds=0.3, yaw_rad=3.05)
    assert live(bench, yaw_rad=-3.1) is Status.RUNNING
    assert live(bench, yaw_rad=-3.1) is Status.RUNNING
    live(bench, yaw_rad=-2.6)
    live(bench, yaw_rad=-2.6)

    assert bench.proposed is None  # the turn is over


def test_without_a_view_it_neither_turns_nor_ends() -> None:
    """Before the first view of now it waits."""
    policy = Says(ADVANCE)
    bench = steering_bench(Avoid, policy)
    for _ in range(2):
        assert live(bench, seconds=0.05) is Status.RUNNING
        assert bench.proposed is None
    assert policy.views == []


def test_full_turns_in_vain_are_counted_for_the_policy() -> None:
    """After two full turns the policy gets their number; an advance would reset it."""
    policy = Says(TURN_RIGHT)
    bench = turning(policy)
    for tick in range(1, 45):
        live(bench, yaw_rad=(0.3 * tick + 3.0) % 6.283 - 3.0)

    assert policy.views[0].full_turns == 0
    assert policy.views[-1].full_turns == 2


def test_halted_it_holds_its_turn() -> None:
    """Begun again without an advance between, it goes on the same way: no dithering."""
    policy = Says(TURN_RIGHT, TURN_LEFT)
    bench = turning(policy)
    bench.halt()

    live(bench)
    assert bench.proposed is None
    live(bench, seconds=0.3)
    assert rate(bench) > 0.3
    assert policy.views[-1].turning == 1


def test_after_an_advance_the_policy_chooses_again() -> None:
    """An advance clears the held turn."""
    policy = Says(TURN_RIGHT, TURN_LEFT)
    bench = turning(policy)
    bench.halt()
    bench.board[HELD_TURN] = HeldTurn()

    live(bench)
    live(bench, seconds=0.3)

    assert policy.views[-1].turning == 0
    assert rate(bench) < -0.3


def near(bench: LeafBench, *points: tuple[float, float]) -> None:
    """Remember obstacles ahead and right of the body's centre, and tick."""
    show(bench, seconds=0.3)
    bench.board[SITE_MAP] = map_with(
        NearObstacles(points_m=np.array(points, dtype=np.float64), captured_s=bench.clock.now())
    )
    assert bench.tick() is Status.RUNNING


def test_an_intrusion_is_cleared_before_the_turn() -> None:
    """A short step straight away from a near obstacle; the turn comes after it."""
    bench = steering_bench(Avoid, Says(TURN_RIGHT))
    live(bench)
    near(bench, (0.18, 0.24), (1.5, 0.0))
    step = bench.proposed
    assert isinstance(step, MoveBy)
    assert math.atan2(step.right_m, step.forward_m) == pytest.approx(math.atan2(-0.24, -0.18))
    assert 0.05 < math.hypot(step.forward_m, step.right_m) < 0.3
    near(bench, (0.18, 0.24))
    assert bench.proposed == step

    bench.clock.advance(0.3)
    bench.finish_movement()
    bench.tick()
    near(bench, (0.27, 0.36))
    assert rate(bench) > 0.3


@pytest.mark.parametrize(
    "points", [[(0.5, 0.0)], [(0.25, 0.0), (-0.25, 0.0)]], ids=["far enough", "between two"]
)
def test_without_need_or_room_it_just_turns(points: list[tuple[float, float]]) -> None:
    """No step when nothing intrudes, nor from one obstacle into another."""
    bench = steering_bench(Avoid, Says(TURN_RIGHT))
    live(bench)
    near(bench, *points)

    assert rate(bench) > 0.3


def test_a_turn_draws_away_from_what_is_near() -> None:
    """A hovering drone drifts; to where the camera does not look, too."""
    bench = turning(Says(TURN_LEFT))
    near(bench, (0.0, 0.4), (0.0, -2.0))

    turn = bench.proposed
    assert isinstance(turn, Velocity)
    assert turn.yaw_rate_radps < -0.3
    assert (turn.forward_mps, turn.right_mps) == pytest.approx((0.0, -0.075))


def test_a_turn_keeps_off_the_edge_of_the_ground() -> None:
    """It may be nearer than an obstacle."""
    bench = turning(Says(TURN_LEFT))
    for ahead_m, away_mps in ((0.35, 0.0), (0.25, -0.075)):
        show(bench, seconds=0.3)
        bench.board[SITE_MAP] = map_with(
            NearObstacles(
                points_m=np.empty((0, 2)),
                edges_m=np.array([[ahead_m, 0.0]]),
                captured_s=bench.clock.now(),
            )
        )
        bench.tick()

        turn = bench.proposed
        assert isinstance(turn, Velocity)
        assert turn.forward_mps == pytest.approx(away_mps)


def test_when_a_look_round_leaves_nothing_to_do_it_ends() -> None:
    bench = steering_bench(Avoid, Says(Done(reason="covered")))
    live(bench)
    assert live(bench, seconds=0.3) is Status.SUCCESS
