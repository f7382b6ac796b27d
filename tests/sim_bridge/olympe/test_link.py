"""The thread of commands, a connection whose SDK blocks, and one to a remote control."""

from __future__ import annotations

import asyncio
import threading
import time
from collections.abc import Callable
from typing import Any

import pytest

from sim_bridge.olympe import link, settings
from sim_bridge.olympe.commands import CommandQueue, Kind
from tests.sim_bridge.olympe.fake_olympe import PATIENCE_S, SETTINGS, FakeWorld, Flight
from uav_bt.errors import DroneError
from uav_bt.types import (
    CutMotors,
    FlyingState,
    Hover,
    Land,
    MoveBy,
    Movement,
    Release,
    TakeOff,
    Velocity,
)


class Blocked:
    """A queue whose first command blocks until it is released."""

    def __init__(self) -> None:
        self.queue = CommandQueue()
        self.done: list[str] = []
        self.go, begun = threading.Event(), threading.Event()

        def block() -> None:
            begun.set()
            assert self.go.wait(PATIENCE_S)

        self.queue.submit(Kind.STICKS, block)
        assert begun.wait(PATIENCE_S)

    def submit(self, kind: Kind, name: str) -> None:
        self.queue.submit(kind, lambda: self.done.append(name))

    def finish(self) -> list[str]:
        self.go.set()
        assert self.queue.run(lambda: None, PATIENCE_S)
        self.queue.close()
        return self.done


def refused() -> None:
    raise DroneError("it does not land")


def cancelled() -> None:
    raise asyncio.CancelledError  # not an Exception: uncaught it would end the thread


@pytest.mark.parametrize("kind", [Kind.STICKS, Kind.GIMBAL, Kind.CONTROL, Kind.END])
def test_while_one_blocks_only_the_newest_of_a_kind_waits(kind: Kind) -> None:
    blocked = Blocked()
    for index in range(1000):
        blocked.submit(kind, str(index))
    assert blocked.finish() == ["999"]


def test_a_landing_overtakes_what_would_move_the_drone() -> None:
    blocked = Blocked()
    for kind in Kind:
        if kind is not Kind.END:
            blocked.submit(kind, kind.value)
    blocked.submit(Kind.END, "land")
    assert blocked.finish() == ["land", "connection", "gimbal", "camera", "control", "limits"]


@pytest.mark.parametrize(
    ("job", "message"), [(refused, "does not land"), (cancelled, "gave up: CancelledError")]
)
def test_a_command_that_fails_is_an_error(job: Callable[[], None], message: str) -> None:
    commands, landed = CommandQueue(), threading.Event()
    with pytest.raises(DroneError, match=message):
        commands.run(job, PATIENCE_S)
    commands.submit(Kind.MOVE, job)
    assert commands.run(lambda: None, PATIENCE_S)
    with pytest.raises(DroneError, match=message):
        commands.submit(Kind.END, landed.set)
    assert landed.wait(PATIENCE_S)
    commands.close()
    with pytest.raises(DroneError, match="is closed: call connect"):
        commands.submit(Kind.END, landed.set)


def test_a_job_that_takes_too_long_is_finished_later(caplog: pytest.LogCaptureFixture) -> None:
    blocked, after = Blocked(), threading.Event()
    assert not blocked.queue.run(refused, 0.01)
    blocked.queue.submit(Kind.MOVE, refused)
    blocked.queue.close(after.set)
    assert not after.is_set()
    blocked.go.set()
    assert after.wait(PATIENCE_S)
    assert caplog.text.count("it does not land") == 2


def test_the_other_errors_are_logged(caplog: pytest.LogCaptureFixture) -> None:
    blocked, over = Blocked(), threading.Event()
    blocked.queue.submit(Kind.MOVE, lambda: int("no number"))
    blocked.queue.submit(Kind.MOVE, refused)
    blocked.go.set()
    assert blocked.queue.run(lambda: None, PATIENCE_S)
    with pytest.raises(ValueError, match="no number"):
        blocked.queue.submit(Kind.END, refused)  # raised by no later command
    blocked.queue.close(over.set)
    assert over.wait(PATIENCE_S)
    assert caplog.text.count("a command to the drone failed: DroneError: it does not land") == 2


def soon(condition: Callable[[], bool]) -> bool:
    """Wait for a condition; return whether it became true in time."""
    end_s = time.monotonic() + PATIENCE_S / 2.0
    while not condition() and time.monotonic() < end_s:
        time.sleep(0.005)
    return condition()


def called(flight: Flight) -> list[str]:
    """Return the calls of the SDK, all of which another thread than this one has made."""
    (thread,) = {thread for _, thread in flight.sdk.calls}
    assert thread != threading.get_ident()
    return [name for name, _ in flight.sdk.calls]


@pytest.mark.parametrize(
    ("call", "limit", "message"),
    [
        ("connect", "CONNECT_LIMIT_S", "not ready for commands after 0 s: restart it"),
        ("play", "VIDEO_LIMIT_S", "sends no video"),
        ("disconnect", "CLOSE_LIMIT_S", "the SDK has not disconnected from anafi at 127.0.0.1:44"),
    ],
)
def test_a_call_of_the_sdk_that_blocks_keeps_nobody_and_is_finished_by_its_thread(
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
    call: str,
    limit: str,
    message: str,
) -> None:
    for module, name in ((link, limit), (link, "COMMANDS_LIMIT_S"), (settings, "LIMIT_S")):
        monkeypatch.setattr(module, name, 0.01)
    flight = Flight(FakeWorld(blocks=call), threaded=True, connect=False)
    if call == "disconnect":
        flight.drone.connect()
        flight.drone.disconnect()
        assert message in caplog.text
    else:
        with pytest.raises(DroneError, match=message):
            flight.drone.connect()
    assert soon(lambda: call in [name for sdk in flight.world.made for name, _ in sdk.calls])
    # The SDK is still busy, so no other thread may use its object.
    assert called(flight)[-1] == call
    flight.world.go.set()
    assert flight.world.destroyed.wait(PATIENCE_S)
    assert flight.sdk.closed == ["stop", "disconnect", "destroy"]
    assert called(flight)[-1] == "destroy"


@pytest.mark.parametrize(
    ("movement", "order"),
    [(Land(), "Landing"), (CutMotors(), "Emergency"), (Release(), "stop_piloting")],
)
def test_no_setting_keeps_back_what_ends_a_flight(movement: Movement, order: str) -> None:
    """After a take-off by a pilot the limits are set in the air, without confirmation."""
    flight = Flight(FakeWorld(refused=set(SETTINGS)), threaded=True)
    flight.play("hovering", Velocity(forward_mps=0.5))
    expected = "piloting" if isinstance(movement, Release) else "BankedTurn"  # the last setting
    assert soon(lambda: expected in flight.sdk.names())
    flight.play(movement)
    assert soon(lambda: order in flight.sdk.names())
    flight.sdk.connected = False  # a lost drone is not asked for a confirmation
    flight.drone.disconnect()


@pytest.mark.parametrize("fails", ["piloting", "send", "disconnect"])
def test_it_disconnects_though_a_step_fails(fails: str, caplog: pytest.LogCaptureFixture) -> None:
    flight = Flight(threaded=True)
    flight.play("hovering", MoveBy(id=1, forward_m=0.3), Velocity(forward_mps=0.5))
    assert soon(lambda: "piloting" in flight.sdk.names())
    flight.world.fails = fails
    flight.drone.disconnect()
    assert flight.world.destroyed.wait(PATIENCE_S)
    assert "failed: TimeoutError: no answer" in caplog.text
    assert {"send", "disconnect", "destroy"} <= set(called(flight))


CONNECTION = "drone_manager.connection_state"
OURS, PILOTS = "Controller", "SkyController"


def with_remote() -> Flight:
    world = FakeWorld(on_connect=lambda sdk: sdk.event(CONNECTION, state="connected"))
    flight = Flight(world, remote=True)
    flight.play(PILOTS)
    assert flight.sdk.given["sky"]
    assert flight.sdk.played["port"] is None
    return flight


def sources(flight: Flight) -> list[str]:
    return [args["source"] for args in flight.sdk.args("skyctrl.CoPiloting.setPilotingSource")]


@pytest.mark.parametrize(
    ("steps", "sent", "pilot"),
    [
        ([Release()], [], False),  # looking takes no sticks
        ([TakeOff()], [OURS], False),
        ([Hover(), OURS, Release(), Release(), PILOTS], [OURS, PILOTS], False),  # given, not taken
        ([Hover(), OURS, Release(), PILOTS, 5.0, Hover(), OURS], [OURS, PILOTS, OURS], False),
        # A pilot who takes the sticks keeps them.
        ([Hover(), OURS, PILOTS, 5.0, Release(), Hover()], [OURS], True),
    ],
)
def test_the_sticks_are_taken_and_given(steps: list[Any], sent: list[str], *, pilot: bool) -> None:
    flight = with_remote()
    flight.play(*steps)
    assert sources(flight) == sent
    assert flight.state.pilot_has_control is pilot


def test_sticks_are_taken_before_a_take_off_and_after_a_landing() -> None:
    assert with_remote().play(TakeOff())[0] == "setPilotingSource"
    assert with_remote().play("hovering", Land()) == ["Landing", "setPilotingSource"]


@pytest.mark.parametrize("lost", [False, True])
def test_the_sticks_are_given_back_in_the_end_also_if_the_drone_is_lost(*, lost: bool) -> None:
    flight = with_remote()
    flight.play(TakeOff(), OURS)
    if lost:
        flight.sdk.event(CONNECTION, state="searching")
    flight.drone.disconnect()
    assert sources(flight) == [OURS, PILOTS]


def test_a_remote_control_without_its_drone_is_heard_but_not_the_drone() -> None:
    flight = with_remote()
    flight.play("hovering")
    flight.sdk.measures()
    for _ in range(300):
        flight.play(0.05)
        flight.sdk.event("skyctrl.SkyControllerState.AttitudeChanged", q0=1.0)
    state = flight.state
    assert (state.captured_s, state.flying, state.connected) == (0.0, FlyingState.HOVERING, True)
    flight.sdk.event(CONNECTION, state="searching")
    # The remote control may reconnect.
    assert (flight.state.connected, flight.state.lost) == (False, False)


def test_a_remote_control_needs_a_drone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(link, "BEHIND_LIMIT_S", 0.01)
    flight = Flight(remote=True, connect=False)
    with pytest.raises(DroneError, match="no drone is connected to it: switch the drone on"):
        flight.drone.connect()
    assert flight.sdk.played == {}
