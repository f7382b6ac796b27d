"""The queue of commands to the SDK."""

from __future__ import annotations

import threading
from collections.abc import Callable

import pytest

from sim_bridge.olympe.commands import CommandQueue, Kind
from uav_bt.errors import DroneError

PATIENCE_S = 30.0


class Blocked:
    """A queue whose first command blocks until it is let go."""

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

    def finish(self) -> list[str]:
        self._go.set()
        self.queue.close(PATIENCE_S)
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
    commands.close(PATIENCE_S)
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
    assert blocked.finish() == ["land", "gimbal", "control", "limits"]
