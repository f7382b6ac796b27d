"""Sources of a report: folders of campaigns and plain files of flights."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

from uav_bt.campaign.flight_lines import read_flights
from uav_bt.campaign.plan import CampaignPlan
from uav_bt.campaign.store import FLIGHTS_FILE, PLAN_FILE, read_plan
from uav_bt.errors import FileError

Flights = Sequence[Mapping[str, Any]]


@dataclass(frozen=True, kw_only=True)
class Source:
    """A folder or file that was read; a plain file of flights has no plan and no runs."""

    path: Path  # as given
    plan: CampaignPlan | None = None
    runs: tuple[dict[str, Any], ...] = ()  # each with its time, machine and commit


@dataclass(frozen=True, kw_only=True)
class FlightSet:
    """The flights of one tree from one source: a row of the report."""

    label: str  # unique in the report
    tree: str  # name of the tree's file
    flights: Flights  # their lines
    source: Source

    def scene_path(self, scene: str) -> str:
        """Return the file of a scene of these flights, or the name of a shipped scene."""
        planned = self.source.plan.scenes if self.source.plan is not None else ()
        return next((file.path for file in planned if file.name == scene), scene)

    def tree_path(self) -> str:
        """Return the file of the tree, or the name of a shipped mission."""
        planned = self.source.plan.trees if self.source.plan is not None else ()
        paths = (file.path for file in planned if file.name == self.tree)
        return next(paths, Path(self.tree).stem)


class Sources(NamedTuple):
    """Content of a report."""

    sets: tuple[FlightSet, ...]  # the flights by tree and source
    notes: tuple[str, ...]  # on planned flights that are missing


def read_sources(paths: Sequence[Path]) -> Sources:
    """Read folders of campaigns, or files with one flight per line, each tree as a set.

    Raises:
        FileError: A folder or file is missing or has no flights.
    """
    notes: list[str] = []
    found: list[tuple[Source, str, Flights]] = []
    for path in dict.fromkeys(paths):
        source, flights = _read(path)
        found += [(source, tree, some) for tree, some in by_tree(flights).items()]
        if source.plan is not None and len(flights) < len(source.plan):
            notes.append(f"{path}: {len(flights)} of {len(source.plan)} planned flights were flown")
    stems = Counter(Path(tree).stem for _, tree, _ in found)
    sets = []
    for source, tree, flights in found:
        stem = Path(tree).stem
        label = stem if stems[stem] == 1 else f"{stem} ({source.path})"
        sets.append(FlightSet(label=label, tree=tree, flights=flights, source=source))
    return Sources(tuple(sets), tuple(notes))


def by_tree(flights: Iterable[Mapping[str, Any]]) -> dict[str, Flights]:
    """Return flights by the name of their tree; trees are in order of first appearance."""
    trees: dict[str, list[Mapping[str, Any]]] = {}
    for flight in flights:
        trees.setdefault(flight["tree"], []).append(flight)
    return dict(trees)


def _read(path: Path) -> tuple[Source, Flights]:
    file, source = path, Source(path=path)
    if path.is_dir():
        file = path / FLIGHTS_FILE
        if not file.is_file():
            raise FileError(
                path, f"no flights in this folder; `uav-bt campaign` keeps them in {FLIGHTS_FILE}"
            )
        if (path / PLAN_FILE).exists():
            plan, runs = read_plan(path)
            source = Source(path=path, plan=plan, runs=tuple(runs))
    flights = read_flights(file)
    if not flights:
        resume = f"`uav-bt campaign --resume {shlex.quote(str(path))}` flies them"
        expected = "expected lines that `uav-bt campaign` wrote" if source.plan is None else resume
        raise FileError(file, f"no flights; {expected}")
    return source, flights
