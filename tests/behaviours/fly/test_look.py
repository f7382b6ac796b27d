"""The small leaves: take off, hover for a while, point the camera, turn, messages, conditions."""

import math
from dataclasses import replace

import pytest

from behaviours.fly.look import CanReturn, HoverFor, Hovering, MovesOn, PointCamera, Say, Turn
from behaviours.fly.take_off import TakeOff
from tests.worlds.leaves import ended, step, wait
from tests.worlds.values import motion
from uav_bt.board import ELAPSED, FLIGHT_HEIGHT, FLIGHT_PITCH, ODOMETRY, PHASE, SITE_MAP
from uav_bt.board.keys import BATTERY_PER_MIN, BATTERY_SHARE, FLYING, HOME, UNKNOWN
from uav_bt.errors import InputError
from uav_bt.testing import LeafBench
from uav_bt.testing.world import drawn_map, live
from uav_bt.tree import Status
from uav_bt.types import BodyVelocity, FlyingState, GimbalTo, Hover, MissionPhase, MoveBy
from uav_bt.types import TakeOff as TakeOffCommand
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


# --- TakeOff --------------------------------------------------------------------------------------

AHEAD = GimbalTo(pitch_rad=math.radians(-30))


def on_the_ground(**attributes: object) -> LeafBench:
    bench = LeafBench(TakeOff, height_m=1.5, gimbal_deg=-30.0, **attributes)
    assert live(bench, flying=FlyingState.LANDED, height_m=0.45) is Status.RUNNING
    return bench


def test_from_the_ground_to_the_flight_height() -> None:
    bench = on_the_ground()
    assert (bench.proposed, bench.pointed) == (TakeOffCommand(), AHEAD)
    assert bench.board[PHASE] == "take-off"
    assert bench.board[FLIGHT_HEIGHT] == 1.5
    assert bench.board[FLIGHT_PITCH] == pytest.approx(math.radians(-30.0))
    live(bench, flying=FlyingState.TAKING_OFF, height_m=0.9)
    assert bench.proposed == TakeOffCommand()
    live(bench, height_m=1.0)
    climb = step(bench)
    assert climb.down_m == pytest.approx(-0.5)
    live(bench, height_m=1.3, flying=FlyingState.FLYING)
    assert bench.proposed == climb
    done = ended(bench)
    assert live(bench, seconds=1.0, height_m=1.52, movement=done) is Status.SUCCESS
    assert (bench.proposed, bench.pointed) == (None, None)


def test_it_waits_for_the_camera_and_needs_no_climb_within_a_decimetre() -> None:
    bench = LeafBench(TakeOff, height_m=1.5, gimbal_deg=-30.0)
    assert live(bench, height_m=1.42, gimbal_deg=-10.0) is Status.RUNNING
    assert (bench.proposed, bench.pointed) == (None, AHEAD)
    assert live(bench, height_m=1.42, gimbal_deg=-29.0) is Status.SUCCESS
    assert bench.pointed is None
    bench = LeafBench(TakeOff, height_m=1.0)
    live(bench, height_m=1.4)
    assert step(bench).down_m == pytest.approx(0.4)


def test_too_long_is_a_failure() -> None:
    bench = on_the_ground(give_up_s=5.0)
    assert wait(bench, 4.9, flying=FlyingState.LANDED) is Status.RUNNING
    assert live(bench, seconds=0.2, flying=FlyingState.LANDED) is Status.FAILURE
    assert (bench.proposed, bench.pointed) == (None, None)
    assert "landed" in bench.feedback


# --- CanReturn ------------------------------------------------------------------------------------


def bench_with(charge: float, per_min: float = 0.06, home_m: float = 4.0) -> LeafBench:
    bench = LeafBench(CanReturn, reserve=0.15)
    bench.board[FLYING] = 1.0
    bench.board[BATTERY_SHARE], bench.board[BATTERY_PER_MIN] = charge, per_min
    bench.board[HOME] = home_m
    return bench


def test_the_way_home_must_leave_the_reserve() -> None:
    for charge, per_min, home_m, status in (
        (0.20, 0.06, 4.0, Status.SUCCESS),  # 6 m at 0.4 m/s and 30 s: 45 s take 4.5 %
        (0.19, 0.06, 4.0, Status.FAILURE),
        (0.19, 0.04, 4.0, Status.SUCCESS),  # 3 %
        (0.20, 0.06, 8.0, Status.FAILURE),  # 60 s: 6 %
        (0.20, UNKNOWN, 4.0, Status.SUCCESS),  # 5 % a minute: 3.8 %
        (0.18, UNKNOWN, 4.0, Status.FAILURE),
        (UNKNOWN, 0.06, 4.0, Status.FAILURE),
    ):
        bench = bench_with(charge, per_min, home_m)
        assert bench.tick() is status
        assert (bench.feedback == "the battery is unknown") == (charge == UNKNOWN)


def test_in_a_gap_of_the_odometry_the_last_distance_counts() -> None:
    bench = bench_with(0.5, home_m=UNKNOWN)
    assert bench.tick() is Status.FAILURE, "the distance was never known"
    bench.board[HOME] = 4.0
    assert bench.tick() is Status.SUCCESS
    bench.board[HOME] = UNKNOWN
    assert bench.tick() is Status.SUCCESS
    bench.board[BATTERY_SHARE] = 0.19
    assert bench.tick() is Status.FAILURE
    bench.board[FLYING] = 0.0
    assert bench.tick() is Status.SUCCESS, "on the ground it is at home"


def test_a_route_of_the_map_replaces_the_estimated_detour() -> None:
    """In an empty hall the way is straight: 4 m and the last metre, not 6 m."""
    site_map = drawn_map(ground_m=10.0, pose=(4.0, 0.0, 0.0))
    bench = bench_with(0.194)  # 5 m: 4.25 %, and 6 m would take 4.5 %
    assert bench.tick() is Status.FAILURE
    bench.clock.advance(3.0)
    bench.board[SITE_MAP] = replace(site_map, captured_s=bench.clock.now())
    assert bench.tick() is Status.SUCCESS
