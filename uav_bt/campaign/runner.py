"""A campaign from its plan to its last flight, in as many goes as it takes."""

from __future__ import annotations

import datetime as dt
import hashlib
import os
import platform
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any, Final, Protocol

from uav_bt.app import provenance
from uav_bt.app.flight import changes_of
from uav_bt.campaign.flight_lines import file_stem, key_of
from uav_bt.campaign.plan import CampaignPlan, FlightTask
from uav_bt.campaign.store import OUTPUTS_FOLDER, RECORDS_FOLDER, CampaignStore, read_plan
from uav_bt.campaign.workers import FAILED, FLOWN, REFUSED, Answer, WorkerPool
from uav_bt.errors import InputError, ValueRangeError
from uav_bt.mission.judge import Outcome

FLY_FUNCTION: Final = "uav_bt.campaign.flight:fly_task"

Progress = Callable[[Mapping[str, Any], bool], None]
"""Called with every flight: its line, and whether it was flown just now."""

Answers = Generator[tuple[FlightTask, Answer], None, None]
"""Tasks with their workers' answers, as they end. Closing it stops all that still flies."""


class Backend(Protocol):
    """Where flights are flown."""

    def run(self, function: str, tasks: Iterable[FlightTask], timeout_s: float) -> Answers:
        """Fly tasks with MODULE:FUNCTION, each for `timeout_s` of wall time at most."""
        ...


class LocalBackend:
    """The cores of this machine; None: as many flights at a time as there are cores."""

    def __init__(self, workers: int | None = None) -> None:
        if workers is not None and workers < 1:
            raise ValueRangeError(f"a campaign needs at least one worker, got {workers}")
        self.workers: int = workers or len(os.sched_getaffinity(0))

    def __str__(self) -> str:
        return f"local, {self.workers} worker{'s' if self.workers > 1 else ''}"

    def run(self, function: str, tasks: Iterable[FlightTask], timeout_s: float) -> Answers:
        """Fly tasks; see `Backend`."""
        pool = WorkerPool(function, self.workers)
        flying: dict[Future[Answer], FlightTask] = {}
        left = iter(tasks)
        try:
            while True:
                # One task waits for each that flies, so that no worker waits for its next.
                for task in islice(left, 2 * self.workers - len(flying)):
                    flying[pool.fly(task.to_json(), timeout_s)] = task
                if not flying:
                    return
                for flight in wait(flying, return_when=FIRST_COMPLETED).done:
                    yield flying.pop(flight), flight.result()
        finally:
            pool.close()


@dataclass(frozen=True, kw_only=True)
class CampaignResult:
    """Result of a campaign."""

    flights: tuple[dict[str, Any], ...]  # those of the plan, in its order
    flown_now: int  # the others were there before


def run(
    plan: CampaignPlan,
    folder: Path,
    *,
    backend: Backend | None = None,
    on_flight: Progress = lambda _flight, _now: None,
    on_note: Callable[[str], None] = lambda _: None,
    fly: str = FLY_FUNCTION,
) -> CampaignResult:
    """Fly those flights of a plan that its folder does not hold yet.

    Each flight is kept when it ends. A campaign that was stopped, or killed, goes on when it is
    called again.

    Args:
        plan: what to fly.
        folder: where the plan and the flights are kept.
        backend: where flights are flown; the cores of this machine by default.
        on_flight: called with every flight, those that were there before first.
        on_note: called at once with remarks about the folder.
        fly: MODULE:FUNCTION that takes a task and returns the flight's line.

    Returns:
        All flights of the plan, whatever their outcome.

    Raises:
        FileError: the folder cannot be written to; flights that ended before are kept.
        InputError: the folder belongs to another plan, or a flight was refused before it flew.
    """
    backend = backend or LocalBackend(workers=1)
    about = {
        "began": dt.datetime.now(dt.UTC).isoformat(timespec="seconds"),
        "machine": platform.node(),
        "hardware": provenance.hardware(),
        "backend": str(backend),
        "code": provenance.commit(),
    }
    with CampaignStore.opened(folder, plan, about) as store:
        wanted = {task.key: task for task in plan.tasks()}
        done = {key_of(one): one for one in store.kept if key_of(one) in wanted}
        left = [task for key, task in wanted.items() if key not in done]
        if store.repaired:
            on_note("the last line was only half written and was taken away; it is flown again")
        _, runs = read_plan(folder)
        before = runs[-2].get("code") if len(runs) > 1 else about["code"]
        if done and left and before != about["code"]:
            on_note(
                f"the code has changed since the last run ({before}, now {about['code']}): the "
                "folder has flights of both"
            )
        for flight in done.values():
            on_flight(flight, False)
        tasks = _with_outputs(plan, folder, left)
        with closing(backend.run(fly, tasks, plan.timeout_s)) as answers:
            for task, answer in answers:
                flight = done[task.key] = _line_of(task, answer)
                store.keep(flight)
                on_flight(flight, True)
    return CampaignResult(flights=tuple(done[key] for key in wanted), flown_now=len(left))


def _with_outputs(
    plan: CampaignPlan, folder: Path, tasks: list[FlightTask]
) -> Iterator[FlightTask]:
    records, outputs = (folder.resolve() / name for name in (RECORDS_FOLDER, OUTPUTS_FOLDER))
    if plan.record and tasks:
        records.mkdir(exist_ok=True)
    stems = Counter(file_stem(task.key) for task in plan.tasks())
    for task in tasks:
        name = file_stem(task.key)
        if stems[name] > 1:
            name += "-" + hashlib.sha256(repr(task.key).encode()).hexdigest()[:8]
        record = str(records / f"{name}.mcap") if plan.record else None
        yield replace(task, record=record, folder=str(outputs / name))


def _line_of(task: FlightTask, answer: Answer) -> dict[str, Any]:
    """Return the line to keep of a flight: what was flown, or the error that it ended with.

    The line of a lost process has the options as they were given, `random` among the faults: to
    draw them takes the drone, which may have ended that process.
    """
    if REFUSED in answer:  # as all other tasks of the campaign would be
        raise InputError(str(answer[REFUSED]))
    if FLOWN in answer:
        line = dict(answer[FLOWN])
    else:
        options = task.flight_options()
        line = {
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
    # Relative, so that the folder may move.
    if task.record is not None:
        line["record"] = f"{RECORDS_FOLDER}/{Path(task.record).name}"
    if task.folder is not None and Path(task.folder).is_dir():
        line["folder"] = f"{OUTPUTS_FOLDER}/{Path(task.folder).name}"
    return line
