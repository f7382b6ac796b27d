"""An ANAFI through a scripted SDK: connecting, commands, and the sticks of a remote control."""

from __future__ import annotations

import asyncio
import concurrent.futures
import contextlib
import math
from typing import Any

import pytest

from sim_bridge.olympe import link
from sim_bridge.olympe.drone import OlympeDrone
from tests.sim_bridge.olympe.fake_olympe import (
    CLIMB,
    MAX_ALTITUDE,
    MAX_TILT,
    ROTATION,
    SETTINGS,
    FakeWorld,
    Time,
    bridge,
    hovering,
    say,
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

LIMITS = [name.rpartition(".")[2] for name in SETTINGS][:5]


# --- connecting -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("version", "made"),
    [
        ((8, 5, 0), {"http_port": 8080, "discovery_port": 44445}),
        ((7, 7, 5), {"media_port": 8080, "media_autoconnect": False}),
    ],
)
def test_connecting_starts_the_video_and_changes_nothing(version: Any, made: Any) -> None:
    world = FakeWorld(version)
    bridge(world, http_port=8080, rtsp_port=8554).connect()
    assert (world.drone.host, world.drone.given) == ("127.0.0.1", made)
    assert world.drone.played == {"port": 8554, "timeout": 5.0}
    assert world.drone.on_frame is not None
    assert world.drone.sent == []


def test_the_older_sdk_cannot_use_another_discovery_port() -> None:
    drone = bridge(FakeWorld((7, 7, 5)), address="127.0.0.1:45000")
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
    assert [made.closed for made in world.made] == [["stop video", "disconnect", "destroy"]] * 3


def test_a_drone_that_refuses_is_disconnected() -> None:
    world = FakeWorld()
    world.answers = False
    with pytest.raises(DroneError, match=r"anafi at 127\.0\.0\.1:44445 refused the connection"):
        bridge(world).connect()
    assert world.drone.closed == ["disconnect", "destroy"]


@pytest.mark.parametrize("version", [(7, 7, 5), (8, 5, 0)])
@pytest.mark.parametrize(
    "fault", [TimeoutError(), concurrent.futures.CancelledError(), asyncio.CancelledError()]
)
def test_no_video_is_reported_at_once(version: tuple[int, ...], fault: BaseException) -> None:
    world = FakeWorld(version)
    world.video_fault = fault
    with pytest.raises(DroneError, match=r"sends no video \(RTSP port 554\) within 5 s"):
        bridge(world).connect()
    assert world.drone.closed == ["stop video", "disconnect", "destroy"]


@pytest.mark.parametrize("call", ["observe", "send"])
def test_an_unconnected_drone_says_so(call: str) -> None:
    drone = bridge(FakeWorld())
    with pytest.raises(DroneError, match="is not connected: call connect"):
        drone.observe() if call == "observe" else drone.send(Command(movement=Hover()))


# --- commands -------------------------------------------------------------------------------------


@pytest.mark.parametrize("movement", [TakeOff(), MoveBy(id=1, forward_m=1.0)])
def test_the_limits_are_set_before_the_first_movement_and_only_then(movement: Movement) -> None:
    world = FakeWorld()
    drone = bridge(world, altitude_limit_m=2.0, yaw_rate_limit_radps=math.pi / 2)
    drone.connect()
    say(drone, Hover(), Land(), movement, movement)
    assert world.drone.names()[:-1] == LIMITS
    sent = dict(world.drone.sent)
    assert sent[MAX_ALTITUDE] == {"current": 2.0}
    assert sent[ROTATION] == {"current": pytest.approx(90.0)}


def test_a_take_off_is_commanded_once_and_again_while_it_has_no_effect() -> None:
    world, time = FakeWorld(), Time()
    drone = bridge(world, time)
    drone.connect()
    for _ in range(5):
        say(drone, TakeOff())
        time.now_s += 0.3
    assert world.drone.names() == [*LIMITS, "TakeOff", "TakeOff"]
    world.drone.flies("motor_ramping")
    time.now_s += 5.0
    say(drone, TakeOff())
    assert world.drone.names() == [*LIMITS, "TakeOff", "TakeOff"]


def test_a_landing_is_commanded_until_the_drone_lands() -> None:
    world, time = FakeWorld(), Time()
    drone = hovering(world, time)
    say(drone, Land(), Land())
    time.now_s += 1.5
    say(drone, Land())
    world.drone.flies("landing")
    time.now_s += 1.5
    say(drone, Land())
    assert world.drone.names() == ["Landing", "Landing"]


def test_a_landing_comes_before_all_that_may_fail() -> None:
    world = FakeWorld()
    drone = hovering(world)
    say(drone, Velocity(forward_mps=0.5))
    world.steers = False
    with contextlib.suppress(DroneError):
        say(drone, Velocity(forward_mps=0.5))
    world.drone.sent.clear()
    say(drone, Land())
    assert world.drone.names() == ["Landing", "piloting", "stop_piloting"]


def test_motors_are_cut_at_once() -> None:
    world = FakeWorld()
    say(hovering(world), CutMotors())
    assert world.drone.names() == ["Emergency"]


def moved(drone: OlympeDrone) -> MovementStatus | None:
    return drone.observe().state.movement


def end(world: FakeWorld, error: str, *flown: float) -> None:
    distances = dict(zip(("dX", "dY", "dZ", "dPsi"), (*flown, 0.0, 0.0, 0.0, 0.0), strict=False))
    world.drone.event("ardrone3.PilotingEvent.moveByEnd", error=error, **distances)


def test_a_movement_is_sent_once_and_runs_until_its_end_event() -> None:
    world = FakeWorld()
    drone = hovering(world)
    move = MoveBy(id=7, forward_m=0.3, yaw_rad=0.1)
    say(drone, move, move, move)
    assert world.drone.sent == [
        ("ardrone3.Piloting.moveBy", {"dX": 0.3, "dY": 0.0, "dZ": 0.0, "dPsi": 0.1})
    ]
    assert moved(drone) == MovementStatus(id=7, state=MovementState.RUNNING)
    end(world, "ok", 0.3)
    say(drone, move)
    assert moved(drone) == MovementStatus(id=7, state=MovementState.DONE)
    assert len(world.drone.sent) == 1


def test_hovering_ends_a_movement_by_one_of_zero() -> None:
    world = FakeWorld()
    drone = hovering(world)
    say(drone, Hover())
    assert world.drone.sent == []
    say(drone, MoveBy(id=1, forward_m=1.0), Hover(), Hover())
    assert world.drone.names() == ["moveBy", "moveBy"]
    assert set(world.drone.sent[1][1].values()) == {0.0}
    for error in ("interrupted", "ok"):
        end(world, error)
        assert moved(drone) == MovementStatus(id=1, state=MovementState.INTERRUPTED)


FIRST, SECOND = (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.49)


@pytest.mark.parametrize(
    ("ends", "state"),
    [
        ([("interrupted", FIRST)], MovementState.RUNNING),
        ([("interrupted", FIRST), ("ok", SECOND)], MovementState.DONE),
        ([("ok", FIRST)], MovementState.RUNNING),  # it crossed the second command
        ([("ok", SECOND)], MovementState.DONE),  # the event of the first was lost
        ([("ok", FIRST), ("ok", SECOND), ("ok", FIRST)], MovementState.DONE),
        *(([(error, (0.0,))], MovementState.REJECTED) for error in ("busy", "notAvailable")),
    ],
)
def test_an_end_event_counts_for_the_movement_of_its_distance(
    ends: list[tuple[str, tuple[float, ...]]], state: MovementState
) -> None:
    world = FakeWorld()
    drone = hovering(world)
    say(drone, MoveBy(id=1, forward_m=1.0), MoveBy(id=2, yaw_rad=0.5))
    for error, flown in ends:
        end(world, error, *flown)
    assert moved(drone) == MovementStatus(id=2, state=state)


def test_landing_ends_a_movement_that_never_ended() -> None:
    world = FakeWorld()
    drone = hovering(world)
    end(world, "ok")
    assert moved(drone) is None
    say(drone, MoveBy(id=3, forward_m=0.3))
    world.drone.flies("landing")
    assert moved(drone) == MovementStatus(id=3, state=MovementState.INTERRUPTED)


@pytest.mark.parametrize("firmware", ["1.7.0", "1.8.2", "2.0.0-rc1", "1.6.9", ""])
def test_a_movement_keeps_the_speed_limits(firmware: str) -> None:
    """Older firmware takes no speeds; it is slowed by the least tilt that can be set."""
    world = FakeWorld(firmware=firmware)
    drone = bridge(world, speed_limit_mps=0.4, climb_limit_mps=0.3, yaw_rate_limit_radps=1.0)
    drone.connect()
    world.drone.flies()
    say(drone, MoveBy(id=1, forward_m=1.0, yaw_rad=0.5))
    sent = dict(world.drone.sent)
    old = firmware in {"1.6.9", ""}
    assert sent[MAX_TILT] == {"current": pytest.approx(1.0 if old else 10.0)}
    assert sent.get("move.extended_move_by") == (
        None
        if old
        else {
            "d_x": 1.0,
            "d_y": 0.0,
            "d_z": 0.0,
            "d_psi": 0.5,
            "max_horizontal_speed": 0.4,
            "max_vertical_speed": 0.3,
            "max_yaw_rotation_speed": pytest.approx(math.degrees(1.0)),
        }
    )
    assert ("ardrone3.Piloting.moveBy" in sent) is old


# --- sticks ---------------------------------------------------------------------------------------


def test_velocities_are_held_by_the_sticks_and_a_hover_centres_them() -> None:
    world = FakeWorld(firmware="1.8.2")
    drone = hovering(world)
    say(drone, Velocity(forward_mps=0.5, yaw_rate_radps=0.8, down_mps=0.3), Hover())
    (_, held), (_, centred) = world.drone.sent
    roll, pitch, yaw, climb = held["sticks"]
    assert (roll, yaw, climb, held["for_s"]) == (0, 50, -50, 0.5)
    assert 0 < pitch < 100
    assert centred == {"sticks": (0, 0, 0, 0), "for_s": 0.0}


@pytest.mark.parametrize(
    ("setting", "reported", "sticks"),
    [
        (ROTATION, 160.0, (0, 29, -50)),  # 0.8 rad/s are 45.8 degrees per second
        (CLIMB, 0.1, (0, 50, -100)),  # the least of an ANAFI is more than was wanted
        (CLIMB, 1.2, (0, 50, -25)),
    ],
)
def test_sticks_are_shares_of_the_limits_that_the_drone_reports(
    setting: str, reported: float, sticks: tuple[int, int, int]
) -> None:
    world = FakeWorld(firmware="1.8.2")
    drone = hovering(world)
    event, argument, _ = SETTINGS[setting]
    world.drone.event(event, **{argument: reported})
    say(drone, Velocity(yaw_rate_radps=0.8, down_mps=0.3))
    roll, _, yaw, climb = world.drone.sent[0][1]["sticks"]
    assert (roll, yaw, climb) == sticks


def test_a_tilt_limit_that_was_not_taken_halves_the_stick() -> None:
    pitches = []
    for refused in (set[str](), {MAX_TILT}):  # then the limit stays at 20 degrees
        world = FakeWorld(firmware="1.8.2")
        world.refused = refused
        drone = hovering(world)
        say(drone, Velocity(forward_mps=1.0))
        pitches.append(world.drone.sent[0][1]["sticks"][1])
    assert pitches[1] == pytest.approx(pitches[0] / 2, abs=1)


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
    say(drone, Velocity(forward_mps=0.5))
    assert world.drone.sent == []


def test_a_command_is_returned_as_it_was_sent() -> None:
    sent = hovering(FakeWorld()).send(
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


def test_the_gimbal_is_set_against_the_horizon_when_its_target_changes() -> None:
    world = FakeWorld()
    drone = hovering(world)
    for pitch_rad in (-0.5, -0.5, -math.pi / 2):
        drone.send(Command(movement=Hover(), gimbal=GimbalTo(pitch_rad=pitch_rad)))
    assert world.drone.names() == ["set_target", "set_target"]
    target = world.drone.sent[1][1]
    assert target["pitch"] == pytest.approx(-90.0)
    assert target["pitch_frame_of_reference"] == "absolute"
    assert target["control_mode"] == "position"


def test_an_sdk_that_refuses_the_sticks_is_an_error() -> None:
    world = FakeWorld()
    drone = hovering(world)
    world.steers = False
    with pytest.raises(DroneError, match="no longer accepts stick positions"):
        say(drone, Velocity(forward_mps=0.5))


# --- a remote control -----------------------------------------------------------------------------

CONNECTION = "drone_manager.connection_state"


class Remote:
    """A drone behind a SkyController, which has just been connected."""

    def __init__(self) -> None:
        self.world, self.time = FakeWorld(), Time()
        self.world.on_connect = lambda drone: drone.event(CONNECTION, state="connected")
        self.drone = bridge(self.world, self.time, remote=True)
        self.drone.connect()
        self.turns_to("SkyController")

    def turns_to(self, source: str) -> None:
        self.world.drone.event("skyctrl.CoPilotingState.pilotingSource", source=source)

    def loses_the_drone(self) -> None:
        self.world.drone.event(CONNECTION, state="searching")

    @property
    def sources(self) -> list[str]:
        sent = self.world.drone.sent
        return [args["source"] for name, args in sent if "setPilotingSource" in name]


def test_looking_takes_no_sticks() -> None:
    remote = Remote()
    assert remote.world.drone.given["sky"]
    assert remote.world.drone.played["port"] is None
    assert not remote.drone.observe().state.pilot_has_control
    say(remote.drone, Release())
    assert remote.sources == []


def test_the_pilot_gets_the_sticks_and_hands_them_back() -> None:
    remote = Remote()
    say(remote.drone, TakeOff())
    assert remote.world.drone.names()[0] == "setPilotingSource"
    remote.turns_to("Controller")
    say(remote.drone, Release(), Release())
    assert remote.sources == ["Controller", "SkyController"]
    remote.turns_to("SkyController")
    assert not remote.drone.observe().state.pilot_has_control  # control was given, not taken
    remote.time.now_s += 5.0
    say(remote.drone, Hover())
    remote.turns_to("Controller")
    say(remote.drone, Hover())
    assert remote.sources == ["Controller", "SkyController", "Controller"]


def test_a_pilot_who_takes_the_sticks_keeps_them() -> None:
    remote = Remote()
    say(remote.drone, Hover())
    remote.turns_to("Controller")
    remote.turns_to("SkyController")
    assert remote.drone.observe().state.pilot_has_control
    remote.time.now_s += 5.0
    say(remote.drone, Release(), Release())
    assert remote.sources == ["Controller"]


def test_a_landing_takes_the_sticks_and_is_sent_first() -> None:
    remote = Remote()
    remote.world.drone.flies()
    say(remote.drone, Land())
    assert remote.world.drone.names() == ["Landing", "setPilotingSource"]


@pytest.mark.parametrize("lost", [False, True])
def test_the_sticks_are_given_back_in_the_end_also_if_the_drone_is_lost(*, lost: bool) -> None:
    remote = Remote()
    say(remote.drone, TakeOff())
    remote.turns_to("Controller")
    if lost:
        remote.loses_the_drone()
    remote.drone.disconnect()
    assert remote.sources == ["Controller", "SkyController"]


def test_a_remote_control_without_its_drone_is_heard_but_not_the_drone() -> None:
    remote = Remote()
    event, started_s = remote.world.drone.event, remote.time.now_s
    remote.world.drone.flies()
    event("ardrone3.PilotingState.AttitudeChanged", roll=0.0, pitch=0.0, yaw=0.0)
    event("ardrone3.PilotingState.SpeedChanged", speedX=0.0, speedY=0.0, speedZ=0.0)
    event("ardrone3.PilotingState.AltitudeChanged", altitude=1.5)
    heard_s = remote.drone.observe().state.captured_s
    assert heard_s == started_s - 100.0
    for _ in range(300):
        remote.time.now_s += 0.05
        event("skyctrl.SkyControllerState.AttitudeChanged", q0=1.0)
    state = remote.drone.observe().state
    assert (state.captured_s, state.flying) == (heard_s, FlyingState.HOVERING)
    assert state.connected
    remote.loses_the_drone()
    state = remote.drone.observe().state
    assert (state.connected, state.lost) == (False, False)  # the remote control may reconnect


def test_a_remote_control_without_a_drone_is_reported_before_video_is_requested(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(link, "BEHIND_LIMIT_S", 0.01)
    world = FakeWorld()
    with pytest.raises(DroneError, match="no drone is connected to it: switch the drone on"):
        bridge(world, remote=True).connect()
    assert world.drone.played == {}
