"""Limits and speeds: set for a flight, and put back after it."""

from __future__ import annotations

import math

import pytest

from tests.sim_bridge.olympe.fake_olympe import FakeSdkDrone, FakeWorld, bridge
from uav_bt.types import Command, MoveBy, TakeOff

MAX_TILT = "ardrone3.PilotingSettings.MaxTilt"
RETURN_HOME = "rth.set_auto_trigger_mode"


def with_firmware(version: str) -> FakeWorld:
    def announce(drone: FakeSdkDrone) -> None:
        drone.event("common.SettingsState.ProductVersionChanged", software=version, hardware="1")
        drone.event(
            "ardrone3.PilotingSettingsState.MaxTiltChanged", current=20.0, min=1.0, max=40.0
        )
        drone.event("rth.auto_trigger_mode", mode="on")

    world = FakeWorld()
    world.on_connect = announce
    return world


def test_what_was_set_before_is_put_back() -> None:
    world = with_firmware("1.8.2")
    drone = bridge(world, return_home=False)
    drone.connect()
    drone.send(Command(movement=TakeOff()))
    sent = dict(world.drone.sent)
    assert sent[MAX_TILT] == {"current": pytest.approx(10.0)}
    assert sent[RETURN_HOME] == {"mode": "off"}
    world.drone.event(
        "ardrone3.PilotingSettingsState.MaxTiltChanged", current=10.0, min=1.0, max=40.0
    )
    world.drone.sent.clear()
    drone.disconnect()
    assert world.drone.sent == [(MAX_TILT, {"current": 20.0}), (RETURN_HOME, {"mode": "on"})]


def test_who_only_looked_has_nothing_to_put_back() -> None:
    world = with_firmware("1.8.2")
    drone = bridge(world)
    drone.connect()
    drone.disconnect()
    assert world.drone.sent == []


def test_a_drone_that_is_gone_is_not_asked() -> None:
    world = with_firmware("1.8.2")
    drone = bridge(world)
    drone.connect()
    drone.send(Command(movement=TakeOff()))
    world.drone.sent.clear()
    world.drone.connected = False
    drone.disconnect()
    assert world.drone.sent == []


def test_without_a_wish_the_return_home_stays_as_it_is() -> None:
    world = with_firmware("1.8.2")
    drone = bridge(world)
    drone.connect()
    drone.send(Command(movement=TakeOff()))
    assert RETURN_HOME not in dict(world.drone.sent)


def fly_a_metre(world: FakeWorld) -> dict[str, dict[str, object]]:
    drone = bridge(world, speed_limit_mps=0.4, climb_limit_mps=0.3, yaw_rate_limit_radps=1.0)
    drone.connect()
    world.drone.event("ardrone3.PilotingState.FlyingStateChanged", state="hovering")
    drone.send(Command(movement=MoveBy(id=1, forward_m=1.0, yaw_rad=0.5)))
    return dict(world.drone.sent)


@pytest.mark.parametrize("version", ["1.7.0", "1.8.2", "2.0.0-rc1"])
def test_a_movement_keeps_the_speed_limits(version: str) -> None:
    sent = fly_a_metre(with_firmware(version))
    assert sent["move.extended_move_by"] == {
        "d_x": 1.0,
        "d_y": 0.0,
        "d_z": 0.0,
        "d_psi": 0.5,
        "max_horizontal_speed": 0.4,
        "max_vertical_speed": 0.3,
        "max_yaw_rotation_speed": pytest.approx(math.degrees(1.0)),
    }
    assert sent[MAX_TILT] == {"current": pytest.approx(10.0)}


@pytest.mark.parametrize("version", ["1.6.9", ""])
def test_older_firmware_is_kept_slow_by_its_tilt(version: str) -> None:
    sent = fly_a_metre(with_firmware(version))
    assert "ardrone3.Piloting.moveBy" in sent
    assert sent[MAX_TILT] == {"current": pytest.approx(1.0)}  # the least that can be set
