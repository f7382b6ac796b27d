"""An ANAFI through a scripted SDK: connecting, commands, and the sticks of a remote control."""

from __future__ import annotations

import asyncio
import math
from dataclasses import astuple
from typing import Any

import pytest

from tests.sim_bridge.olympe.fake_olympe import (
    CLIMB,
    MAX_ALTITUDE,
    MAX_TILT,
    ROTATION,
    SETTINGS,
    FakeWorld,
    Flight,
)
from uav_bt.errors import DroneError, InputError
from uav_bt.types import (
    Command,
    CutMotors,
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

LIMITS = [name.rpartition(".")[2] for name in SETTINGS][:5]
LET_GO = ["piloting", "stop_piloting"]
MOVE, TURN = MoveBy(id=1, forward_m=1.0), Velocity(yaw_rate_radps=0.8)


@pytest.mark.parametrize(
    ("version", "made"),
    [
        ((8, 5, 0), {"http_port": 8080, "discovery_port": 44445}),
        ((7, 7, 5), {"media_port": 8080, "media_autoconnect": False}),
    ],
)
def test_connecting_starts_the_video_and_changes_nothing(version: Any, made: Any) -> None:
    sdk = Flight(FakeWorld(version), http_port=8080, rtsp_port=8554).sdk
    assert (sdk.host, sdk.given) == ("127.0.0.1", made)
    assert sdk.played == {"port": 8554, "timeout": 5.0}
    assert sdk.on_frame is not None
    assert sdk.sent == []


def test_each_connection_has_an_sdk_object_of_its_own() -> None:
    flight = Flight()
    for _ in range(3):
        flight.drone.connect()
        flight.drone.disconnect()
        flight.drone.disconnect()
    closed = [sdk.closed for sdk in flight.world.made]
    assert closed == [["stop", "disconnect", "destroy"]] * 3


@pytest.mark.parametrize(
    ("world", "message"),
    [
        (FakeWorld(answers=False), r"anafi at 127\.0\.0\.1:44445 refused the connection"),
        (FakeWorld(video_fault=TimeoutError()), r"sends no video \(RTSP port 554\)"),
        (FakeWorld(video_fault=asyncio.CancelledError()), "another program may use it"),
    ],
)
def test_a_drone_that_refuses_is_disconnected(world: FakeWorld, message: str) -> None:
    flight = Flight(world, connect=False)
    with pytest.raises(DroneError, match=message):
        flight.drone.connect()
    assert flight.sdk.closed[-2:] == ["disconnect", "destroy"]
    assert ("stop" in flight.sdk.closed) is world.answers


def test_the_older_sdk_cannot_use_another_discovery_port() -> None:
    with pytest.raises(InputError, match="always discovers on port 44445, asked for 45000"):
        Flight(FakeWorld((7, 7, 5)), address="127.0.0.1:45000")


@pytest.mark.parametrize(
    ("steps", "sent"),
    [
        # The limits are set before the first movement only.
        ([Hover(), Land(), TakeOff(), TakeOff()], [*LIMITS, "TakeOff"]),
        ([Hover(), Land(), MOVE, MOVE], [*LIMITS, "moveBy"]),
        # A take-off and a landing are repeated while they have no effect.
        ([TakeOff(), 0.6, TakeOff(), 0.6, TakeOff()], [*LIMITS, "TakeOff", "TakeOff"]),
        ([TakeOff(), "motor_ramping", 5.0, TakeOff()], [*LIMITS, "TakeOff"]),
        (["hovering", Land(), Land(), 1.5, Land(), "landing", 1.5, Land()], ["Landing", "Landing"]),
        (["hovering", CutMotors()], ["Emergency"]),
        # The drone lands already, or has cut its motors.
        *((["hovering", state, Land()], []) for state in ("emergency_landing", "emergency")),
        # On the ground no sticks are held.
        ([Velocity(forward_mps=0.5)], []),
        (["hovering", Hover()], []),
        # A hover ends a movement by one of zero.
        (["hovering", MOVE, Hover(), Hover()], [*LIMITS, "moveBy", "moveBy"]),
        # Sticks are let go before a movement and for a pilot.
        (["hovering", TURN, MOVE], [*LIMITS, "piloting", *LET_GO, "moveBy"]),
        (["hovering", MOVE, TURN], [*LIMITS, "moveBy", "moveBy", "piloting"]),
        (["hovering", TURN, Release(), Release()], [*LIMITS, "piloting", *LET_GO]),
    ],
)
def test_only_changes_are_sent(steps: list[Any], sent: list[str]) -> None:
    assert Flight().play(*steps) == sent


def test_sticks_that_the_sdk_refuses_are_an_error_which_a_landing_precedes() -> None:
    flight = Flight()
    flight.play("hovering", TURN)
    flight.world.steers = False
    with pytest.raises(DroneError, match="no longer accepts stick positions"):
        flight.play(TURN)
    flight.sdk.sent.clear()
    assert flight.play(Land()) == ["Landing", "piloting", "stop_piloting"]


FIRST, SECOND = {"dX": 1.0}, {"dPsi": 0.49}


@pytest.mark.parametrize(
    ("ends", "state"),
    [
        ([("interrupted", FIRST)], MovementState.RUNNING),
        ([("interrupted", FIRST), ("ok", SECOND)], MovementState.DONE),
        ([("ok", FIRST)], MovementState.RUNNING),  # it crossed the second command
        ([("ok", SECOND)], MovementState.DONE),  # the event of the first was lost
        ([("ok", FIRST), ("ok", SECOND), ("ok", FIRST)], MovementState.DONE),
        *(([(error, {})], MovementState.REJECTED) for error in ("busy", "notAvailable")),
        ([("landing", {}), ("ok", SECOND)], MovementState.INTERRUPTED),
    ],
)
def test_an_end_event_counts_for_the_movement_of_its_distance(
    ends: list[tuple[str, dict[str, float]]], state: MovementState
) -> None:
    flight = Flight()
    flight.play("hovering", MOVE, MoveBy(id=2, yaw_rad=0.5))
    for error, flown in ends:
        if error == "landing":  # it ends all movements
            flight.play(error)
        else:
            end = {**dict.fromkeys(("dX", "dY", "dZ", "dPsi"), 0.0), **flown}
            flight.sdk.event("ardrone3.PilotingEvent.moveByEnd", error=error, **end)
    assert flight.state.movement == MovementStatus(id=2, state=state)


@pytest.mark.parametrize(
    ("firmware", "tilt_deg", "name", "values"),
    [
        # Older firmware takes no speeds; it is slowed by the least tilt that can be set.
        *((old, 1.0, "moveBy", []) for old in ("1.6.9", "")),
        *((new, 10.0, "extended_move_by", [0.4, 0.3, 45.0]) for new in ("1.7.0", "2.0.0-rc1")),
    ],
)
def test_a_movement_keeps_the_speed_limits(
    firmware: str, tilt_deg: float, name: str, values: list[float]
) -> None:
    limits = {"speed_limit_mps": 0.4, "climb_limit_mps": 0.3, "yaw_rate_limit_radps": math.pi / 4}
    flight = Flight(FakeWorld(firmware=firmware), altitude_limit_m=2.0, **limits)
    flight.play("hovering", MoveBy(id=1, forward_m=1.0, yaw_rad=0.5), Hover())
    *limiting, (moved, args), (_, halt) = flight.sdk.sent
    sent = dict(limiting)
    assert sent[MAX_TILT] == {"current": pytest.approx(tilt_deg)}
    assert sent[MAX_ALTITUDE] == {"current": 2.0}
    assert sent[ROTATION] == {"current": pytest.approx(45.0)}
    assert moved.rpartition(".")[2] == name
    assert [*args.values()] == pytest.approx([1.0, 0.0, 0.0, 0.5, *values])
    assert set(halt.values()) == {0.0}


def test_a_command_is_returned_as_it_was_sent() -> None:
    order = Velocity(forward_mps=3.0, right_mps=4.0, down_mps=-9.0, yaw_rate_radps=9.0)
    sent = Flight().drone.send(Command(movement=order, gimbal=GimbalTo(pitch_rad=0.5)))
    assert astuple(sent.movement) == pytest.approx((0.6, 0.8, -0.6, 1.6))
    assert sent.gimbal == GimbalTo(pitch_rad=0.0)


def test_the_gimbal_is_set_against_the_horizon_when_its_target_changes() -> None:
    flight = Flight()
    for pitch_rad in (-0.5, -0.5, -math.pi / 2):
        flight.drone.send(Command(movement=Hover(), gimbal=GimbalTo(pitch_rad=pitch_rad)))
    _, target = flight.sdk.args("gimbal.set_target")
    assert target["pitch"] == pytest.approx(-90.0)
    assert (target["pitch_frame_of_reference"], target["control_mode"]) == ("absolute", "position")


@pytest.mark.parametrize(
    ("setting", "reported", "sticks"),
    [
        (MAX_TILT, 20.0, (0, 17, 50, -50)),  # the limit was not taken
        (ROTATION, 160.0, (0, 35, 29, -50)),
        (CLIMB, 0.1, (0, 35, 50, -100)),  # less than was wanted
        (CLIMB, 1.2, (0, 35, 50, -25)),
        (CLIMB, 0.0, (0, 35, 50, -50)),  # no limit of a drone: the wanted one
    ],
)
def test_sticks_are_shares_of_the_limits_that_the_drone_reports(
    setting: str, reported: float, sticks: tuple[int, ...]
) -> None:
    flight = Flight(FakeWorld(firmware="1.8.2"))
    flight.play("hovering", MOVE)
    event, argument, _ = SETTINGS[setting]
    flight.sdk.event(event, **{argument: reported})
    flight.play(Velocity(forward_mps=0.5, yaw_rate_radps=0.8, down_mps=0.3), Hover())
    held, centred = flight.sdk.args("piloting")
    assert held == {"sticks": sticks, "for_s": 0.5}
    assert centred == {"sticks": (0, 0, 0, 0), "for_s": 0.0}
