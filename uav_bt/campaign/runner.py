"""Flights on the cores of this machine, and what any backend of a campaign does."""

from __future__ import annotations

import os
from collections.abc import Generator, Iterable, Mapping
from concurrent.futures import Future
from dataclasses import asdict
from itertools import islice
from queue import SimpleQueue
from typing import Any, Protocol

from uav_bt.app.flight import changes_of
from uav_bt.campaign.plan import FlightTask
from uav_bt.campaign.workers import FAILED, FLOWN, REFUSED, Answer, WorkerPool
from uav_bt.errors import InputError, ValueRangeError
from uav_bt.mission.judge import Outcome

Answers = Generator[tuple[FlightTask, dict[str, Any]], None, None]
"""Closing it stops all that still flies."""


class Backend(Protocol):
    """Where flights are flown."""

    def run(self, function: str, tasks: Iterable[FlightTask], timeout_s: float) -> Answers:
        """Fly tasks and return each with its worker's answer, in the order in which they end.

        Args:
            function: MODULE:FUNCTION that takes a task and returns the flight's line.
            tasks: what to fly.
            timeout_s: wall time of one flight.
        """
        ...


def flown_line(task: FlightTask, answer: Mapping[str, Any]) -> dict[str, Any]:
    """Return the line to keep of a flight: what was flown, or the error that it ended with.

    The line of a lost process has the options as they were given, `random` among the faults: to
    draw them takes the drone, which may have ended that process.

    Raises:
        InputError: the worker refused the task, as it would all others of the campaign.
    """
    if REFUSED in answer:
        raise InputError(str(answer[REFUSED]))
    if FLOWN in answer:
        return dict(answer[FLOWN])
    options = task.flight_options()
    return {
        "scene": task.scene,
        "seed": task.seed,
        "tree": task.tree,
        "drone": options.drone_name,
        "profile": options.profile,
        **asdict(changes_of(options)),
        "outcome": Outcome.ERROR.value,
        "reason": answer[FAILED],
        "details": answer.get("details", ""),
    }


class LocalBackend:
    """The cores of this machine.

    Args:
        workers: flights at a time; as many as there are cores when None.

    Raises:
        ValueRangeError: fewer than one.
    """

    def __init__(self, workers: int | None = None) -> None:
        if workers is not None and workers < 1:
            raise ValueRangeError(f"a campaign needs at least one worker, got {workers}")
        self.workers: int = workers or len(os.sched_getaffinity(0))

    def __str__(self) -> str:
        return f"local, {self.workers} worker{'s' if self.workers > 1 else ''}"

    def run(self, function: str, tasks: Iterable[FlightTask], timeout_s: float) -> Answers:
        """Fly tasks; see `Backend`."""
        pool = WorkerPool(function, self.workers)
        ended: SimpleQueue[tuple[FlightTask, Future[Answer]]] = SimpleQueue()

        def start(task: FlightTask) -> None:
            pool.fly(task.to_json(), timeout_s).add_done_callback(
                lambda flight: ended.put((task, flight))
            )

        left = iter(tasks)
        flying = 0
        try:
            # One task waits for each that flies, so that no worker waits for its next.
            for task in islice(left, 2 * self.workers):
                start(task)
                flying += 1
            while flying:
                task, flight = ended.get()
                yield task, flight.result()
                flying -= 1
                for following in islice(left, 1):
                    start(following)
                    flying += 1
        finally:
            pool.close()
