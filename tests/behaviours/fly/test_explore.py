"""Explore: look, step, look again; blocked is a failure; blind is a pause."""

from __future__ import annotations

import math
import sys
from dataclasses import replace

import numpy as np
import pytest

from behaviours.fly.explore import Explore
from tests.behaviours.path.test_ways_out import mover
from tests.paper_lab import paper_map
from tests.worlds.leaves import (
    ADVANCE,
    TURN_RIGHT,
    map_with,
    steering_bench,
)
from tests.worlds.values import motion
from uav_bt.answers import Advance, Answer, Done, FollowLeg, Rotate
from uav_bt.board import (
    CLASS_MAP,
    FLIGHT_HEIGHT,
    FLIGHT_PITCH,
    FRAME,
    HELD_TURN,
    ODOMETRY,
    PHASE,
    SITE_MAP,
)
from uav_bt.errors import AnswerError, NodeFailedError
from uav_bt.protocols import PolicyView
from uav_bt.testing import LeafBench
from uav_bt.testing.world import Says, drawn_map, live, show
from uav_bt.tree import Status
from uav_bt.types import (
    BodyVelocity,
    DroneState,
    FlyingState,
    GimbalTo,
    HeldTurn,
    MoveBy,
    MovementState,
    NearObstacles,
    Velocity,
)
from uav_bt.types.dead_reckoning import OdometryPose
from uav_bt.types.site_map import MapMover


def stepping(policy: Says | None = None, **attributes: object) -> LeafBench:
    """Return a bench whose leaf has just begun its first step."""
    bench = steering_bench(Explore, policy or Says(ADVANCE), **attributes)
    assert live(bench) is Status.RUNNING
    assert bench.proposed is None
    assert live(bench, seconds=0.3) is Status.RUNNING
    return bench


def test_steps_ahead_while_the_way_is_free() -> None:
    """It settles, looks, and asks for the policy's step; the board says what goes on."""
    bench = stepping()

    assert bench.proposed == MoveBy(id=1, forward_m=0.3)
    assert bench.board[PHASE] == "explore"
    assert bench.feedback == "clear"


def test_a_view_to_which_the_network_has_no_answer_is_waited_through() -> None:
    class Once(Says):
        def decide(self, view: PolicyView) -> Answer:
            if not self.views:
                self.views.append(view)
                raise AnswerError("net.onnx", "holds NaN")
            return super().decide(view)

    bench = stepping(Once(ADVANCE))
    assert bench.proposed is None
    assert [event.text for event in bench.notes.events] == ["no answer: net.onnx: holds NaN"]
    live(bench)
    assert bench.proposed == MoveBy(id=1, forward_m=0.3)


def test_a_step_is_proposed_until_it_is_done() -> None:
    """Same id every tick; meanwhile the policy is not asked."""
    policy = Says(ADVANCE)
    bench = stepping(policy)
    asked = len(policy.views)
    for _ in range(5):
        assert live(bench) is Status.RUNNING
        assert bench.proposed == MoveBy(id=1, forward_m=0.3)

    assert len(policy.views) == asked


@pytest.mark.parametrize("word", list(MovementState)[1:])
def test_however_a_step_ended_it_looks_again(word: MovementState) -> None:
    """Done, interrupted or rejected: the next step is decided from the new view.

    A drone that broke off one step is asked for the next a second later: what interrupts may pass.
    """
    bench = stepping()
    bench.clock.advance(0.5)
    bench.finish_movement(word)
    bench.tick(advance_s=0.1)
    assert bench.proposed is None  # the class map on the board shows the view before the step
    if word is not MovementState.DONE:
        live(bench, seconds=0.9)
        assert bench.proposed is None

    assert live(bench) is Status.RUNNING
    assert bench.proposed == MoveBy(id=2, forward_m=0.3)


def test_a_view_from_before_the_step_does_not_count() -> None:
    """Video is late: a frame captured while it still moved shows another place."""
    policy = Says(ADVANCE)
    bench = stepping(policy)
    asked = len(policy.views)
    late = bench.board[FRAME]
    bench.clock.advance(0.5)
    bench.finish_movement()
    bench.board[FRAME] = late
    bench.board[CLASS_MAP] = paper_map(ids=bench.board[CLASS_MAP].ids, captured_s=late.captured_s)

    assert bench.tick(advance_s=0.1) is Status.RUNNING
    assert bench.proposed is None
    assert len(policy.views) == asked
    assert bench.feedback == "waiting for a view"


@pytest.mark.parametrize(
    ("height_m", "down_m"), [(1.7, 0.2), (1.3, -0.2), (1.55, 0.0), (1.45, 0.0)]
)
def test_a_step_corrects_the_height(height_m: float, down_m: float) -> None:
    """Off the flight height by more than the altimeter's noise, the step leads back to it."""
    bench = steering_bench(Explore, Says(ADVANCE))
    bench.board[FLIGHT_HEIGHT] = 1.5
    live(bench, height_m=height_m)
    live(bench, seconds=0.3, height_m=height_m)

    assert isinstance(bench.proposed, MoveBy)
    assert bench.proposed.down_m == pytest.approx(down_m)


def test_without_a_flight_height_the_drone_keeps_its_height() -> None:
    """A mission that begins in the air has no TakeOff that says how high it flies."""
    bench = steering_bench(Explore, Says(ADVANCE))
    live(bench, height_m=0.9)
    live(bench, seconds=0.3, height_m=0.9)

    assert bench.proposed == MoveBy(id=1, forward_m=0.3)


def test_a_blocked_way_is_a_failure() -> None:
    """Avoid's turn: in the tick in which it ends it proposes nothing."""
    bench = steering_bench(Explore, Says(TURN_RIGHT))
    live(bench)

    assert live(bench, seconds=0.3) is Status.FAILURE
    assert (bench.proposed, bench.pointed) == (None, None)


def test_the_policy_sees_the_frames_telemetry() -> None:
    """Camera at the map's size, pitch and height of the frame; chance from the mission's seed."""
    policies = [Says(ADVANCE), Says(ADVANCE)]
    for policy in policies:
        bench = steering_bench(Explore, policy)
        live(bench, gimbal_deg=-25.0, height_m=1.4)
        live(bench, seconds=0.3, gimbal_deg=-25.0, height_m=1.4)
    (view,), (again,) = (policy.views for policy in policies)

    assert (view.camera.width_px, view.camera.height_px) == (32, 18)
    assert view.gimbal_pitch_rad == pytest.approx(-0.4363, abs=1e-4)
    assert view.height_above_ground_m == 1.4
    assert view.turning == 0
    assert view.tie_break == again.tie_break


def test_an_advance_forgets_the_held_turn() -> None:
    """The obstacle is behind the drone: the next turn may go either way."""
    policy = Says(ADVANCE)
    bench = steering_bench(Explore, policy)
    bench.board[HELD_TURN] = HeldTurn(direction=-1, turned_rad=7.0)
    live(bench)
    live(bench, seconds=0.3)

    assert (policy.views[0].turning, policy.views[0].full_turns) == (-1, 1)
    assert bench.board[HELD_TURN] == HeldTurn()


# --- flowing --------------------------------------------------------------------------------------

FAR = Advance(forward_m=1.0, reason="clear")


def moving_on(bench: LeafBench, forward_mps: float) -> Status:
    """Show the leaf a world of now in which the drone flies ahead, and tick it."""
    show(bench, velocity=BodyVelocity(forward_mps=forward_mps))
    return bench.tick()


def test_a_flowing_step_is_replaced_by_one_that_leads_further() -> None:
    """No stop between: the new step begins while the old one is under way."""
    bench = stepping(Says(FAR), flowing="true")
    for _ in range(2):
        moving_on(bench, 0.7)
        assert bench.proposed == MoveBy(id=1, forward_m=1.0)  # it leads 0.07 m further a tick
    moving_on(bench, 0.7)

    assert bench.proposed == MoveBy(id=2, forward_m=1.0)


def test_what_was_flown_since_the_frame_is_not_flown_again() -> None:
    """The decision was made for the place where the frame was captured."""
    bench = stepping(Says(ADVANCE, FAR), flowing="true")
    show(bench, velocity=BodyVelocity(forward_mps=0.5))
    bench.clock.advance(0.2)  # the video is late

    bench.tick()

    assert isinstance(bench.proposed, MoveBy)
    assert bench.proposed.forward_m == pytest.approx(0.9)


def test_a_flowing_step_is_broken_off_when_the_way_is_blocked() -> None:
    """It hovers, looks afresh, and only then fails."""
    bench = stepping(Says(FAR, TURN_RIGHT), flowing="true")

    assert moving_on(bench, 0.5) is Status.RUNNING
    assert bench.proposed is None
    assert live(bench, seconds=0.3) is Status.FAILURE


def test_without_flowing_a_step_is_flown_to_its_end() -> None:
    """As the paper's first level does."""
    policy = Says(FAR, TURN_RIGHT)
    bench = stepping(policy)
    moving_on(bench, 0.5)

    assert bench.proposed == MoveBy(id=1, forward_m=1.0)


@pytest.mark.parametrize("answer", [None, (0.2, 0.0)])
def test_a_policy_that_returns_no_answer_is_named(answer: object) -> None:
    with pytest.raises(
        NodeFailedError, match=r"decide\(\) of Says must return Advance, .*uav_bt\.answers, got"
    ):
        stepping(Says(answer))  # type: ignore[arg-type]


def test_a_decision_with_a_speed_is_flown_without_a_stop() -> None:
    """Ahead at that speed, the heading towards the bearing, every tick; no separate movement."""
    policy = Says(FollowLeg(yaw_rad=0.3, speed_mps=0.5, reason="on"))
    bench = stepping(policy)
    for _ in range(3):
        assert live(bench) is Status.RUNNING
        assert isinstance(bench.proposed, Velocity)
        assert bench.proposed.forward_mps == 0.5
        assert bench.proposed.yaw_rate_radps > 0.0


def test_a_speed_of_zero_turns_on_the_spot() -> None:
    bench = stepping(Says(Rotate(yaw_rad=-1.0)))
    assert isinstance(bench.proposed, Velocity)
    assert bench.proposed.forward_mps == 0.0
    assert bench.proposed.yaw_rate_radps < 0.0


def test_at_a_speed_the_height_is_kept() -> None:
    bench = steering_bench(Explore, Says(FollowLeg(speed_mps=0.4)))
    bench.board[FLIGHT_HEIGHT] = 1.5
    live(bench, height_m=1.2)
    live(bench, seconds=0.3, height_m=1.2)
    assert isinstance(bench.proposed, Velocity)
    assert bench.proposed.down_mps < 0.0


@pytest.mark.parametrize(("beside_m", "goes"), [(-0.35, 1.0), (0.35, -1.0), (0.6, 0.0)])
def test_at_a_speed_it_keeps_away_from_what_is_beside_it(beside_m: float, goes: float) -> None:
    bench = steering_bench(Explore, Says(FollowLeg(speed_mps=0.4)))
    live(bench)
    bench.board[SITE_MAP] = map_with(
        NearObstacles(points_m=np.array([[0.1, beside_m]]), captured_s=0.0)
    )
    bench.allow_stale()
    live(bench, seconds=0.3)
    assert isinstance(bench.proposed, Velocity)
    assert bench.proposed.forward_mps == 0.4
    assert np.sign(bench.proposed.right_mps) == goes


@pytest.mark.parametrize("movers", [(), (mover(-1.5, 0.0),)])
@pytest.mark.parametrize("looks_down", [True, False])
def test_at_the_edge_the_camera_is_lowered_to_the_ground(
    movers: tuple[MapMover, ...], *, looks_down: bool
) -> None:
    """Without ground in view the drone loses its place; a mover elsewhere does not change that."""
    flight_rad = math.radians(-42)
    bench = steering_bench(Explore, Says(ADVANCE), looks_down=looks_down)
    bench.board[FLIGHT_PITCH] = flight_rad
    edge = replace(drawn_map(pose=(0.0, 1.8, math.pi / 2)), movers=movers)
    here = OdometryPose(x_m=0.0, y_m=1.8, yaw_rad=math.pi / 2, time_s=0.0)
    bench.board[SITE_MAP] = edge
    bench.board[ODOMETRY] = motion(here, tracked_s=0.0)
    bench.allow_stale()
    live(bench)
    assert bench.pointed == (GimbalTo(pitch_rad=math.radians(-56)) if looks_down else None)
    bench.board[SITE_MAP] = drawn_map(pose=(0.0, -1.0, math.pi / 2))
    live(bench)
    assert bench.pointed == (GimbalTo(pitch_rad=flight_rad) if looks_down else None)


def test_a_speed_is_not_flown_on_blind() -> None:
    """Without a view for half a second the drone stops."""
    bench = stepping(Says(FollowLeg(speed_mps=0.5)))
    bench.board[CLASS_MAP] = paper_map(ids=bench.board[CLASS_MAP].ids, captured_s=-1.0)
    bench.allow_stale()
    proposed = []
    for _ in range(8):
        bench.clock.advance(0.1)
        bench.observe(DroneState(captured_s=bench.clock.now(), flying=FlyingState.FLYING))
        bench.tick()
        proposed.append(bench.proposed)
    assert isinstance(proposed[0], Velocity)
    assert proposed[-1] is None


def test_nothing_left_to_do_is_a_success() -> None:
    bench = steering_bench(Explore, Says(Done(reason="covered")))
    live(bench)
    assert live(bench, seconds=0.3) is Status.SUCCESS


def test_loops_of_the_planner_are_compiled_when_a_leaf_is_set_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Nothing may be compiled in flight."""
    monkeypatch.delitem(sys.modules, "behaviours.path.compiled_loops", raising=False)
    steering_bench(Explore, Says(TURN_RIGHT)).tick()
    assert "behaviours.path.compiled_loops" in sys.modules
