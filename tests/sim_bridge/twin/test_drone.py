"""Reactions of the twin to commands, as of an ANAFI."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from sim_bridge.twin import TwinConfig
from sim_bridge.twin.drone import TwinDrone
from tests.sim_bridge.twin.lab_world import fly
from uav_bt.errors import DroneError, UnknownNameError, ValueRangeError
from uav_bt.protocols import Clock, Drone, Referee
from uav_bt.types import (
    Command,
    CutMotors,
    FlyingState,
    GimbalTo,
    Hover,
    Land,
    MoveBy,
    MovementState,
    Release,
    TakeOff,
    Truth,
    Velocity,
)

MakeTwin = Callable[..., TwinDrone]


def truth(drone: TwinDrone) -> Truth:
    assert drone.referee is not None
    return drone.referee.truth()


def test_it_keeps_the_protocols(make_twin: MakeTwin) -> None:
    """Drone, clock and referee implement the protocols of the framework."""
    drone = make_twin()
    assert isinstance(drone, Drone)
    assert isinstance(drone.clock, Clock)
    assert isinstance(drone.referee, Referee)


def test_nothing_works_before_connecting_and_disconnecting_twice_is_fine() -> None:
    """An unconnected twin has no referee, and its error gives a remedy; disconnecting is safe."""
    drone = TwinConfig().create()
    assert drone.referee is None
    for use in (drone.observe, drone.clock.now, lambda: drone.send(Command(movement=Hover()))):
        with pytest.raises(DroneError, match="connect"):
            use()
    drone.disconnect()
    drone.disconnect()


def test_a_second_connection_starts_the_flight_anew(make_twin: MakeTwin) -> None:
    """After a disconnection the drone is at its start again, at time 0."""
    drone = make_twin(airborne=True)
    drone.disconnect()
    drone.connect()
    assert drone.clock.now() == 0.0
    assert drone.observe().state.flying is FlyingState.LANDED


def test_take_off_climbs_to_a_metre_and_hovers(make_twin: MakeTwin) -> None:
    """From the pad at 0.4 m: spin-up, climb to 1.0 m above the start, hover within 4.5 s."""
    drone = make_twin()
    assert drone.observe().state.height_above_ground_m == pytest.approx(0.45, abs=0.01)
    fly(drone, TakeOff(), 0.5)
    assert drone.observe().state.flying is FlyingState.TAKING_OFF
    state = fly(drone, TakeOff(), 4.0).state
    assert state.flying is FlyingState.HOVERING
    assert state.altitude_m == pytest.approx(1.0, abs=0.03)
    assert state.height_m == pytest.approx(1.05, abs=0.03)
    assert state.height_above_ground_m == pytest.approx(1.45, abs=0.03)


@pytest.mark.parametrize(
    ("move", "shift", "turn"),
    [
        (MoveBy(id=1, forward_m=0.8), (0.8, 0.0, 0.0), 0.0),
        (MoveBy(id=1, right_m=0.4), (0.0, -0.4, 0.0), 0.0),
        (MoveBy(id=1, down_m=-0.5), (0.0, 0.0, 0.5), 0.0),
        (MoveBy(id=1, yaw_rad=1.2), (0.0, 0.0, 0.0), -1.2),
        (MoveBy(id=1, forward_m=0.5, down_m=0.3, yaw_rad=-2.5), (0.5, 0.0, -0.3), 2.5),
        (MoveBy(id=1, yaw_rad=4.0), (0.0, 0.0, 0.0), -4.0),
    ],
)
def test_a_movement_arrives_where_it_was_sent(
    make_twin: MakeTwin, move: MoveBy, shift: tuple[float, float, float], turn: float
) -> None:
    """Forward, right, down and clockwise are measured in the body frame of the start."""
    drone = make_twin(airborne=True)
    before = truth(drone).pose
    state = fly(drone, move, 5.0).state
    assert state.movement is not None
    assert (state.movement.id, state.movement.state) == (1, MovementState.DONE)
    after = truth(drone).pose
    c, s = math.cos(before.yaw_rad), math.sin(before.yaw_rad)
    dx, dy = after.x_m - before.x_m, after.y_m - before.y_m
    moved = (c * dx + s * dy, c * dy - s * dx, after.z_m - before.z_m)
    assert moved == pytest.approx(shift, abs=0.03)
    off = math.remainder(after.yaw_rad - before.yaw_rad - turn, math.tau)
    assert off == pytest.approx(0.0, abs=0.03)


def test_a_movement_keeps_the_limits(make_twin: MakeTwin) -> None:
    """A movement of 2 m keeps 1.0 m/s and the configured acceleration, within 5 %."""
    drone = make_twin(airborne=True)
    speeds = []
    for _ in range(60):
        drone.send(Command(movement=MoveBy(id=1, forward_m=2.0)))
        drone.clock.sleep_until(drone.clock.now() + 0.05)
        speeds.append(drone.observe().state.velocity.forward_mps)
    assert 0.9 < max(speeds) < 1.05
    assert np.abs(np.diff(speeds)).max() / 0.05 < 1.2 * 1.3


def test_a_turn_is_clockwise_in_the_telemetry_and_counter_clockwise_in_the_world(
    make_twin: MakeTwin,
) -> None:
    """Parrot's yaw and the world's have opposite signs."""
    drone = make_twin(airborne=True)
    told, real = drone.observe().state.attitude.yaw_rad, truth(drone).pose.yaw_rad
    state = fly(drone, MoveBy(id=1, yaw_rad=0.5), 3.0).state
    assert state.attitude.yaw_rad - told == pytest.approx(0.5, abs=0.03)
    assert truth(drone).pose.yaw_rad - real == pytest.approx(-0.5, abs=0.03)


def test_a_new_movement_interrupts_the_one_in_progress(make_twin: MakeTwin) -> None:
    """A hover interrupts a movement; a new id replaces it at once."""
    drone = make_twin(airborne=True)
    fly(drone, MoveBy(id=1, forward_m=1.5), 0.5)
    state = fly(drone, Hover(), 0.2).state
    assert state.movement is not None
    assert state.movement.state is MovementState.INTERRUPTED
    state = fly(drone, MoveBy(id=2, yaw_rad=0.3), 0.2).state
    assert state.movement is not None
    assert (state.movement.id, state.movement.state) == (2, MovementState.RUNNING)


def test_a_repeated_movement_is_not_begun_again(make_twin: MakeTwin) -> None:
    """The same id, sent at each tick and after its end, is flown once."""
    drone = make_twin(airborne=True)
    before = truth(drone).pose
    fly(drone, MoveBy(id=7, forward_m=0.5), 6.0)
    after = truth(drone).pose
    assert math.hypot(after.x_m - before.x_m, after.y_m - before.y_m) == pytest.approx(
        0.5, abs=0.03
    )


def test_a_movement_on_the_ground_is_rejected(make_twin: MakeTwin) -> None:
    """Before take-off a movement is REJECTED, and the drone does not move."""
    drone = make_twin()
    state = fly(drone, MoveBy(id=3, forward_m=1.0), 0.5).state
    assert state.movement is not None
    assert (state.movement.id, state.movement.state) == (3, MovementState.REJECTED)
    assert not truth(drone).motors_on


def test_velocity_piloting_is_limited_and_ends_with_a_release(make_twin: MakeTwin) -> None:
    """The returned velocity is flown; after a release the drone stops."""
    drone = make_twin(airborne=True)
    order = Command(movement=Velocity(forward_mps=3.0, right_mps=4.0, yaw_rate_radps=9.0))
    sent = drone.send(order).movement
    assert isinstance(sent, Velocity)
    assert math.hypot(sent.forward_mps, sent.right_mps) == pytest.approx(1.0)
    assert sent.forward_mps / sent.right_mps == pytest.approx(0.75)
    assert sent.yaw_rate_radps == pytest.approx(1.4)
    state = fly(drone, Velocity(forward_mps=0.4), 1.5).state
    assert state.velocity.forward_mps == pytest.approx(0.4, abs=0.03)
    state = fly(drone, Release(), 2.0).state
    assert state.velocity.forward_mps == pytest.approx(0.0, abs=0.03)
    assert state.flying is FlyingState.HOVERING


def test_landing_stops_the_motors_on_the_pad(make_twin: MakeTwin) -> None:
    """From the hover above the pad it descends, touches, and is LANDED with the motors off."""
    drone = make_twin(airborne=True)
    fly(drone, Land(), 0.5)
    assert drone.observe().state.flying is FlyingState.LANDING
    state = fly(drone, Land(), 5.0).state
    assert state.flying is FlyingState.LANDED
    now = truth(drone)
    assert not now.motors_on
    assert now.on_mark
    assert now.landing_error_m < 0.03
    assert now.pose.z_m == pytest.approx(0.45, abs=0.01)


def test_landing_is_taken_back_by_a_take_off(make_twin: MakeTwin) -> None:
    """As on the ANAFI, a take-off during the descent holds the height; a hover does not."""
    drone = make_twin(airborne=True)
    fly(drone, Land(), 0.5)
    assert fly(drone, Hover(), 0.3).state.flying is FlyingState.LANDING
    assert fly(drone, TakeOff(), 2.0).state.flying is FlyingState.HOVERING


def test_cut_motors_let_it_fall(make_twin: MakeTwin) -> None:
    """The motors stop at once; it drops and ends LANDED."""
    drone = make_twin(airborne=True)
    drone.send(Command(movement=CutMotors()))
    drone.clock.sleep_until(drone.clock.now() + 0.2)
    assert drone.observe().state.flying is FlyingState.EMERGENCY
    assert not truth(drone).motors_on
    assert fly(drone, CutMotors(), 3.0).state.flying is FlyingState.LANDED
    assert truth(drone).pose.z_m < 0.6


def test_the_gimbal_is_a_channel_of_its_own(make_twin: MakeTwin) -> None:
    """It turns at its limited rate during any movement, and keeps its pitch without a command."""
    drone = make_twin()
    drone.send(Command(movement=TakeOff(), gimbal=GimbalTo(pitch_rad=-math.pi / 2)))
    drone.clock.sleep_until(0.5)
    assert -0.85 < drone.observe().state.gimbal_pitch_rad < -0.6
    state = fly(drone, Hover(), 1.0).state
    assert state.gimbal_pitch_rad == pytest.approx(-math.pi / 2, abs=0.01)


def test_commands_take_effect_after_computing_and_transmission(make_twin: MakeTwin) -> None:
    """In the lab profile a take-off sent at 0 is executed at 0.09 s, not before."""
    drone = make_twin(profile="lab-instant")
    drone.send(Command(movement=TakeOff()))
    drone.clock.sleep_until(0.08)
    assert drone.observe().state.flying is FlyingState.LANDED
    drone.clock.sleep_until(0.11)
    assert drone.observe().state.flying is FlyingState.TAKING_OFF


def test_frames_come_late_and_on_the_video_rate(make_twin: MakeTwin) -> None:
    """The age of the newest frame is between the latency and one video period more."""
    drone = make_twin(profile="lab")
    assert drone.observe().frame is None
    for tick in range(2, 20):
        drone.clock.sleep_until(0.1 * tick)
        frame = drone.observe().frame
        assert frame is not None
        age = drone.clock.now() - frame.captured_s
        assert 0.15 - 1e-6 <= age <= 0.15 + 1 / 30 + 0.01
        assert frame.index == pytest.approx(frame.captured_s * 30, abs=0.35)


def test_a_frame_is_drawn_once_and_carries_the_telemetry_of_its_capture(
    make_twin: MakeTwin,
) -> None:
    """Two observations give the same object; gimbal and height are those of the capture."""
    drone = make_twin(profile="lab")
    drone.send(Command(movement=TakeOff(), gimbal=GimbalTo(pitch_rad=-1.0)))
    drone.clock.sleep_until(0.5)
    seen = drone.observe()
    assert drone.observe().frame is seen.frame
    assert seen.frame is not None
    assert seen.frame.gimbal_pitch_rad > seen.state.gimbal_pitch_rad + 0.1
    fly(drone, TakeOff(), 1.7)
    seen = drone.observe()
    assert seen.frame is not None
    assert seen.frame.height_above_ground_m < seen.state.height_above_ground_m


def test_a_pilot_interrupts_and_is_not_interfered_with(make_twin: MakeTwin) -> None:
    """When a pilot takes control the movement ends, and further commands are ignored."""
    drone = make_twin(airborne=True)
    fly(drone, MoveBy(id=1, forward_m=1.5), 0.5)
    drone.pilot_has_control = True
    state = fly(drone, MoveBy(id=2, forward_m=1.0), 0.3).state
    assert state.pilot_has_control
    assert state.movement is not None
    assert (state.movement.id, state.movement.state) == (2, MovementState.REJECTED)
    assert fly(drone, Land(), 1.0).state.flying is FlyingState.HOVERING


def test_the_drone_never_sees_itself(make_twin: MakeTwin) -> None:
    """On the pad with the camera straight down, all pixels show the lab."""
    drone = make_twin()
    drone.send(Command(movement=Hover(), gimbal=GimbalTo(pitch_rad=-math.pi / 2)))
    drone.clock.sleep_until(2.0)
    frame = drone.observe().frame
    assert frame is not None
    assert drone.referee is not None
    ids = drone.referee.class_ids(frame, 160, 90)
    assert set(np.unique(ids)) <= {1, 2, 3}


def test_sleeping_into_the_past_changes_nothing(make_twin: MakeTwin) -> None:
    """The clock only advances."""
    drone = make_twin()
    drone.clock.sleep_until(0.5)
    drone.clock.sleep_until(0.2)
    assert drone.clock.now() == pytest.approx(0.5)


def test_real_time_keeps_pace_with_the_wall(
    make_twin: MakeTwin, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In real time the clock waits for the rest of each step after computing."""
    wall, slept = [100.0], []

    def sleep(duration_s: float) -> None:
        slept.append(duration_s)
        wall[0] += duration_s

    monkeypatch.setattr("time.monotonic", lambda: wall[0])
    monkeypatch.setattr("time.sleep", sleep)
    drone = make_twin(realtime=True)
    drone.clock.sleep_until(0.1)
    wall[0] += 0.04
    drone.clock.sleep_until(0.2)
    wall[0] += 1.0
    drone.clock.sleep_until(0.3)
    assert slept == pytest.approx([0.1, 0.06, 0.0], abs=1e-9)


def test_bad_options_are_refused_before_anything_is_built() -> None:
    """The errors of unknown names suggest a name; that of a negative seed has its value."""
    with pytest.raises(UnknownNameError, match="did you mean 'train-a'"):
        TwinConfig(scene="trian-a").create()
    with pytest.raises(UnknownNameError, match="did you mean 'harsh'"):
        TwinConfig(profile="harsch").create()
    with pytest.raises(ValueRangeError, match="-1"):
        TwinConfig(seed=-1).create()
    with pytest.raises(ValueRangeError, match="16:9"):
        TwinConfig(image_size_px=(640, 480)).create()


@pytest.mark.parametrize(("profile", "reach_m"), [("lab", 0.35), ("harsh", 0.9)])
def test_a_hover_wanders_but_not_away(make_twin: MakeTwin, profile: str, reach_m: float) -> None:
    """A hover of 30 s drifts within limits, and the telemetry is noisy but close."""
    drone = make_twin(profile=profile, airborne=True)
    start = truth(drone).pose
    far = 0.0
    altitude_errors = []
    for _ in range(30):
        state = fly(drone, Hover(), 1.0).state
        now = truth(drone).pose
        far = max(far, math.hypot(now.x_m - start.x_m, now.y_m - start.y_m))
        altitude_errors.append(state.height_above_ground_m - now.z_m)
    assert 0.01 < far < reach_m
    assert 0.003 < np.std(altitude_errors) < 0.1
    assert np.abs(altitude_errors).max() < 0.25
