"""The queue of commands to the SDK."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable

import pytest

from sim_bridge.olympe.commands import CommandQueue, Kind
from uav_bt.errors import DroneError

PATIENCE_S = 30.0


def finish(queue: CommandQueue) -> None:
    """Close the queue and wait for all commands."""
    assert queue.run(lambda: None, PATIENCE_S)
    queue.close()


class Blocked:
    """A queue whose first command blocks until it is released."""

    def __init__(self) -> None:
        self.queue = CommandQueue()
        self.done: list[str] = []
        self._go, begun = threading.Event(), threading.Event()

        def block() -> None:
            begun.set()
            assert self._go.wait(PATIENCE_S)

        self.queue.submit(Kind.STICKS, block)
        assert begun.wait(PATIENCE_S)

    def note(self, name: str) -> Callable[[], None]:
        return lambda: self.done.append(name)

    def let_go(self) -> None:
        self._go.set()

    def finish(self) -> list[str]:
        self.let_go()
        finish(self.queue)
        return self.done


def test_commands_are_run_in_order_and_an_error_comes_back_with_the_next() -> None:
    done: list[int] = []
    failed, landed = threading.Event(), threading.Event()
    commands = CommandQueue()

    def fail() -> None:
        raise DroneError("gone")

    commands.submit(Kind.MOVE, lambda: done.append(1))
    commands.submit(Kind.MOVE, fail)
    commands.submit(Kind.MOVE, failed.set)
    assert failed.wait(PATIENCE_S)
    with pytest.raises(DroneError, match="gone"):
        commands.submit(Kind.END, landed.set)
    assert landed.wait(PATIENCE_S)
    commands.submit(Kind.MOVE, lambda: done.append(2))
    finish(commands)
    assert done == [1, 2]


@pytest.mark.parametrize("kind", [Kind.STICKS, Kind.GIMBAL, Kind.CONTROL, Kind.END])
def test_while_one_blocks_only_the_newest_of_a_kind_waits(kind: Kind) -> None:
    blocked = Blocked()
    for index in range(1000):
        blocked.queue.submit(kind, blocked.note(str(index)))
    assert blocked.finish() == ["999"]


def test_a_landing_overtakes_what_would_move_the_drone() -> None:
    blocked = Blocked()
    for kind in Kind:
        if kind is not Kind.END:
            blocked.queue.submit(kind, blocked.note(kind.value))
    blocked.queue.submit(Kind.END, blocked.note("land"))
    assert blocked.finish() == ["land", "connection", "gimbal", "camera", "control", "limits"]


def test_a_cancelled_call_of_the_sdk_does_not_keep_the_landing_back() -> None:
    commands, landed = CommandQueue(), threading.Event()

    def cancelled() -> None:
        raise asyncio.CancelledError  # not an Exception: uncaught it would end the thread

    commands.submit(Kind.STICKS, cancelled)
    assert commands.run(lambda: None, PATIENCE_S)
    with pytest.raises(DroneError, match="the SDK gave up: CancelledError"):
        commands.submit(Kind.END, landed.set)
    assert landed.wait(PATIENCE_S)


def refused() -> None:
    raise DroneError("it does not land")


def test_a_last_command_that_failed_is_reported_at_the_end(
    caplog: pytest.LogCaptureFixture,
) -> None:
    commands = CommandQueue()
    commands.submit(Kind.END, refused)
    assert commands.run(lambda: None, PATIENCE_S)
    commands.close()
    assert "a command to the drone failed: DroneError: it does not land" in caplog.text


def test_a_command_that_fails_after_the_end_is_reported(caplog: pytest.LogCaptureFixture) -> None:
    blocked, over = Blocked(), threading.Event()
    blocked.queue.submit(Kind.END, refused)
    blocked.queue.close(over.set)
    assert caplog.text == ""
    blocked.let_go()
    assert over.wait(PATIENCE_S)
    assert "it does not land" in caplog.text


def test_of_several_failures_the_first_is_raised_and_the_others_are_logged(
    caplog: pytest.LogCaptureFixture,
) -> None:
    commands = CommandQueue()
    blocked = threading.Event()
    commands.submit(Kind.MOVE, lambda: blocked.wait(PATIENCE_S))
    commands.submit(Kind.MOVE, lambda: int("no number"))
    commands.submit(Kind.MOVE, refused)
    blocked.set()
    assert commands.run(lambda: None, PATIENCE_S)
    with pytest.raises(ValueError, match="no number"):
        commands.submit(Kind.GIMBAL, lambda: None)
    assert "it does not land" in caplog.text


def test_a_job_that_takes_too_long_is_given_up_and_finished(
    caplog: pytest.LogCaptureFixture,
) -> None:
    go, begun, after = threading.Event(), threading.Event(), threading.Event()
    commands = CommandQueue()

    def late() -> None:
        begun.set()
        assert go.wait(PATIENCE_S)
        refused()

    assert not commands.run(late, 0.01)
    commands.close(after.set)
    assert begun.wait(PATIENCE_S)
    assert not after.is_set()
    go.set()
    assert after.wait(PATIENCE_S)
    assert "it does not land" in caplog.text


def test_what_fails_in_time_is_raised() -> None:
    commands = CommandQueue()
    with pytest.raises(DroneError, match="it does not land"):
        commands.run(refused, PATIENCE_S)
    finish(commands)


def test_a_closed_queue_takes_no_command() -> None:
    commands = CommandQueue()
    commands.close()
    with pytest.raises(DroneError, match="is closed: call connect"):
        commands.submit(Kind.END, lambda: None)
