"""A campaign from its plan to its last flight, in as many goes as it takes."""

from __future__ import annotations

import datetime as dt
import hashlib
import platform
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

from uav_bt.app import provenance
from uav_bt.campaign.flight_lines import file_stem, key_of
from uav_bt.campaign.plan import CampaignPlan, FlightTask
from uav_bt.campaign.runner import Backend, LocalBackend, flown_line
from uav_bt.campaign.store import OUTPUTS_FOLDER, RECORDS_FOLDER, CampaignStore, read_plan

FLY_FUNCTION: Final = "uav_bt.campaign.flight:fly_task"

Progress = Callable[[Mapping[str, Any], bool], None]
"""Called with every flight: its line, and whether it was flown just now."""


def silent_progress(_flight: Mapping[str, Any], _now: bool) -> None:  # noqa: FBT001 - as `Progress` has it
    """Report nothing."""


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
    on_flight: Progress = silent_progress,
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
    run = {
        "began": dt.datetime.now(dt.UTC).isoformat(timespec="seconds"),
        "machine": platform.node(),
        "hardware": provenance.hardware(),
        "backend": str(backend),
        "code": provenance.commit(),
    }
    with CampaignStore.opened(folder, plan, run) as store:
        wanted = {task.key: task for task in plan.tasks()}
        done = {key_of(one): one for one in store.kept.flights if key_of(one) in wanted}
        left = [task for key, task in wanted.items() if key not in done]
        for note in _notes(store, going_on=bool(done and left)):
            on_note(note)
        for flight in done.values():
            on_flight(flight, False)
        tasks = _with_outputs(plan, store.folder, left)
        with closing(backend.run(fly, tasks, plan.timeout_s)) as answers:
            for task, answer in answers:
                flight = flown_line(task, answer)
                if task.record is not None:
                    # Relative, so that the folder may move.
                    flight["record"] = f"{RECORDS_FOLDER}/{Path(task.record).name}"
                if task.folder is not None and Path(task.folder).is_dir():
                    flight["folder"] = f"{OUTPUTS_FOLDER}/{Path(task.folder).name}"
                store.keep(flight)
                done[task.key] = flight
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


def _notes(store: CampaignStore, *, going_on: bool) -> list[str]:
    notes = [f"left out: {line}" for line in store.kept.damaged]
    if store.repaired:
        notes.append("the last line was only half written and was taken away; it is flown again")
    _, runs = read_plan(store.folder)
    if going_on and len(runs) > 1 and runs[-1]["code"] != runs[-2].get("code"):
        notes.append(
            f"the code has changed since the last run ({runs[-2].get('code')}, now "
            f"{runs[-1]['code']}): the folder has flights of both"
        )
    return notes
