"""A campaign from its plan to its last flight, in as many goes as it takes."""

from __future__ import annotations

import datetime as dt
import hashlib
import os
import platform
from collections import Counter
from collections.abc import Callable, Generator, Iterable, Iterator, Mapping
from concurrent.futures import as_completed
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

from uav_bt.app import provenance
from uav_bt.campaign.plan import CampaignPlan, FlightTask
from uav_bt.campaign.store import CampaignStore, file_stem, key_of
from uav_bt.campaign.workers import Fly, Line, WorkerPool, fly_task
from uav_bt.errors import ValueRangeError

Progress = Callable[[Mapping[str, Any], bool], None]
"""Called with every flight: its line, and whether it was flown just now."""

Flown = Generator[tuple[FlightTask, Line], None, None]
"""Tasks with their flights' lines, as they end. Closing it stops all that still flies."""


class Backend(Protocol):
    """Where flights are flown."""

    def run(self, fly: Fly, tasks: Iterable[FlightTask], timeout_s: float) -> Flown:
        """Fly tasks, each for `timeout_s` of wall time at most; an InputError refuses them."""
        ...


class LocalBackend:
    """The cores of this machine; None: as many flights at a time as there are cores."""

    def __init__(self, workers: int | None = None) -> None:
        if workers is not None and workers < 1:
            raise ValueRangeError(f"a campaign needs at least one worker, got {workers}")
        self.workers: int = workers or len(os.sched_getaffinity(0))

    def __str__(self) -> str:
        return f"local, {self.workers} worker{'s' if self.workers > 1 else ''}"

    def run(self, fly: Fly, tasks: Iterable[FlightTask], timeout_s: float) -> Flown:
        """Fly tasks; see `Backend`."""
        with closing(WorkerPool(fly, self.workers)) as pool:
            flights = {pool.start(task, timeout_s): task for task in tasks}
            for flight in as_completed(flights):
                yield flights[flight], pool.line_of(flight)


@dataclass(frozen=True, kw_only=True)
class CampaignResult:
    """Result of a campaign."""

    flights: tuple[Line, ...]  # those of the plan, in its order
    flown_now: int  # the others were there before


def run(
    plan: CampaignPlan,
    folder: Path,
    *,
    backend: Backend | None = None,
    on_flight: Progress = lambda _flight, _now: None,
    on_note: Callable[[str], None] = lambda _: None,
    fly: Fly = fly_task,
) -> CampaignResult:
    """Fly those flights of a plan that its folder does not hold yet.

    Each flight is kept when it ends. A campaign that was stopped goes on when called again.

    Args:
        plan: what to fly.
        folder: where the plan and the flights are kept.
        backend: where flights are flown; the cores of this machine by default.
        on_flight: called with every flight, those that were there before first.
        on_note: called at once with remarks about the folder.
        fly: takes a task and returns the flight's line; a function of a module.

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
            on_note("the last line was only half written and is flown again")
        before, now = store.runs[-2:][0].get("code"), about["code"]  # the same in the first run
        if done and left and before != now:
            on_note(
                f"the code has changed since the last run ({before}, now {now}): the folder has "
                "flights of both"
            )
        for flight in done.values():
            on_flight(flight, False)
        tasks = _with_outputs(plan, folder, left)
        with closing(backend.run(fly, tasks, plan.timeout_s)) as flown:
            for task, line in flown:
                flight = done[task.key] = _with_files(line, task, folder)
                store.keep(flight)
                on_flight(flight, True)
    return CampaignResult(flights=tuple(done[key] for key in wanted), flown_now=len(left))


def _with_outputs(
    plan: CampaignPlan, folder: Path, tasks: list[FlightTask]
) -> Iterator[FlightTask]:
    """Yield the tasks with their records and output folders, each with a name of its own."""
    records, outputs = (folder.resolve() / name for name in ("records", "flights"))
    if plan.record:
        records.mkdir(exist_ok=True)
    stems = Counter(file_stem(task.key) for task in plan.tasks())
    for task in tasks:
        name = file_stem(task.key)
        if stems[name] > 1:
            name += "-" + hashlib.sha256(repr(task.key).encode()).hexdigest()[:8]
        record = records / f"{name}.mcap" if plan.record else None
        options = replace(task.options, record=record)
        yield replace(task, options=options, folder=str(outputs / name))


def _with_files(line: Line, task: FlightTask, folder: Path) -> Line:
    """Return a flight's line with its files, relative, so that the folder may move."""
    has_folder = task.folder is not None and Path(task.folder).is_dir()
    files = {"record": task.options.record, "folder": task.folder if has_folder else None}
    home = folder.resolve()
    return {**line, **{key: str(Path(at).relative_to(home)) for key, at in files.items() if at}}
