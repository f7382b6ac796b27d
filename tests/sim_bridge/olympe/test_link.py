"""The connection with a blocking SDK, and the threads that use it."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Any

import pytest

from sim_bridge.olympe.drone import OlympeDrone
from sim_bridge.olympe.sdk import Sdk
from tests.sim_bridge.olympe.fake_olympe import SETTINGS, FakeSdkDrone, FakeWorld, config
from uav_bt.errors import DroneError
from uav_bt.types import (
    Command,
    CutMotors,
    GimbalTo,
    Hover,
    Land,
    MoveBy,
    Movement,
    Release,
    TakeOff,
    Velocity,
)

PATIENCE_S = 30.0
FLYING = "ardrone3.PilotingState.FlyingStateChanged"


class WatchedDrone:
    """A drone of the SDK that records the calling thread, and may block."""

    def __init__(self, drone: FakeSdkDrone, world: BlockingWorld) -> None:
        self._drone = drone
        self._world = world

    @property
    def connected(self) -> bool:
        return self._drone.connected

    @property
    def streaming(self) -> Any:
        return self._drone.streaming

    def __call__(self, message: Any) -> Any:
        self._world.note("send")
        return self._drone(message)

    def __getattr__(self, name: str) -> Any:
        called = getattr(self._drone, name)

        def noted(*args: Any, **given: Any) -> Any:
            self._world.note(name)
            return called(*args, **given)

        return noted


class BlockingWorld(FakeWorld):
    """A world whose SDK blocks in one call until it is released."""

    def __init__(self) -> None:
        super().__init__()
        self.blocks = ""  # name of the blocking call
        self.go, self.begun, self.destroyed = (threading.Event() for _ in range(3))
        self.calls: list[tuple[str, int]] = []
        make = self.sdk.classes.Drone
        self.sdk = Sdk(
            version=self.sdk.version,
            classes=type(
                "Classes", (), {"Drone": lambda _, host, **given: self._made(make, host, given)}
            )(),
            message=self.sdk.message,
            stream=self.sdk.stream,
        )

    def _made(self, make: Callable[..., FakeSdkDrone], host: str, given: Any) -> WatchedDrone:
        self.note("make")
        return WatchedDrone(make(host, **given), self)

    def note(self, call: str) -> None:
        self.calls.append((call, threading.get_ident()))
        if call == self.blocks:
            self.begun.set()
            assert self.go.wait(PATIENCE_S)
        if call == "destroy":
            self.destroyed.set()

    def bridge(self, **changes: Any) -> OlympeDrone:
        return OlympeDrone(config(**changes), sdk=lambda: self.sdk, probe_first=lambda _: False)

    def threads(self) -> set[int]:
        return {thread for _, thread in self.calls}

    def names(self) -> list[str]:
        return [name for name, _ in self.calls]


def say(drone: OlympeDrone, *movements: Movement) -> None:
    for movement in movements:
        drone.send(Command(movement=movement))


def soon(condition: Callable[[], bool]) -> bool:
    """Wait for a condition; return whether it became true in time."""
    end_s = time.monotonic() + PATIENCE_S / 2.0
    while not condition() and time.monotonic() < end_s:
        time.sleep(0.005)
    return condition()


def test_one_thread_makes_uses_and_destroys_the_object_of_the_sdk() -> None:
    world = BlockingWorld()
    drone = world.bridge()
    drone.connect()
    world.drone.event(FLYING, state="hovering")
    drone.send(Command(movement=Velocity(forward_mps=0.5), gimbal=GimbalTo(pitch_rad=-0.5)))
    assert soon(lambda: "piloting" in world.drone.names())
    say(drone, MoveBy(id=1, forward_m=0.3), Hover(), Release(), Land())
    drone.disconnect()
    assert world.destroyed.wait(PATIENCE_S)
    assert {"make", "subscribe", "connect", "send", "piloting", "stop_piloting", "destroy"} <= set(
        world.names()
    )
    assert len(world.threads()) == 1
    assert threading.get_ident() not in world.threads()


def test_a_drone_that_connects_too_late_is_let_go_by_the_thread_that_connected_it() -> None:
    world = BlockingWorld()
    world.blocks = "connect"
    drone = world.bridge(connect_limit_s=0.01)
    with pytest.raises(DroneError, match="not ready for commands after 0 s: restart it"):
        drone.connect()
    # The SDK is still connecting, so no other thread may use its object.
    assert world.names() == ["make", "subscribe", "connect"]
    assert world.drone.closed == []
    world.go.set()
    assert world.destroyed.wait(PATIENCE_S)
    assert world.drone.connected
    assert world.drone.closed == ["stop video", "disconnect", "destroy"]
    assert len(world.threads()) == 1
    assert world.drone.streaming.given == {}  # the video was not requested


def test_a_video_that_blocks_is_given_up_in_time() -> None:
    world = BlockingWorld()
    world.on_video = lambda _: world.note("play")
    world.blocks = "play"
    drone = world.bridge(video_limit_s=0.01)
    with pytest.raises(DroneError, match="sends no video"):
        drone.connect()
    assert world.drone.closed == []
    world.go.set()
    assert world.destroyed.wait(PATIENCE_S)
    assert len(world.threads()) == 1


def test_a_drone_that_does_not_disconnect_keeps_nobody(
    caplog: pytest.LogCaptureFixture,
) -> None:
    world = BlockingWorld()
    drone = world.bridge(command_limit_s=0.01, setting_limit_s=0.01, close_limit_s=0.01)
    drone.connect()
    world.blocks = "disconnect"
    drone.disconnect()
    assert "the SDK has not disconnected from anafi at 127.0.0.1:44445 within 0.03 s" in caplog.text
    world.go.set()
    assert world.destroyed.wait(PATIENCE_S)
    assert len(world.threads()) == 1


@pytest.mark.parametrize(
    ("movement", "order"),
    [(Land(), "Landing"), (CutMotors(), "Emergency"), (Release(), "stop_piloting")],
)
def test_no_setting_keeps_back_what_ends_a_flight(movement: Movement, order: str) -> None:
    """After a take-off by a pilot the limits are set in the air, without confirmation."""
    world = BlockingWorld()
    world.refused = set(SETTINGS)
    drone = world.bridge(setting_limit_s=PATIENCE_S)
    drone.connect()
    world.drone.event(FLYING, state="hovering")
    say(drone, Velocity(forward_mps=0.5))
    expected = "piloting" if isinstance(movement, Release) else "BankedTurn"  # the last setting
    assert soon(lambda: expected in world.drone.names())
    say(drone, movement)
    assert soon(lambda: order in world.drone.names())
    world.drone.connected = False  # a lost drone is not asked for a confirmation
    drone.disconnect()


@pytest.mark.parametrize("fails", ["piloting", "send", "disconnect"])
def test_one_good_bye_that_fails_stops_no_other(
    fails: str, caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    world = BlockingWorld()
    drone = world.bridge()
    drone.connect()
    world.drone.event(FLYING, state="hovering")
    say(drone, Velocity(forward_mps=0.5))
    assert soon(lambda: "piloting" in world.drone.names())
    note = world.note

    def failing(call: str) -> None:
        note(call)
        if call == fails:
            raise TimeoutError("no answer")

    monkeypatch.setattr(world, "note", failing)
    drone.disconnect()
    assert world.destroyed.wait(PATIENCE_S)
    assert "failed: TimeoutError: no answer" in caplog.text
    assert {"send", "disconnect", "destroy"} <= set(world.names())


def test_an_event_that_cannot_be_read_is_reported_once(caplog: pytest.LogCaptureFixture) -> None:
    world = BlockingWorld()
    drone = world.bridge()
    drone.connect()
    for _ in range(3):
        with pytest.raises(KeyError):
            world.drone.event("ardrone3.PilotingState.AltitudeChanged", height=1.0)
    (record,) = caplog.records
    assert record.getMessage() == (
        "the drone's data cannot be used: its event ardrone3.PilotingState.AltitudeChanged"
    )
    drone.disconnect()


def test_a_take_off_goes_out_after_the_limits() -> None:
    world = BlockingWorld()
    drone = world.bridge()
    drone.connect()
    say(drone, TakeOff())
    drone.disconnect()
    names = world.drone.names()
    assert names.index("BankedTurn") < names.index("TakeOff") < names.index("BankedTurn", 6)
