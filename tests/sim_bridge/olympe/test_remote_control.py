"""An ANAFI behind a SkyController: control by pilot and mission, and the age of telemetry."""

from __future__ import annotations

import pytest

from sim_bridge.olympe.drone import OlympeDrone
from tests.sim_bridge.olympe.fake_olympe import FakeSdkDrone, FakeWorld, Time, bridge
from uav_bt.errors import DroneError
from uav_bt.types import Command, FlyingState, Hover, Land, Release, TakeOff

SOURCE = "skyctrl.CoPilotingState.pilotingSource"
CONNECTION = "drone_manager.connection_state"


def announce(drone: FakeSdkDrone) -> None:
    """Send the first events of a SkyController with a drone."""
    drone.event(CONNECTION, state="connected", serial="PI", model=0x0914, name="ANAFI")
    drone.event(SOURCE, source="SkyController")


def behind_remote(world: FakeWorld, time: Time | None = None) -> OlympeDrone:
    world.on_connect = announce
    drone = bridge(world, time, remote=True)
    drone.connect()
    return drone


def say(drone: OlympeDrone, *movements: object) -> None:
    for movement in movements:
        drone.send(Command(movement=movement))  # type: ignore[arg-type]


def sources(world: FakeWorld) -> list[str]:
    return [args["source"] for name, args in world.drone.sent if "setPilotingSource" in name]


def test_looking_takes_nobodys_sticks() -> None:
    world = FakeWorld()
    drone = behind_remote(world)
    assert world.drone.given["sky"]
    assert not drone.observe().state.pilot_has_control
    say(drone, Release())
    assert sources(world) == []


def test_a_mission_takes_the_sticks_before_it_takes_off() -> None:
    world = FakeWorld()
    drone = behind_remote(world)
    say(drone, TakeOff())
    assert world.drone.names()[0] == "setPilotingSource"
    assert sources(world) == ["Controller"]


def test_the_pilot_gets_the_sticks_and_hands_them_back() -> None:
    world, time = FakeWorld(), Time()
    drone = behind_remote(world, time)
    say(drone, Hover())
    world.drone.event(SOURCE, source="Controller")
    say(drone, Release(), Release())
    assert sources(world) == ["Controller", "SkyController"]
    world.drone.event(SOURCE, source="SkyController")
    assert not drone.observe().state.pilot_has_control  # control was given, not taken
    time.now_s += 5.0
    say(drone, Hover())
    world.drone.event(SOURCE, source="Controller")
    say(drone, Hover())
    assert sources(world) == ["Controller", "SkyController", "Controller"]


def test_a_pilot_who_takes_the_sticks_keeps_them() -> None:
    world, time = FakeWorld(), Time()
    drone = behind_remote(world, time)
    say(drone, Hover())
    world.drone.event(SOURCE, source="Controller")
    world.drone.event(SOURCE, source="SkyController")
    assert drone.observe().state.pilot_has_control
    time.now_s += 5.0
    say(drone, Release(), Release())
    assert sources(world) == ["Controller"]


def test_a_landing_takes_the_sticks_and_is_sent_first() -> None:
    world = FakeWorld()
    drone = behind_remote(world)
    world.drone.event("ardrone3.PilotingState.FlyingStateChanged", state="hovering")
    say(drone, Land())
    assert world.drone.names() == ["Landing", "setPilotingSource"]


def test_the_sticks_are_given_back_in_the_end() -> None:
    world = FakeWorld()
    drone = behind_remote(world)
    say(drone, TakeOff())
    world.drone.event(SOURCE, source="Controller")
    drone.disconnect()
    assert sources(world)[-1] == "SkyController"


def test_the_sticks_are_given_back_where_the_remote_control_has_lost_its_drone() -> None:
    world = FakeWorld()
    drone = behind_remote(world)
    say(drone, TakeOff())
    world.drone.event(SOURCE, source="Controller")
    world.drone.event(CONNECTION, state="searching", serial="", model=0, name="")
    drone.disconnect()
    assert sources(world) == ["Controller", "SkyController"]


def test_a_remote_control_that_goes_on_talking_is_not_the_drone() -> None:
    world, time = FakeWorld(), Time()
    drone = behind_remote(world, time)
    world.drone.event("ardrone3.PilotingState.FlyingStateChanged", state="hovering")
    world.drone.event("ardrone3.PilotingState.AttitudeChanged", roll=0.0, pitch=0.0, yaw=0.0)
    world.drone.event("ardrone3.PilotingState.SpeedChanged", speedX=0.0, speedY=0.0, speedZ=0.0)
    world.drone.event("ardrone3.PilotingState.AltitudeChanged", altitude=1.5)
    heard_s = drone.observe().state.captured_s
    assert heard_s == time.now_s - 100.0
    for _ in range(300):
        time.now_s += 0.05
        world.drone.event("skyctrl.SkyControllerState.AttitudeChanged", q0=1.0)
    state = drone.observe().state
    assert (state.captured_s, state.flying) == (heard_s, FlyingState.HOVERING)
    assert state.connected
    world.drone.event(CONNECTION, state="searching", serial="", model=0, name="")
    state = drone.observe().state
    assert (state.connected, state.lost) == (False, False)  # the remote control may reconnect


def test_a_remote_control_without_a_drone_says_so_before_it_is_asked_for_video() -> None:
    world = FakeWorld()
    drone = bridge(world, remote=True, behind_limit_s=0.01)
    with pytest.raises(DroneError, match=r"no drone is connected to it: switch the drone on"):
        drone.connect()
    assert world.drone.streaming.given == {}


def test_what_was_never_reported_is_unknown() -> None:
    state = behind_remote(FakeWorld()).observe().state
    assert (state.battery, state.link) == (None, None)
