"""Avoid: one steady turn. CoverageGrows: new ground. CorridorClear: room ahead."""

import math
from dataclasses import replace

import numpy as np
import pytest

from behaviours.fly.explore import Avoid, CorridorClear, CoverageGrows
from tests.worlds import values
from tests.worlds.leaves import (
    ADVANCE,
    TURN_LEFT,
    TURN_RIGHT,
    begun,
    map_with,
    near,
    steering_bench,
    step,
    velocity,
)
from uav_bt.answers import Rotate
from uav_bt.board import CORRIDOR, HELD_TURN, MARK, SITE_MAP, STATE
from uav_bt.testing import LeafBench
from uav_bt.testing.world import Says, live, show
from uav_bt.tree import Status
from uav_bt.types import Attitude, HeldTurn, NearObstacles, Velocity


def rate(bench: LeafBench) -> float:
    """Return the proposed yaw rate of a turn on the spot."""
    turn = velocity(bench)
    assert turn == Velocity(yaw_rate_radps=turn.yaw_rate_radps)
    return turn.yaw_rate_radps


def test_a_turn_is_held_whatever_the_policy_says_meanwhile() -> None:
    """Also by the next activation, unless an advance came between. Clockwise is positive."""
    policy = Says(TURN_RIGHT, TURN_LEFT)
    bench = begun(policy, Avoid)
    for tick in range(1, 5):
        assert rate(bench) > 0.3
        live(bench, yaw_rad=0.07 * tick)
    assert [view.turning for view in policy.views] == [0, 1, 1, 1, 1]
    for held, side in ((bench.board[HELD_TURN], 1), (HeldTurn(), -1)):
        bench.halt()
        bench.board[HELD_TURN] = held
        live(bench)
        assert bench.proposed is None
        live(bench, seconds=0.3)
        assert side * rate(bench) > 0.3


@pytest.mark.parametrize("begin_rad", [0.0, 2.9])
def test_a_free_way_counts_only_after_the_least_turn(begin_rad: float) -> None:
    """Then the drone settles and looks once more. Turning back does not count as turned."""
    bench = steering_bench(Avoid, Says(TURN_RIGHT, ADVANCE))

    def at(turned_rad: float, seconds: float = 0.1) -> Status:
        yaw_rad = math.remainder(begin_rad + turned_rad, math.tau)
        return live(bench, seconds=seconds, yaw_rad=yaw_rad)

    at(0.0)
    at(0.0, 0.3)
    for turned_rad in (0.4, 0.1, 0.45, 0.48, 0.55):
        assert at(turned_rad) is Status.RUNNING
        assert rate(bench) > 0.0
    assert at(0.60) is Status.RUNNING
    assert bench.proposed is None
    assert at(0.62, 0.3) is Status.SUCCESS
    assert (bench.proposed, bench.pointed) == (None, None)


def test_it_turns_back_to_where_the_way_was_free() -> None:
    """The turn has gone on since the frame was captured, and goes on until the drone hears.

    An answer with a heading ends the turn at once: it shows the way from here.
    """
    for answer, status in ((ADVANCE, Status.RUNNING), (Rotate(yaw_rad=-1.0), Status.SUCCESS)):
        bench = begun(Says(TURN_RIGHT, answer), Avoid)
        for yaw_rad in (0.3, 0.55):
            assert live(bench, yaw_rad=yaw_rad) is Status.RUNNING
        show(bench, yaw_rad=0.60)
        bench.board[STATE] = replace(bench.board[STATE], attitude=Attitude(yaw_rad=0.72))
        assert bench.tick() is status
        if status is Status.RUNNING:
            assert step(bench).yaw_rad == pytest.approx(0.60 - 0.72 - 0.06)


def test_where_it_is_not_free_any_more_the_turn_goes_on() -> None:
    bench = begun(Says(TURN_RIGHT, ADVANCE, ADVANCE, ADVANCE, TURN_LEFT), Avoid)
    for yaw_rad in (0.3, 0.55, 0.56):
        live(bench, yaw_rad=yaw_rad)
    assert bench.proposed is None
    assert live(bench, seconds=0.3, yaw_rad=0.56) is Status.RUNNING
    assert rate(bench) > 0.0


def test_full_turns_in_vain_are_counted_for_the_policy() -> None:
    policy = Says(TURN_RIGHT)
    bench = begun(policy, Avoid)
    for tick in range(1, 45):
        live(bench, yaw_rad=(0.3 * tick + 3.0) % 6.283 - 3.0)
    assert policy.views[0].full_turns == 0
    assert policy.views[-1].full_turns == 2


def test_the_drone_steps_away_from_a_near_obstacle_before_the_turn() -> None:
    bench = steering_bench(Avoid, Says(TURN_RIGHT))
    live(bench)
    near(bench, (0.18, 0.24), (1.5, 0.0))
    away = step(bench)
    assert (away.forward_m, away.right_m) == pytest.approx((-0.09, -0.12))
    near(bench, (0.18, 0.24))
    assert bench.proposed == away
    bench.clock.advance(0.3)
    bench.finish_movement()
    bench.tick()
    near(bench, (0.27, 0.36))
    assert rate(bench) > 0.3


def test_a_turn_keeps_away_from_obstacles_and_the_edge() -> None:
    """A hovering drone drifts, also to where the camera does not look."""
    bench = begun(Says(TURN_LEFT), Avoid)
    for points, edge_m, push_mps in (
        ([(0.5, 0.0)], 9.0, (0.0, 0.0)),
        ([(0.0, 0.4), (0.0, -2.0)], 9.0, (0.0, -0.075)),
        ([], 0.35, (0.0, 0.0)),
        ([], 0.25, (-0.075, 0.0)),
    ):
        near(bench, *points, edge_m=edge_m)
        turn = velocity(bench)
        assert turn.yaw_rate_radps < -0.3
        assert (turn.forward_mps, turn.right_mps) == pytest.approx(push_mps)


def answers(bench: LeafBench, covered: list[int], *, restarts: int = 0) -> list[Status]:
    """Return the answers of ticks half a second apart, on a map of 100 ground cells."""
    result, no = [], np.zeros((10, 10), dtype=bool)
    for count in covered:
        bench.clock.advance(0.5)
        passed, now_s = np.arange(100).reshape(10, 10) < count, bench.clock.now()
        changes = {"seen_s": 0.0 * passed, "passed": passed, "restarts": restarts}
        bench.board[SITE_MAP] = values.site_map(
            3, captured_s=now_s, free=no, outside=no, contradicted_s=9.0, **changes
        )
        result.append(bench.tick())
    return result


YES, NO = Status.SUCCESS, Status.FAILURE


def test_coverage_grows_until_a_window_brings_less_than_asked() -> None:
    bench = LeafBench(CoverageGrows, min_share=0.02, window_s=2.5)
    assert answers(bench, [10, 12, 14, 16, 18, 20, 22]) == [YES] * 7
    # After a window at 22 to 23 cells the window has brought 1 of 100.
    assert answers(bench, [22, 22, 23, 23, 23, 23]) == [*[YES] * 4, NO, NO]
    assert answers(LeafBench(CoverageGrows, min_share=0, window_s=1), [10] * 9) == [YES] * 9


@pytest.mark.parametrize(("pause_s", "restarts"), [(0.0, 0), (20.0, 0), (0.0, 1)])
def test_a_pause_and_a_new_map_restart_the_window(pause_s: float, restarts: int) -> None:
    bench = LeafBench(CoverageGrows, min_share=0.02, window_s=2.5)
    before = [40, 42, 44, 46] if pause_s or restarts else []
    answers(bench, before)
    bench.clock.advance(pause_s)
    assert answers(bench, [40] * 6, restarts=restarts) == [*[YES] * 5, NO]


def test_the_corridor_is_clear_with_enough_room() -> None:
    for ahead_m, impact_s, obstacle, clear in (
        (3.0, math.inf, None, True),
        (0.61, math.inf, None, True),
        (0.59, math.inf, None, False),
        (1.0, 0.9, None, True),
        (1.0, 0.7, None, False),  # too fast for the room
        (3.0, math.inf, (1.5, 0.0), True),
        (3.0, math.inf, (0.5, 0.0), False),  # it has left the view
        (3.0, math.inf, (0.2, 0.45), True),
        (3.0, math.inf, (-0.3, 0.0), True),  # what lies behind may be left,
    ):
        bench = LeafBench(CorridorClear, ahead_m=0.6, impact_s=0.8, beside_m=0.4)
        show(bench)
        now_s = bench.clock.now()
        room = values.corridor(ahead_m, "front", captured_s=now_s, impact_s=impact_s)
        bench.board[CORRIDOR] = room
        if obstacle is not None:
            points_m = np.array([obstacle])
            bench.board[SITE_MAP] = map_with(NearObstacles(points_m=points_m, captured_s=now_s))
        assert bench.tick() is (YES if clear else NO)


def test_only_on_the_way_to_the_pad_the_ground_may_end() -> None:
    for pad, status in ((None, NO), ((1.5, 0.1), YES), ((-0.1, 0.3), YES), ((1.0, 1.0), NO)):
        bench = LeafBench(CorridorClear)
        show(bench, ids=np.zeros((18, 32), dtype=np.uint8))
        now_s = bench.clock.now()
        if pad is not None:
            bench.board[MARK] = values.fix(now_s, *pad)
        bench.board[CORRIDOR] = values.corridor(3.0, nearest_m=math.inf, captured_s=now_s)
        assert bench.tick() is status
