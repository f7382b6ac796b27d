"""Explore: look, step, look again. Avoid: one steady turn. CoverageGrows: new ground."""

import math
import sys
from dataclasses import replace

import numpy as np
import pytest

from behaviours.fly.explore import Avoid, Explore
from tests.behaviours.path.drawn_maps import mover
from tests.paper_lab import paper_map
from tests.worlds import values
from tests.worlds.leaves import ADVANCE, TURN_RIGHT, begun, near, steering_bench, step, velocity
from uav_bt.answers import Advance, Answer, Done, FollowLeg, Rotate
from uav_bt.board import (
    CLASS_MAP,
    FLIGHT_HEIGHT,
    FLIGHT_PITCH,
    HELD_TURN,
    ODOMETRY,
    PHASE,
    SITE_MAP,
)
from uav_bt.errors import AnswerError, NodeFailedError
from uav_bt.protocols import PolicyView
from uav_bt.testing.world import Says, drawn_map, live, show
from uav_bt.tree import Status
from uav_bt.types import BodyVelocity, GimbalTo, HeldTurn, MoveBy, MovementState
from uav_bt.types.dead_reckoning import OdometryPose

FAR = Advance(forward_m=1.0, reason="clear")


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
