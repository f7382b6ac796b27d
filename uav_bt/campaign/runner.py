"""Flights on all cores: joblib hands them out, worker processes fly them."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Protocol

import joblib

from uav_bt.campaign.plan import FlightTask
from uav_bt.campaign.worker_process import FLOWN, REFUSED
from uav_bt.campaign.workers import WorkerPool
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

    Raises:
        InputError: the worker refused the task, as it would all others of the campaign.
    """
    if REFUSED in answer:
        raise InputError(str(answer[REFUSED]))
    if FLOWN in answer:
        return dict(answer[FLOWN])
    return {
        "scene": task.scene,
        "seed": task.seed,
        "tree": task.tree,
        "profile": task.options.profile,
        "outcome": Outcome.ERROR.value,
        "reason": answer["failed"],
        "details": answer.get("details", ""),
    }


class LocalBackend:
    """The cores of this machine.

    joblib's threads do no more than watch: what flies is a process of its own for each of them, and
    a crash or a hang costs that process and that flight. joblib's own processes are no good for
    this: one that crashes ends the others' flights, too, and does not say which task crashed.

    Args:
        workers: flights at a time; as many as there are cores when None.

    Raises:
        ValueRangeError: fewer than one.
    """

    def __init__(self, workers: int | None = None) -> None:
        if workers is not None and workers < 1:
            raise ValueRangeError(f"a campaign needs at least one worker, got {workers}")
        self.workers: int = joblib.cpu_count() if workers is None else workers

    def __str__(self) -> str:
        return f"local, {self.workers} worker{'s' if self.workers > 1 else ''}"

    def run(self, function: str, tasks: Iterable[FlightTask], timeout_s: float) -> Answers:
        """Fly tasks, as `Backend` says."""
        pool = WorkerPool(function)

        def fly(task: FlightTask) -> tuple[FlightTask, dict[str, Any]]:
            return task, pool.fly(task.to_json(), timeout_s)

        parallel = joblib.Parallel(
            n_jobs=self.workers,
            backend="threading",
            batch_size=1,
            pre_dispatch=2 * self.workers,
            return_as="generator_unordered",
        )
        answers = parallel(joblib.delayed(fly)(task) for task in tasks)
        with _stopped_early(answers, pool.close):
            for task, answer in answers:  # noqa: UP028 - joblib would be closed first
                yield task, answer


@contextmanager
def _stopped_early(answers: Any, stop: Callable[[], None]) -> Iterator[None]:
    """Stop everything that still flies when no more answers are taken."""
    try:
        yield
    finally:
        stop()
        with warnings.catch_warnings():
            # joblib warns of an early end; here it is meant.
            warnings.simplefilter("ignore", UserWarning)
            answers.close()
