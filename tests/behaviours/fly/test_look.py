"""The small leaves: hover for a while, point the camera, turn, messages, conditions."""

import math

import pytest

from behaviours.fly.look import HoverFor, Hovering, MovesOn, PointCamera, Say, Turn
from tests.worlds.leaves import wait
from tests.worlds.values import motion
from uav_bt.board import ELAPSED, ODOMETRY, PHASE
from uav_bt.errors import InputError
from uav_bt.testing import LeafBench
from uav_bt.testing.world import live
from uav_bt.tree import Status
from uav_bt.types import BodyVelocity, GimbalTo, Hover, MissionPhase, MoveBy
from uav_bt.types.dead_reckoning import OdometryPose
from uav_bt.types.flight_results import EventKind, FlightEvent


def test_hover_for_hovers_for_its_time_without_that_of_a_pilot() -> None:
    bench = LeafBench(HoverFor, seconds="2.0")
    assert live(bench) is Status.RUNNING
    assert bench.proposed == Hover()
    assert bench.board[PHASE] == "hover"
    assert wait(bench, 1.0) is Status.RUNNING
    assert live(bench, seconds=10.0) is Status.RUNNING
    assert wait(bench, 0.9) is Status.RUNNING
    assert live(bench, seconds=0.2) is Status.SUCCESS
    assert bench.proposed is None


def test_point_camera_points_until_a_frame_has_the_pitch() -> None:
    bench = LeafBench(PointCamera, pitch_deg=-60.0)
    assert live(bench, gimbal_deg=-30.0) is Status.RUNNING
    assert (bench.pointed, bench.proposed) == (GimbalTo(pitch_rad=math.radians(-60)), None)
    assert live(bench, gimbal_deg=-59.0) is Status.SUCCESS
    assert bench.pointed is None


def test_turn_turns_until_the_drone_reports_the_end() -> None:
    bench = LeafBench(Turn, degrees=-90.0)
    for _ in range(2):
        assert live(bench) is Status.RUNNING
        assert bench.proposed == MoveBy(id=1, yaw_rad=-math.pi / 2)
    bench.finish_movement()
    assert bench.tick(advance_s=0.1) is Status.SUCCESS
    assert bench.proposed is None


def test_hovering_asks_for_the_horizontal_speed() -> None:
    for velocity, expected in (
        (BodyVelocity(forward_mps=0.1, right_mps=-0.1), Status.SUCCESS),
        (BodyVelocity(forward_mps=0.12, right_mps=-0.12), Status.FAILURE),
        (BodyVelocity(forward_mps=-0.3), Status.FAILURE),
        (BodyVelocity(down_mps=0.5), Status.SUCCESS),
    ):
        assert live(LeafBench(Hovering, below_mps=0.15), velocity=velocity) is expected


def stay(bench: LeafBench, x_m: float, seconds: float) -> Status:
    """Tick for a time at one place, twice a second; return the last answer."""
    status = Status.RUNNING
    for _ in range(round(2 * seconds)):
        bench.clock.advance(0.5)
        pose = OdometryPose(x_m=x_m, y_m=0.0, yaw_rad=0.0, time_s=bench.clock.now())
        bench.board[ODOMETRY] = motion(pose, tracked_s=-math.inf)
        status = bench.tick()
    return status


def test_moves_on_fails_after_a_stay_and_still_does_when_the_tree_tries_again() -> None:
    bench = LeafBench(MovesOn, for_s=10.0)
    assert stay(bench, 0.0, 9.0) is Status.SUCCESS
    assert stay(bench, 0.6, 9.5) is Status.SUCCESS, "another place"
    bench.clock.advance(100.0)
    assert stay(bench, 0.6, 0.5) is Status.SUCCESS, "a pause does not count"
    assert stay(bench, 0.4, 1.0) is Status.FAILURE
    bench.halt()
    assert stay(bench, 0.4, 0.5) is Status.FAILURE


def test_say_fills_in_variables_and_board_keys() -> None:
    text = "{side} of {count}, {share}, after {@elapsed_s} s in {@phase}; {nothing}, {@mark}"
    bench = LeafBench(Say, text=text)
    bench.board[ELAPSED] = 12.0
    bench.board[PHASE] = MissionPhase.EXPLORE
    bench.variables["side"], bench.variables["count"] = "left", 4
    bench.variables["share"] = 0.12345
    for _ in range(2):  # one event an activation
        assert bench.tick() is Status.SUCCESS
    filled = "left of 4, 0.123, after 12 s in explore; unknown, unknown"
    assert (
        bench.notes.events
        == [FlightEvent(time_s=12.0, kind=EventKind.INFO, text=filled, node="Bench/Say")] * 2
    )
    assert bench.feedback == filled
    bench = LeafBench(Say, text="{n}", level="warning")
    bench.variables["n"] = 2.5
    bench.tick()
    (event,) = bench.notes.events
    assert (event.kind, event.text) == (EventKind.WARNING, "2.5")


@pytest.mark.parametrize("text", ["{two words}", "{}", "50 } %"])
def test_say_refuses_a_bad_text(text: str) -> None:
    with pytest.raises(InputError, match="belongs to no placeholder"):
        Say(None, text=text)
