"""Explore: look, step, look again. Avoid: one steady turn. CoverageGrows: new ground."""

import math
import sys
from dataclasses import replace

import numpy as np
import pytest

from behaviours.fly.explore import Avoid, CorridorClear, CoverageGrows, Explore
from tests.behaviours.path.test_movers import mover
from tests.paper_lab import paper_map
from tests.worlds import values
from tests.worlds.leaves import (
    ADVANCE,
    TURN_LEFT,
    TURN_RIGHT,
    map_with,
    steering_bench,
    step,
    velocity,
)
from uav_bt.answers import Advance, Answer, Done, FollowLeg, Rotate
from uav_bt.board import (
    CLASS_MAP,
    CORRIDOR,
    FLIGHT_HEIGHT,
    FLIGHT_PITCH,
    HELD_TURN,
    MARK,
    ODOMETRY,
    PHASE,
    SITE_MAP,
    STATE,
)
from uav_bt.errors import AnswerError, NodeFailedError
from uav_bt.protocols import PolicyView
from uav_bt.testing import LeafBench
from uav_bt.testing.world import Says, drawn_map, live, show
from uav_bt.tree import Leaf, Status
from uav_bt.types import (
    Attitude,
    BodyVelocity,
    GimbalTo,
    HeldTurn,
    MoveBy,
    MovementState,
    NearObstacles,
    Velocity,
)
from uav_bt.types.dead_reckoning import OdometryPose

FAR = Advance(forward_m=1.0, reason="clear")


def begun(policy: Says, leaf: type[Leaf] = Explore, **attributes: object) -> LeafBench:
    """Return a bench whose leaf has settled, and acts by its first view."""
    bench = steering_bench(leaf, policy, **attributes)
    assert live(bench) is Status.RUNNING
    assert bench.proposed is None
    live(bench, seconds=0.3)
    return bench


def near(bench: LeafBench, *points: tuple[float, float], edge_m: float = 9.0) -> None:
    """Remember obstacles around the drone and an edge ahead, and tick."""
    show(bench, seconds=0.3)
    points_m = np.array(points, dtype=np.float64).reshape(-1, 2)
    edges_m, now_s = np.array([[edge_m, 0.0]]), bench.clock.now()
    seen = NearObstacles(points_m=points_m, edges_m=edges_m, captured_s=now_s)
    bench.board[SITE_MAP] = map_with(seen)
    assert bench.tick() is Status.RUNNING


def test_a_view_to_which_the_network_has_no_answer_is_waited_through() -> None:
    class Once(Says):
        def decide(self, view: PolicyView) -> Answer:
            if not self.views:
                self.views.append(view)
                raise AnswerError("net.onnx", "holds NaN")
            return super().decide(view)

    bench = begun(Once(ADVANCE))
    assert bench.proposed is None
    assert [event.text for event in bench.notes.events] == ["no answer: net.onnx: holds NaN"]
    live(bench)
    assert bench.proposed == MoveBy(id=1, forward_m=0.3)


@pytest.mark.parametrize("word", list(MovementState)[1:])
def test_a_step_is_proposed_to_its_end_and_the_next_comes_of_a_new_view(
    word: MovementState,
) -> None:
    """After one that was broken off a second later: what interrupts may pass."""
    policy = Says(ADVANCE)
    bench = begun(policy)
    for _ in range(3):
        assert bench.proposed == MoveBy(id=1, forward_m=0.3)
        assert live(bench) is Status.RUNNING
    assert (len(policy.views), bench.board[PHASE], bench.feedback) == (1, "explore", "clear")
    bench.clock.advance(0.5)
    bench.finish_movement(word)
    bench.tick(advance_s=0.1)
    assert bench.proposed is None  # the class map on the board shows the view before the step
    assert bench.feedback == "waiting for a view"
    if word is not MovementState.DONE:
        live(bench, seconds=0.9)
        assert bench.proposed is None
    assert live(bench) is Status.RUNNING
    assert bench.proposed == MoveBy(id=2, forward_m=0.3)


@pytest.mark.parametrize(
    ("flight_m", "height_m", "down_m"),
    [(1.5, 1.7, 0.2), (1.5, 1.3, -0.2), (1.5, 1.55, 0.0), (1.5, 1.45, 0.0), (None, 0.9, 0.0)],
)
def test_a_step_corrects_the_height(flight_m: float | None, height_m: float, down_m: float) -> None:
    """By more than the altimeter's noise; a mission that begins in the air has no flight height."""
    bench = steering_bench(Explore, Says(ADVANCE))
    if flight_m is not None:
        bench.board[FLIGHT_HEIGHT] = flight_m
    live(bench, height_m=height_m)
    live(bench, seconds=0.3, height_m=height_m)
    assert step(bench).down_m == pytest.approx(down_m)


def test_an_answer_ends_the_leaf_which_proposes_nothing_then() -> None:
    for leaf, answer, status in (
        (Explore, TURN_RIGHT, Status.FAILURE),
        (Explore, Done(), Status.SUCCESS),
        (Avoid, ADVANCE, Status.SUCCESS),
        (Avoid, Done(), Status.SUCCESS),
    ):
        bench = steering_bench(leaf, Says(answer))
        live(bench)
        assert live(bench, seconds=0.3) is status
        assert (bench.proposed, bench.pointed) == (None, None)


def test_the_policy_sees_the_frames_telemetry() -> None:
    """Camera at the map's size, pitch and height of the frame; chance from the mission's seed."""
    policies = [Says(ADVANCE), Says(ADVANCE)]
    for policy in policies:
        bench = steering_bench(Explore, policy)
        bench.board[HELD_TURN] = HeldTurn(direction=-1, turned_rad=7.0)
        live(bench, gimbal_deg=-25.0, height_m=1.4)
        live(bench, seconds=0.3, gimbal_deg=-25.0, height_m=1.4)
        assert bench.board[HELD_TURN] == HeldTurn(), "the advance forgets it"
    (view,), (again,) = (policy.views for policy in policies)
    assert (view.camera.width_px, view.camera.height_px) == (32, 18)
    assert view.gimbal_pitch_rad == pytest.approx(-0.4363, abs=1e-4)
    assert view.height_above_ground_m == 1.4
    assert (view.turning, view.full_turns) == (-1, 1)
    assert view.tie_break == again.tie_break


@pytest.mark.parametrize("answer", [None, (0.2, 0.0)])
def test_a_policy_that_returns_no_answer_is_named(answer: object) -> None:
    said = r"decide\(\) of Says must return Advance, .*uav_bt\.answers, got"
    with pytest.raises(NodeFailedError, match=said):
        begun(Says(answer))  # type: ignore[arg-type]


def test_a_flowing_step_is_replaced_by_one_that_leads_further() -> None:
    bench = begun(Says(FAR), flowing="true")
    for number in (1, 1, 2):  # it leads 0.07 m further a tick
        live(bench, velocity=BodyVelocity(forward_mps=0.7))
        assert bench.proposed == MoveBy(id=number, forward_m=1.0)
    # The decision was made for the place where the frame was captured.
    bench = begun(Says(ADVANCE, FAR), flowing="true")
    show(bench, velocity=BodyVelocity(forward_mps=0.5))
    bench.tick(advance_s=0.2)  # the video is late
    assert step(bench).forward_m == pytest.approx(0.9)


@pytest.mark.parametrize("flowing", [True, False])
def test_a_flowing_step_is_broken_off_when_the_way_is_blocked(*, flowing: bool) -> None:
    """It hovers, looks afresh, and only then fails. The paper's first level flies to its end."""
    bench = begun(Says(FAR, TURN_RIGHT), flowing=flowing)
    assert live(bench, velocity=BodyVelocity(forward_mps=0.5)) is Status.RUNNING
    assert bench.proposed == (None if flowing else MoveBy(id=1, forward_m=1.0))
    assert live(bench, seconds=0.3) is (Status.FAILURE if flowing else Status.RUNNING)


def test_an_answer_with_a_heading_is_flown_without_a_stop() -> None:
    for answer, forward_mps, side in (
        (FollowLeg(yaw_rad=0.3, speed_mps=0.5), 0.5, 1),
        (Rotate(yaw_rad=-1.0), 0.0, -1),
    ):
        bench = begun(Says(answer))
        bench.board[FLIGHT_HEIGHT] = 1.5
        for _ in range(3):
            assert live(bench, height_m=1.2) is Status.RUNNING
            assert velocity(bench).forward_mps == forward_mps
            assert side * velocity(bench).yaw_rate_radps > 0.0
            assert velocity(bench).down_mps == pytest.approx(-0.24)


@pytest.mark.parametrize(("beside_m", "goes"), [(-0.35, 1.0), (0.35, -1.0), (0.6, 0.0)])
def test_at_a_speed_it_keeps_away_from_obstacles_beside_it(beside_m: float, goes: float) -> None:
    bench = steering_bench(Explore, Says(FollowLeg(speed_mps=0.4)))
    live(bench)
    near(bench, (0.1, beside_m))
    assert velocity(bench).forward_mps == 0.4
    assert np.sign(velocity(bench).right_mps) == goes


@pytest.mark.parametrize("moving", [True, False])
@pytest.mark.parametrize("looks_down", [True, False])
def test_at_the_edge_the_camera_is_lowered_to_the_ground(*, moving: bool, looks_down: bool) -> None:
    """Without ground in view the drone loses its place; a mover elsewhere does not change that."""
    flight_rad = math.radians(-42)
    bench = steering_bench(Explore, Says(ADVANCE), looks_down=looks_down)
    bench.board[FLIGHT_PITCH] = flight_rad
    edge = drawn_map(pose=(0.0, 1.8, math.pi / 2))
    here = OdometryPose(x_m=0.0, y_m=1.8, yaw_rad=math.pi / 2, time_s=0.0)
    bench.board[SITE_MAP] = replace(edge, movers=(mover(-1.5, 0.0),) if moving else ())
    bench.board[ODOMETRY] = values.motion(here, tracked_s=0.0)
    bench.allow_stale()
    live(bench)
    assert bench.pointed == (GimbalTo(pitch_rad=math.radians(-56)) if looks_down else None)
    bench.board[SITE_MAP] = drawn_map(pose=(0.0, -1.0, math.pi / 2))
    live(bench)
    assert bench.pointed == (GimbalTo(pitch_rad=flight_rad) if looks_down else None)


def test_without_a_view_for_half_a_second_a_course_ends() -> None:
    bench = begun(Says(FollowLeg(speed_mps=0.5)))
    ids, flies = bench.board[CLASS_MAP].ids, []
    bench.allow_stale()
    for _ in range(7):
        show(bench)
        bench.board[CLASS_MAP] = paper_map(ids, captured_s=-1.0)
        bench.tick()
        flies.append(bench.proposed is not None)
    assert flies == [True] * 5 + [False] * 2


def test_loops_of_the_planner_are_compiled_when_a_leaf_is_set_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delitem(sys.modules, "behaviours.path.compiled_loops", raising=False)
    steering_bench(Explore, Says(TURN_RIGHT)).tick()
    assert "behaviours.path.compiled_loops" in sys.modules


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
