"""Reactions of the twin to commands, as of an ANAFI, and the truth of its referee."""

from __future__ import annotations

import math
from dataclasses import astuple, replace

import numpy as np
import pytest

from sim_bridge.twin import TwinConfig
from sim_bridge.twin.model import build_model
from sim_bridge.twin.objects import Helipad, ObjectSpec
from sim_bridge.twin.render import Renderer
from sim_bridge.twin.scene import Scene
from tests.sim_bridge.twin.lab_world import MakeTwin, fly, truth
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
    MovementStatus,
    Release,
    TakeOff,
    Velocity,
)

WALL = Scene(
    name="wall",
    helipad=Helipad(position_m=(-1.5, -1.0)),
    objects=(
        ObjectSpec(kind="box-1", position_m=(2.0, 1.5), size_m=(0.4, 0.4, 1.0)),
        ObjectSpec(kind="box-1", position_m=(0.5, -1.0), size_m=(0.4, 1.0, 2.2)),
    ),
)


def test_it_keeps_the_protocols_and_each_connection_is_a_new_flight(make_twin: MakeTwin) -> None:
    drone = make_twin(airborne=True)
    assert isinstance(drone, Drone)
    assert isinstance(drone.clock, Clock)
    assert isinstance(drone.referee, Referee)
    drone.disconnect()
    drone.disconnect()
    assert drone.referee is None
    with pytest.raises(DroneError, match="connect"):
        drone.observe()
    drone.connect()
    assert drone.clock.now() == 0.0
    assert drone.observe().state.flying is FlyingState.LANDED


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"profile": "harsch"}, UnknownNameError, "did you mean 'harsh'"),
        ({"seed": -1}, ValueRangeError, "-1"),
        ({"image_size_px": (640, 480)}, ValueRangeError, "640x360"),
    ],
)
def test_bad_options_are_refused_before_anything_is_built(
    options: dict[str, object], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        TwinConfig(**options).create()


def test_a_flight_from_the_pad_and_back(make_twin: MakeTwin) -> None:
    """From the pad at 0.4 m: spin-up, climb to 1.0 m above the start, hover, landing."""
    drone = make_twin()
    fly(drone, Hover(), 0.2)
    assert truth(drone).contacts == ()
    state = fly(drone, TakeOff(), 0.5).state
    assert (state.flying, truth(drone).contacts) == (FlyingState.TAKING_OFF, ("mark",))
    assert state.height_above_ground_m == pytest.approx(0.45, abs=0.01)
    state = fly(drone, TakeOff(), 4.0).state
    assert state.flying is FlyingState.HOVERING
    assert state.altitude_m == pytest.approx(1.0, abs=0.03)
    assert state.height_m == pytest.approx(1.05, abs=0.03)
    assert state.height_above_ground_m == pytest.approx(1.45, abs=0.03)

    assert fly(drone, Land(), 0.5).state.flying is FlyingState.LANDING
    assert fly(drone, Hover(), 0.3).state.flying is FlyingState.LANDING
    assert fly(drone, TakeOff(), 2.0).state.flying is FlyingState.HOVERING  # takes it back
    assert fly(drone, Land(), 6.0).state.flying is FlyingState.LANDED
    end = truth(drone)
    assert (end.motors_on, end.on_mark) == (False, True)
    assert end.landing_error_m < 0.03
    assert end.pose.z_m == pytest.approx(0.45, abs=0.01)


@pytest.mark.parametrize(
    ("move", "shift", "turn"),
    [
        (MoveBy(id=1, forward_m=1.8), (1.8, 0.0, 0.0), 0.0),
        (MoveBy(id=1, right_m=0.4, down_m=-0.5), (0.0, -0.4, 0.5), 0.0),
        (MoveBy(id=1, forward_m=0.5, down_m=0.3, yaw_rad=-2.5), (0.5, 0.0, -0.3), 2.5),
        (MoveBy(id=1, yaw_rad=4.0), (0.0, 0.0, 0.0), -4.0),
    ],
)
def test_a_movement_arrives_once_where_it_was_sent(
    make_twin: MakeTwin, move: MoveBy, shift: tuple[float, float, float], turn: float
) -> None:
    """Forward, right, down and clockwise, in the body frame of the start; the world's yaw is not.

    The movement is sent at each tick and after its end. It keeps the limits within 5 %.
    """
    drone = make_twin(airborne=True)
    before, told, speeds = truth(drone).pose, drone.observe().state.attitude.yaw_rad, []
    for _ in range(60):
        state = fly(drone, move, 0.1).state
        speeds.append(state.velocity.forward_mps)
    assert max(speeds) < 1.05
    assert np.abs(np.diff(speeds)).max() / 0.1 < 1.2 * 1.3
    if move.forward_m > 1.0:
        assert max(speeds) > 0.9
    assert state.movement == MovementStatus(id=1, state=MovementState.DONE)
    after = truth(drone).pose
    forward_m, left_m = before.to_body(after.x_m, after.y_m)
    assert (forward_m, left_m, after.z_m - before.z_m) == pytest.approx(shift, abs=0.03)
    for off in (after.yaw_rad - before.yaw_rad - turn, state.attitude.yaw_rad - told + turn):
        assert math.remainder(off, math.tau) == pytest.approx(0.0, abs=0.03)


def test_a_movement_is_rejected_on_the_ground_and_ended_by_the_next(make_twin: MakeTwin) -> None:
    drone = make_twin()
    flown = []
    for move, duration_s in (
        (MoveBy(id=3, forward_m=1.0), 0.5),
        (TakeOff(), 4.5),
        (MoveBy(id=1, forward_m=1.5), 0.5),
        (Hover(), 0.2),
        (MoveBy(id=2, yaw_rad=0.3), 0.2),
    ):
        state = fly(drone, move, duration_s).state
        flown.append((state.flying.value, state.movement.id, state.movement.state.value))
    assert flown == [
        ("landed", 3, "rejected"),
        ("hovering", 3, "rejected"),
        ("flying", 1, "running"),
        ("flying", 1, "interrupted"),
        ("flying", 2, "running"),
    ]


def test_velocity_piloting_is_limited_and_ends_with_a_release(make_twin: MakeTwin) -> None:
    """The returned velocity is flown; after a release the drone stops."""
    drone = make_twin(airborne=True)
    order = Velocity(forward_mps=3.0, right_mps=4.0, down_mps=-2.0, yaw_rate_radps=9.0)
    sent = drone.send(Command(movement=order)).movement
    assert astuple(sent) == pytest.approx((0.6, 0.8, -0.6, 1.4))
    state = fly(drone, Velocity(forward_mps=0.4), 1.5).state
    assert state.velocity.forward_mps == pytest.approx(0.4, abs=0.03)
    state = fly(drone, Release(), 2.0).state
    assert state.velocity.forward_mps == pytest.approx(0.0, abs=0.03)
    assert state.flying is FlyingState.HOVERING


def test_cut_motors_let_it_fall(make_twin: MakeTwin) -> None:
    """The motors stop at once; it drops and ends LANDED."""
    drone = make_twin(airborne=True)
    assert fly(drone, CutMotors(), 0.2).state.flying is FlyingState.EMERGENCY
    assert not truth(drone).motors_on
    assert fly(drone, CutMotors(), 3.0).state.flying is FlyingState.LANDED
    assert truth(drone).pose.z_m < 0.6


def test_the_gimbal_turns_at_its_rate_and_sees_nothing_of_the_drone(make_twin: MakeTwin) -> None:
    """The camera's pitch is a channel of its own, kept without a command."""
    drone = make_twin()
    drone.send(Command(movement=Hover(), gimbal=GimbalTo(pitch_rad=-math.pi / 2)))
    drone.clock.sleep_until(0.5)
    assert -0.85 < drone.observe().state.gimbal_pitch_rad < -0.6
    seen = fly(drone, Hover(), 1.5)
    assert seen.state.gimbal_pitch_rad == pytest.approx(-math.pi / 2, abs=0.01)
    assert set(np.unique(drone.referee.class_ids(seen.frame, 160, 90))) <= {1, 2, 3}


def test_commands_take_effect_after_computing_and_transmission(make_twin: MakeTwin) -> None:
    """In the lab profile a take-off sent at 0 is executed at 0.09 s, not before."""
    drone = make_twin(profile="lab")
    drone.send(Command(movement=TakeOff()))
    drone.clock.sleep_until(0.09)
    assert not truth(drone).motors_on
    drone.clock.sleep_until(0.1)
    assert truth(drone).motors_on


def test_frames_come_late_with_the_telemetry_of_their_capture(make_twin: MakeTwin) -> None:
    """The age of the newest frame is between the latency and one video period more."""
    drone = make_twin(profile="lab")
    assert drone.observe().frame is None
    drone.send(Command(movement=TakeOff(), gimbal=GimbalTo(pitch_rad=-1.0)))
    for tick in range(2, 23):
        drone.clock.sleep_until(0.1 * tick)
        seen = drone.observe()
        assert drone.observe().frame is seen.frame
        assert drone.clock.now() - seen.state.captured_s >= 0.06 - 1e-6
        age_s = drone.clock.now() - seen.frame.captured_s
        assert 0.15 - 1e-6 <= age_s <= 0.15 + 1 / 30 + 0.01
        assert seen.frame.index == pytest.approx(seen.frame.captured_s * 30, abs=0.35)
        if tick == 5:
            assert seen.frame.gimbal_pitch_rad > seen.state.gimbal_pitch_rad + 0.1
    assert seen.frame.height_above_ground_m < seen.state.height_above_ground_m


@pytest.mark.parametrize(
    ("disturbance", "shift_m"),
    [({"wind_mps2": (0.2, -0.4)}, (0.05, -0.1)), ({"drift_mps": (0.05, 0.02)}, (0.4, 0.16))],
)
def test_a_steady_wind_pushes_and_a_drift_that_is_not_measured_carries_away(
    make_twin: MakeTwin,
    disturbance: dict[str, tuple[float, float]],
    shift_m: tuple[float, float],
) -> None:
    drone = make_twin(airborne=True)
    before = truth(drone).pose
    drone.disturb(**disturbance)
    fly(drone, Hover(), 8.0)
    after = truth(drone).pose
    assert (after.x_m - before.x_m, after.y_m - before.y_m) == pytest.approx(shift_m, abs=0.02)


@pytest.mark.parametrize(("profile", "reach_m"), [("lab", 0.35), ("harsh", 0.9)])
def test_a_hover_wanders_but_not_away(make_twin: MakeTwin, profile: str, reach_m: float) -> None:
    """A hover of 30 s drifts within limits, and the telemetry is noisy but close."""
    drone = make_twin(profile=profile, airborne=True)
    start = truth(drone).pose
    far_m, altitude_errors = 0.0, []
    for _ in range(30):
        state = fly(drone, Hover(), 1.0).state
        now = truth(drone).pose
        far_m = max(far_m, math.hypot(now.x_m - start.x_m, now.y_m - start.y_m))
        altitude_errors.append(state.height_above_ground_m - now.z_m)
    assert 0.01 < far_m < reach_m
    assert 0.003 < np.std(altitude_errors) < 0.1
    assert np.abs(altitude_errors).max() < 0.25


def test_the_clock_only_advances_and_keeps_pace_with_the_wall_in_real_time(
    make_twin: MakeTwin, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In real time it waits for the rest of each step after computing."""
    computed, slept = [100.0], [0.0]
    monkeypatch.setattr("time.monotonic", lambda: sum(computed + slept))
    monkeypatch.setattr("time.sleep", slept.append)
    drone = make_twin(realtime=True)
    for target_s, computing_s in ((0.1, 0.04), (0.2, 1.0), (0.3, 0.0), (0.15, 0.0)):
        drone.clock.sleep_until(target_s)
        computed.append(computing_s)
    assert slept[1:] == pytest.approx([0.1, 0.06, 0.0, 0.0], abs=1e-9)
    assert drone.clock.now() == pytest.approx(0.3)


def test_flying_into_a_box_is_a_contact_with_its_name(make_twin: MakeTwin) -> None:
    """The second box of a pattern, 1.68 m ahead."""
    drone = make_twin(scene=WALL)
    assert truth(drone).clearance_m == pytest.approx(1.68, abs=1e-3)
    fly(drone, TakeOff(), 4.5)
    assert truth(drone).contacts == ()
    truths = []
    for tick in range(60):
        fly(drone, Velocity(forward_mps=0.8 if tick < 32 else -0.8), 0.1)
        truths.append(truth(drone))
    assert {name for each in truths for name in each.contacts} == {"box-1-2"}
    assert min(each.clearance_m for each in truths) < 0.005
    assert truth(drone).contacts == ()


def test_landing_beside_the_pad_and_leaving_the_ground_are_measured(make_twin: MakeTwin) -> None:
    drone = make_twin(scene=replace(WALL, ground_size_m=(6.0, 4.0)), airborne=True)
    assert drone.referee.ground() == drone.scene.ground_plan
    fly(drone, MoveBy(id=1, forward_m=-1.3), 4.0)
    assert truth(drone).inside_ground
    fly(drone, MoveBy(id=3, forward_m=-0.5), 3.0)
    assert not truth(drone).inside_ground
    fly(drone, MoveBy(id=2, forward_m=2.8), 6.0)
    fly(drone, Land(), 6.0)
    end = truth(drone)
    assert (end.motors_on, end.on_mark, end.inside_ground) == (False, False, True)
    assert end.landing_error_m == pytest.approx(1.0, abs=0.05)
    assert end.pose.z_m == pytest.approx(0.05, abs=0.01)


def test_masks_and_depth_show_the_frame_s_own_view_for_thirty_seconds(make_twin: MakeTwin) -> None:
    """Ids and depth of an old frame are those of its capture; the referee knows its own frames."""
    drone = make_twin(profile="lab", airborne=True)
    frame, referee = drone.observe().frame, drone.referee
    fly(drone, MoveBy(id=1, yaw_rad=2.0), 3.0)
    ids, depth = referee.class_ids(frame, 320, 180), referee.depth(frame, 320, 180)
    camera = drone.simulation.capture_of(frame.index).camera
    with Renderer(build_model(drone.scene)) as renderer:
        want_ids, want_depth = renderer.ids_and_depth(camera, 320, 180)
    assert np.array_equal(ids, want_ids)
    assert np.array_equal(depth, want_depth)
    with pytest.raises(ValueRangeError, match="not of this flight"):
        referee.class_ids(replace(frame, captured_s=0.123), 64, 36)
    fly(drone, Hover(), 31.0)
    with pytest.raises(ValueRangeError, match="30 s"):
        referee.depth(frame, 64, 36)
