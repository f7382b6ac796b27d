"""Sources of a report: folders of campaigns and plain files of flights."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from uav_bt.campaign.plan import CampaignPlan
from uav_bt.campaign.store import FLIGHTS_FILE, PLAN_FILE, read_flights, read_plan
from uav_bt.errors import FileError

Flights = Sequence[Mapping[str, Any]]


@dataclass(frozen=True, kw_only=True)
class FlightSet:
    """The flights of one tree from one source: a row of the report."""

    label: str  # unique in the report
    tree: str  # name of the tree's file
    flights: Flights  # their lines
    path: Path  # the folder or file that was read, as given
    plan: CampaignPlan | None = None  # a plain file of flights has no plan and no runs
    runs: Sequence[Mapping[str, Any]] = ()  # each with its time, machine and commit
    note: str = ""  # on planned flights of the source that are missing

    def scene_path(self, scene: str) -> str:
        """Return the file of a scene of these flights, or the name of a shipped scene."""
        planned = self.plan.scenes if self.plan else ()
        return next((file.path for file in planned if file.name == scene), scene)

    def tree_path(self) -> str:
        """Return the file of the tree, or the name of a shipped mission."""
        planned = self.plan.trees if self.plan else ()
        return next((f.path for f in planned if f.name == self.tree), Path(self.tree).stem)


def read_sources(paths: Sequence[Path]) -> tuple[FlightSet, ...]:
    """Read folders of campaigns, or files with one flight per line, each tree as a set.

    Raises:
        FileError: A folder or file is missing or has no flights.
    """
    sets = [one for path in dict.fromkeys(paths) for one in _read(path)]
    count = Counter(one.label for one in sets)
    return tuple(
        one if count[one.label] == 1 else replace(one, label=f"{one.label} ({one.path})")
        for one in sets
    )


def by_tree(flights: Iterable[Mapping[str, Any]]) -> dict[str, Flights]:
    """Return flights by the name of their tree; trees are in order of first appearance."""
    trees: dict[str, list[Mapping[str, Any]]] = {}
    for flight in flights:
        trees.setdefault(flight["tree"], []).append(flight)
    return dict(trees)


def _read(path: Path) -> Iterator[FlightSet]:
    file, source = path, FlightSet(label="", tree="", flights=(), path=path)
    remedy, note = "expected lines that `uav-bt campaign` wrote", ""
    if path.is_dir():
        file = path / FLIGHTS_FILE
        if not file.is_file():
            kept = f"`uav-bt campaign` keeps them in {FLIGHTS_FILE}"
            raise FileError(path, f"no flights in this folder; {kept}")
    flights = read_flights(file)
    if path.is_dir() and (path / PLAN_FILE).exists():
        plan, runs = read_plan(path)
        remedy = f"`uav-bt campaign --resume {shlex.quote(str(path))}` flies them"
        if len(flights) < len(plan):
            note = f"{path}: {len(flights)} of {len(plan)} planned flights were flown"
        source = replace(source, plan=plan, runs=runs, note=note)
    if not flights:
        raise FileError(file, f"no flights; {remedy}")
    for tree, some in by_tree(flights).items():
        yield replace(source, label=Path(tree).stem, tree=tree, flights=some)
