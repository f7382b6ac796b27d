"""Flights on all cores: joblib hands them out, pilots fly them, answers come as they end."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Protocol

import joblib

from uav_bt.campaign.plan import FlightTask
from uav_bt.campaign.worker_process import FLOWN, REFUSED
from uav_bt.campaign.workers import Pilots
from uav_bt.errors import InputError, ValueRangeError
from uav_bt.mission.judge import Outcome

Answers = Generator[tuple[FlightTask, dict[str, Any]], None, None]
"""To be closed by whoever takes them, which stops all that still flies."""


class Backend(Protocol):
    """Where flights are flown."""

    def run(self, function: str, tasks: Iterable[FlightTask], timeout_s: float) -> Answers:
        """Fly tasks and return each with its pilot's answer, in the order in which they end.

        Args:
            function: MODULE:FUNCTION that takes a task and returns the flight's line.
            tasks: what to fly.
            timeout_s: wall time of one flight.
        """
        ...


def flown_line(task: FlightTask, answer: Mapping[str, Any]) -> dict[str, Any]:
    """Return the line to keep of a flight: what was flown, or the error that it ended with.

    Raises:
        InputError: the pilot refused the task; no other of the campaign would fare better.
    """
    if REFUSED in answer:
        raise InputError(str(answer[REFUSED]))
    if FLOWN in answer:
        return dict(answer[FLOWN])
    return {
        "scene": task.scene,
        "seed": task.seed,
        "tree": task.tree,
        "profile": task.profile,
        "outcome": Outcome.ERROR.value,
        "reason": answer["failed"],
        "details": answer.get("details", ""),
    }


class LocalBackend:
    """The cores of this machine.

    joblib's threads do no more than watch: what flies is a process of its own for each of them, and
    a crash or a hang costs that process and that flight. joblib's own processes are no good for
    this: one that dies takes the others' flights along and does not say which was the culprit.

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
        pilots = Pilots(function)

        def fly(task: FlightTask) -> tuple[FlightTask, dict[str, Any]]:
            return task, pilots.fly(task.to_json(), timeout_s)

        parallel = joblib.Parallel(
            n_jobs=self.workers,
            backend="threading",
            batch_size=1,
            pre_dispatch=2 * self.workers,
            return_as="generator_unordered",
        )
        answers = parallel(joblib.delayed(fly)(task) for task in tasks)
        with _stopped_early(answers, pilots.close):
            for task, answer in answers:  # noqa: UP028 - joblib would hear of an early end first
                yield task, answer


@contextmanager
def _stopped_early(answers: Any, stop: Callable[[], None]) -> Iterator[None]:
    """Stop everything that still flies when whoever takes the answers has had enough."""
    try:
        yield
    finally:
        stop()
        with warnings.catch_warnings():
            # joblib finds it strange that somebody stops early; we mean it.
            warnings.simplefilter("ignore", UserWarning)
            answers.close()
