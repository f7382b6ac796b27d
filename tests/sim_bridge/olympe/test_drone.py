"""An ANAFI through a scripted SDK: commands, events and frames."""

from __future__ import annotations

import asyncio
import concurrent.futures
import contextlib
import math
import threading
from dataclasses import replace

import numpy as np
import pytest

from sim_bridge.olympe.drone import OlympeDrone
from tests.sim_bridge.olympe.fake_olympe import (
    LEVEL,
    FakeFrame,
    FakeSdkDrone,
    FakeWorld,
    Time,
    bridge,
    config,
)
from uav_bt.errors import DroneError, InputError
from uav_bt.types import (
    Command,
    CutMotors,
    FlyingState,
    GimbalTo,
    Hover,
    Land,
    MoveBy,
    Movement,
    MovementState,
    MovementStatus,
    Release,
    TakeOff,
    Velocity,
)

STATE = "ardrone3.PilotingState."
SETTINGS = [
    "MaxTilt",
    "MaxAltitude",
    "MaxVerticalSpeed",
    "MaxRotationSpeed",
    "BankedTurn",
]


def hovering(world: FakeWorld, time: Time | None = None) -> OlympeDrone:
    """Return a drone in the air with its limits set."""
    drone = bridge(world, time)
    drone.connect()
    say(drone, TakeOff())
    world.drone.event(f"{STATE}FlyingStateChanged", state="hovering")
    world.drone.sent.clear()
    return drone


def say(drone: OlympeDrone, *movements: Movement) -> None:
    for movement in movements:
        drone.send(Command(movement=movement))


def end(world: FakeWorld, error: str = "ok", *flown: float) -> None:
    distances = dict(zip(("dX", "dY", "dZ", "dPsi"), (*flown, 0.0, 0.0, 0.0, 0.0), strict=False))
    world.drone.event("ardrone3.PilotingEvent.moveByEnd", error=error, **distances)


# --- connecting -----------------------------------------------------------------------------------


def test_connecting_starts_the_video_and_changes_nothing() -> None:
    world = FakeWorld()
    bridge(world).connect()
    assert world.drone.sent == []
    assert world.drone.streaming.given["port"] == 554


@pytest.mark.parametrize("movement", [TakeOff(), MoveBy(id=1, forward_m=1.0)])
def test_the_limits_are_set_before_the_first_movement_and_only_then(movement: Movement) -> None:
    world = FakeWorld()
    drone = bridge(world, altitude_limit_m=2.0, yaw_rate_limit_radps=math.pi / 2)
    drone.connect()
    say(drone, Hover(), Land(), movement, movement)
    assert world.drone.names()[:-1] == SETTINGS
    sent = dict(world.drone.sent)
    assert sent["ardrone3.PilotingSettings.MaxAltitude"] == {"current": 2.0}
    assert sent["ardrone3.SpeedSettings.MaxRotationSpeed"] == {"current": pytest.approx(90.0)}


def test_ports_go_to_the_sdk() -> None:
    world = FakeWorld()
    bridge(world, http_port=8080, rtsp_port=8554).connect()
    assert world.drone.host == "127.0.0.1"
    assert world.drone.given == {"http_port": 8080, "discovery_port": 44445}
    assert world.drone.streaming.given["port"] == 8554


def test_the_older_sdk_is_called_by_its_own_names() -> None:
    world = FakeWorld((7, 7, 5))
    bridge(world, http_port=8080).connect()
    assert world.drone.given == {"media_port": 8080, "media_autoconnect": False}
    assert "raw_cb" in world.drone.streaming.callbacks
    assert "raw_cb" not in world.drone.streaming.given


def test_the_older_sdk_cannot_use_another_discovery_port() -> None:
    world = FakeWorld((7, 7, 5))
    drone = OlympeDrone(
        replace(config(), address="127.0.0.1:45000"),
        sdk=lambda: world.sdk,
        probe_first=lambda _: False,
    )
    with pytest.raises(InputError, match="always discovers on port 44445, asked for 45000"):
        drone.connect()


def test_each_connection_has_an_sdk_object_of_its_own() -> None:
    world = FakeWorld()
    drone = bridge(world)
    for _ in range(3):
        drone.connect()
        drone.connect()
        drone.disconnect()
        drone.disconnect()
    assert len(world.made) == 3
    assert [made.closed[:2] for made in world.made] == [["stop video", "disconnect"]] * 3


def test_a_drone_that_answers_the_port_only_is_given_up_in_time() -> None:
    world = FakeWorld()
    never = threading.Event()
    world.on_connect = lambda _: never.wait() and None
    drone = OlympeDrone(
        replace(config(), connect_limit_s=0.0),
        sdk=lambda: world.sdk,
        probe_first=lambda _: False,
    )
    with pytest.raises(DroneError, match="not ready for commands after 0 s: restart it"):
        drone.connect()
    never.set()


def test_a_drone_that_refuses_is_let_go() -> None:
    world = FakeWorld()
    world.answers = False
    with pytest.raises(DroneError, match=r"anafi at 127\.0\.0\.1:44445 refused the connection"):
        bridge(world).connect()
    assert world.drone.closed[:1] == ["disconnect"]


@pytest.mark.parametrize("version", [(7, 7, 5), (8, 5, 0)])
@pytest.mark.parametrize(
    "fault", [TimeoutError(), concurrent.futures.CancelledError(), asyncio.CancelledError()]
)
def test_no_video_is_reported_at_once(version: tuple[int, ...], fault: BaseException) -> None:
    world = FakeWorld(version)
    world.video = False
    world.video_fault = fault
    with pytest.raises(DroneError, match=r"sends no video \(RTSP port 554\) within 5 s"):
        bridge(world).connect()
    assert world.drone.closed[:2] == ["stop video", "disconnect"]


@pytest.mark.parametrize("call", ["observe", "send"])
def test_an_unconnected_drone_says_so(call: str) -> None:
    drone = bridge(FakeWorld())
    with pytest.raises(DroneError, match="is not connected: call connect"):
        drone.observe() if call == "observe" else drone.send(Command(movement=Hover()))


# --- commands -------------------------------------------------------------------------------------


def test_taking_off_is_ordered_once_and_again_when_nothing_came_of_it() -> None:
    world, time = FakeWorld(), Time()
    drone = bridge(world, time)
    drone.connect()
    for _ in range(5):
        say(drone, TakeOff())
        time.now_s += 0.3
    assert world.drone.names() == [*SETTINGS, "TakeOff", "TakeOff"]
    world.drone.event(f"{STATE}FlyingStateChanged", state="motor_ramping")
    time.now_s += 5.0
    say(drone, TakeOff())
    assert world.drone.names()[len(SETTINGS) :] == ["TakeOff", "TakeOff"]


def test_landing_is_ordered_until_the_drone_lands() -> None:
    world, time = FakeWorld(), Time()
    drone = hovering(world, time)
    say(drone, Land(), Land())
    time.now_s += 1.5
    say(drone, Land())
    world.drone.event(f"{STATE}FlyingStateChanged", state="landing")
    time.now_s += 1.5
    say(drone, Land())
    assert world.drone.names() == ["Landing", "Landing"]


def test_a_movement_is_sent_once_and_runs_until_its_end_event() -> None:
    world = FakeWorld()
    drone = hovering(world)
    move = MoveBy(id=7, forward_m=0.3, yaw_rad=0.1)
    say(drone, move, move, move)
    assert world.drone.sent == [
        ("ardrone3.Piloting.moveBy", {"dX": 0.3, "dY": 0.0, "dZ": 0.0, "dPsi": 0.1})
    ]
    assert drone.observe().state.movement == MovementStatus(id=7, state=MovementState.RUNNING)
    end(world, "ok", 0.3)
    say(drone, move)
    assert drone.observe().state.movement == MovementStatus(id=7, state=MovementState.DONE)
    assert len(world.drone.sent) == 1


def test_hovering_ends_a_movement_by_one_by_nothing() -> None:
    world = FakeWorld()
    drone = hovering(world)
    say(drone, MoveBy(id=1, forward_m=1.0), Hover(), Hover())
    assert world.drone.names() == ["moveBy", "moveBy"]
    assert set(world.drone.sent[1][1].values()) == {0.0}
    end(world, "interrupted", 0.4)
    assert drone.observe().state.movement == MovementStatus(id=1, state=MovementState.INTERRUPTED)
    end(world, "ok")
    assert drone.observe().state.movement == MovementStatus(id=1, state=MovementState.INTERRUPTED)


def test_hovering_without_a_movement_tells_nothing() -> None:
    world = FakeWorld()
    say(hovering(world), Hover(), Hover())
    assert world.drone.sent == []


def test_velocities_hold_the_sticks_for_half_a_second() -> None:
    world = FakeWorld()
    world.on_connect = lambda drone: drone.event(
        "common.SettingsState.ProductVersionChanged", software="1.8.2", hardware="1"
    )
    drone = hovering(world)
    say(drone, Velocity(forward_mps=0.5, yaw_rate_radps=0.8, down_mps=0.3), Hover())
    (_, held), (_, centred) = world.drone.sent
    roll, pitch, yaw, climb = held["sticks"]
    assert (roll, yaw, climb) == (0, 50, -50)
    assert 0 < pitch < 100
    assert held["for_s"] == 0.5
    assert centred == {"sticks": (0, 0, 0, 0), "for_s": 0.0}


def test_sticks_are_let_go_before_a_movement_and_for_a_pilot() -> None:
    world = FakeWorld()
    drone = hovering(world)
    turn = Velocity(yaw_rate_radps=0.8)
    say(drone, turn, MoveBy(id=1, forward_m=0.3), turn, Release(), Release())
    assert world.drone.names() == [
        *("piloting", "piloting", "stop_piloting", "moveBy"),
        *("moveBy", "piloting", "piloting", "stop_piloting"),
    ]


def test_on_the_ground_no_sticks_are_held() -> None:
    world = FakeWorld()
    drone = bridge(world)
    drone.connect()
    world.drone.sent.clear()
    say(drone, Velocity(forward_mps=0.5))
    assert world.drone.sent == []


def test_a_command_is_returned_as_it_was_sent() -> None:
    drone = hovering(FakeWorld())
    sent = drone.send(
        Command(
            movement=Velocity(forward_mps=3.0, right_mps=4.0, down_mps=-9.0, yaw_rate_radps=9.0),
            gimbal=GimbalTo(pitch_rad=0.5),
        )
    )
    assert isinstance(sent.movement, Velocity)
    assert sent.movement.forward_mps == pytest.approx(0.6)
    assert sent.movement.right_mps == pytest.approx(0.8)
    assert (sent.movement.down_mps, sent.movement.yaw_rate_radps) == (-0.6, 1.6)
    assert sent.gimbal == GimbalTo(pitch_rad=0.0)


def test_the_gimbal_is_pointed_against_the_horizon_when_it_should_change() -> None:
    world = FakeWorld()
    drone = hovering(world)
    for pitch_rad in (-0.5, -0.5, -math.pi / 2):
        drone.send(Command(movement=Hover(), gimbal=GimbalTo(pitch_rad=pitch_rad)))
    assert world.drone.names() == ["set_target", "set_target"]
    target = world.drone.sent[1][1]
    assert target["pitch"] == pytest.approx(-90.0)
    assert target["pitch_frame_of_reference"] == "absolute"
    assert target["control_mode"] == "position"


def test_motors_are_cut_at_once() -> None:
    world = FakeWorld()
    say(hovering(world), CutMotors())
    assert world.drone.names() == ["Emergency"]


def test_a_landing_comes_before_anything_that_may_fail() -> None:
    world = FakeWorld()
    drone = hovering(world)
    say(drone, Velocity(forward_mps=0.5))
    world.steers = False
    for _ in range(3):
        with contextlib.suppress(DroneError):
            say(drone, Velocity(forward_mps=0.5))
    world.drone.sent.clear()
    say(drone, Land())
    assert world.drone.names() == ["Landing", "piloting", "stop_piloting"]


def test_a_broken_connection_is_seen_at_once() -> None:
    world = FakeWorld()
    drone = hovering(world)
    assert drone.observe().state.connected
    assert not drone.observe().state.lost
    world.drone.connected = False
    state = drone.observe().state
    assert (state.connected, state.lost) == (False, True)


def test_an_sdk_that_refuses_the_sticks_is_an_error() -> None:
    world = FakeWorld()
    drone = hovering(world)
    world.steers = False
    with pytest.raises(DroneError, match="no longer accepts stick positions"):
        say(drone, Velocity(forward_mps=0.5))


# --- events ---------------------------------------------------------------------------------------


def test_events_become_a_state() -> None:
    world, time = FakeWorld(), Time()
    drone = bridge(world, time, take_off_surface_m=0.4)
    drone.connect()
    time.now_s += 3.0
    tell = world.drone.event
    tell(f"{STATE}FlyingStateChanged", state=FakeState("flying"))
    tell(f"{STATE}AttitudeChanged", roll=0.1, pitch=-0.2, yaw=math.pi / 2)
    tell(f"{STATE}SpeedChanged", speedX=0.0, speedY=0.5, speedZ=-0.1)
    tell(f"{STATE}AltitudeChanged", altitude=1.5)
    tell("common.CommonState.BatteryStateChanged", percent=63)
    tell("common.CommonState.LinkSignalQuality", value=0x80 | 4)
    tell("gimbal.attitude", gimbal_id=0, pitch_absolute=-30.0, pitch_relative=3.0)
    state = drone.observe().state
    assert state.captured_s == 3.0
    assert state.flying is FlyingState.FLYING
    assert (state.attitude.roll_rad, state.attitude.pitch_rad) == (0.1, -0.2)
    assert state.velocity.forward_mps == pytest.approx(0.5)
    assert state.velocity.right_mps == pytest.approx(0.0)
    assert state.velocity.down_mps == -0.1
    assert (state.altitude_m, state.height_m) == (1.5, pytest.approx(1.55))
    assert state.height_above_ground_m == pytest.approx(1.95)
    assert state.gimbal_pitch_rad == pytest.approx(math.radians(-30))
    assert (state.battery, state.link) == (0.63, 0.8)
    assert not state.pilot_has_control


def measure(world: FakeWorld, *quantities: str) -> None:
    """Report quantities, by default attitude, velocity and altitude."""
    events: dict[str, tuple[str, dict[str, float]]] = {
        "attitude": ("AttitudeChanged", {"roll": 0.0, "pitch": 0.0, "yaw": 0.0}),
        "velocity": ("SpeedChanged", {"speedX": 0.35, "speedY": 0.0, "speedZ": 0.0}),
        "altitude": ("AltitudeChanged", {"altitude": 1.5}),
    }
    for quantity in quantities or events:
        name, values = events[quantity]
        world.drone.event(f"{STATE}{name}", **values)


class FakeState:
    """A member of an enumeration of the SDK."""

    def __init__(self, name: str) -> None:
        self.name = name


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("landed", FlyingState.LANDED),
        ("motor_ramping", FlyingState.TAKING_OFF),
        ("takingoff", FlyingState.TAKING_OFF),
        ("hovering", FlyingState.HOVERING),
        ("landing", FlyingState.LANDING),
        ("emergency_landing", FlyingState.LANDING),
        ("emergency", FlyingState.EMERGENCY),
    ],
)
def test_every_flying_state_is_known(name: str, expected: FlyingState) -> None:
    world = FakeWorld()
    drone = bridge(world)
    drone.connect()
    world.drone.event(f"{STATE}FlyingStateChanged", state=name)
    assert drone.observe().state.flying is expected


def test_what_we_send_is_no_sign_of_life() -> None:
    world, time = FakeWorld(), Time()
    drone = hovering(world, time)
    measure(world)
    time.now_s += 2.0
    say(drone, MoveBy(id=1, forward_m=0.3))
    assert drone.observe().state.captured_s == 0.0
    measure(world)
    assert drone.observe().state.captured_s == 2.0


def test_the_state_is_as_old_as_attitude_speed_and_altitude_whatever_else_is_heard() -> None:
    world, time = FakeWorld(), Time()
    drone = hovering(world, time)
    measure(world)
    for _ in range(200):  # 10 s of 20 events a second
        time.now_s += 0.05
        world.drone.event("gimbal.attitude", gimbal_id=0, pitch_absolute=-30.0)
        world.drone.event("camera.zoom_level", cam_id=0, level=1.0)
        world.drone.event(f"{STATE}FlyingStateChanged", state="hovering")
    state = drone.observe().state
    assert drone.clock.now() - state.captured_s == pytest.approx(10.0)
    assert state.times.gimbal_s == pytest.approx(10.0)


@pytest.mark.parametrize("silent", ["attitude", "velocity", "altitude"])
def test_the_state_is_as_old_as_its_oldest_part(silent: str) -> None:
    world, time = FakeWorld(), Time()
    drone = hovering(world, time)
    measure(world)
    time.now_s += 3.0
    measure(world, *({"attitude", "velocity", "altitude"} - {silent}))
    state = drone.observe().state
    assert state.captured_s == getattr(state.times, f"{silent}_s") == 0.0


def test_a_measured_height_has_its_own_time_and_a_computed_one_the_altitudes() -> None:
    world, time = FakeWorld(), Time()
    drone = hovering(world, time)
    measure(world)
    assert drone.observe().state.times.height_s == 0.0
    world.drone.event(f"{STATE}AltitudeAboveGroundChanged", altitude=1.2)
    time.now_s += 1.0
    measure(world)
    times = drone.observe().state.times
    assert (times.altitude_s, times.height_s) == (1.0, 0.0)


def test_a_drone_that_never_reported_its_speed_is_infinitely_old() -> None:
    world = FakeWorld()
    drone = hovering(world)
    measure(world, "attitude", "altitude")
    assert drone.observe().state.captured_s == -math.inf


def test_landing_ends_a_movement_that_was_never_ended() -> None:
    world = FakeWorld()
    drone = hovering(world)
    say(drone, MoveBy(id=3, forward_m=0.3))
    world.drone.event(f"{STATE}FlyingStateChanged", state="landing")
    assert drone.observe().state.movement == MovementStatus(id=3, state=MovementState.INTERRUPTED)


# --- video ----------------------------------------------------------------------------------------


def grey(level: int) -> np.ndarray:
    planes = np.full((36, 32), 128, np.uint8)
    planes[:24] = level
    return planes


def deliver(drone: FakeSdkDrone, frame: FakeFrame) -> None:
    drone.streaming.raw_cb(frame)
    assert frame.references == 0


def test_only_the_newest_frame_is_seen_with_what_was_true_then() -> None:
    world, time = FakeWorld(), Time()
    drone = hovering(world, time)
    assert drone.observe().frame is None
    down = {"w": math.cos(-0.25), "x": 0.0, "y": math.sin(-0.25), "z": 0.0}
    vmeta = {
        "drone": {"quat": LEVEL, "ground_distance": 0.7, "altitude_ato": 1.1},
        "camera": {"quat": down, "timestamp": 5_000_000},
    }
    for level in (16, 235):
        deliver(world.drone, FakeFrame(grey(level), vmeta))
    frame = drone.observe().frame
    assert frame is not None
    assert frame.image.shape == (360, 640, 3)
    assert frame.image.min() > 250
    assert frame.index == 1
    assert frame.captured_s == pytest.approx(-0.15)
    assert frame.gimbal_pitch_rad == pytest.approx(-0.5)
    assert (frame.altitude_m, frame.height_m) == (1.1, 0.7)
    assert frame.height_above_ground_m == pytest.approx(1.15)
    assert drone.observe().frame is frame


def test_a_frame_that_says_nothing_is_given_the_state() -> None:
    world = FakeWorld()
    drone = hovering(world)
    world.drone.event(f"{STATE}AltitudeChanged", altitude=1.3)
    world.drone.event("gimbal.attitude", pitch_absolute=-45.0)
    deliver(world.drone, FakeFrame(grey(99)))
    frame = drone.observe().frame
    assert frame is not None
    assert frame.altitude_m == 1.3
    assert frame.gimbal_pitch_rad == pytest.approx(math.radians(-45))


def test_a_video_that_stops_leaves_a_frame_that_grows_old() -> None:
    world, time = FakeWorld(), Time()
    drone = hovering(world, time)
    deliver(world.drone, FakeFrame(grey(99)))
    time.now_s += 7.0
    frame = drone.observe().frame
    assert frame is not None
    assert drone.clock.now() - frame.captured_s == pytest.approx(7.15)


def test_a_frame_wakes_the_clock() -> None:
    world, time = FakeWorld(), Time()
    drone = hovering(world, time)
    drone.observe()
    time.on_wait = lambda: deliver(world.drone, FakeFrame(grey(99)))
    began_s = drone.clock.now()
    drone.clock.sleep_until(began_s)
    assert drone.clock.now() == began_s
