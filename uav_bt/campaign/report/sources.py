"""Sources of a report: folders of campaigns and plain files of flights."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from uav_bt.campaign.flight_lines import read_flights
from uav_bt.campaign.plan import CampaignPlan
from uav_bt.campaign.report.statistics import by_tree
from uav_bt.campaign.store import FLIGHTS_FILE, PLAN_FILE, read_plan
from uav_bt.errors import FileError


@dataclass(frozen=True, kw_only=True)
class Provenance:
    """One folder or file that was read.

    Attributes:
        path: The path as given.
        plan: The plan of the campaign. None: a plain file of flights.
        runs: Runs of the campaign, each with its time, machine and commit.
    """

    path: Path
    plan: CampaignPlan | None
    runs: tuple[dict[str, Any], ...]

    @property
    def folder(self) -> Path:
        """The folder itself, or the folder of the file."""
        return self.path if self.path.is_dir() else self.path.parent


@dataclass(frozen=True, kw_only=True)
class FlightSet:
    """The flights of one tree from one source: a row of the report.

    Attributes:
        label: Name in the report, unique in it.
        tree: Name of the tree's file.
        flights: Lines of the flights.
        source: Folder or file of the flights.
    """

    label: str
    tree: str
    flights: tuple[dict[str, Any], ...]
    source: Provenance

    def scene_path(self, scene: str) -> str:
        """Return the file of a scene of these flights, or the name of a shipped scene."""
        planned = self.source.plan.scenes if self.source.plan is not None else ()
        return next((file.path for file in planned if file.name == scene), scene)

    def tree_path(self) -> str:
        """Return the file of the tree, or the name of a shipped mission."""
        planned = self.source.plan.trees if self.source.plan is not None else ()
        known = (file.path for file in planned if file.name == self.tree)
        return next(known, Path(self.tree).stem)


@dataclass(frozen=True, kw_only=True)
class Sources:
    """Content of a report.

    Attributes:
        sets: The flights by tree and source.
        provenance: The folders and files.
        notes: Notes on damaged lines and on planned flights that are missing.
    """

    sets: tuple[FlightSet, ...]
    provenance: tuple[Provenance, ...]
    notes: tuple[str, ...]

    @property
    def scenes(self) -> tuple[str, ...]:
        """Names of all scenes, in alphabetical order."""
        flights = (flight for one in self.sets for flight in one.flights)
        return tuple(sorted({flight["scene"] for flight in flights if flight["scene"]}))


def read_sources(paths: Sequence[Path]) -> Sources:
    """Read flights. Each tree of each source becomes a set.

    Args:
        paths: Folders of campaigns, or files with one flight per line.

    Raises:
        FileError: A folder or file is missing or has no flights.
    """
    notes: list[str] = []
    found: list[tuple[Provenance, str, tuple[dict[str, Any], ...]]] = []
    for path in dict.fromkeys(paths):
        provenance, flights = _read(path, notes)
        found += [(provenance, tree, tuple(some)) for tree, some in by_tree(flights).items()]
    names = Counter(Path(tree).stem for _, tree, _ in found)
    sets = tuple(
        FlightSet(
            label=_label(provenance, tree, alone=names[Path(tree).stem] == 1),
            tree=tree,
            flights=flights,
            source=provenance,
        )
        for provenance, tree, flights in found
    )
    provenances = {id(one.source): one.source for one in sets}
    return Sources(sets=sets, provenance=tuple(provenances.values()), notes=tuple(notes))


def _label(provenance: Provenance, tree: str, *, alone: bool) -> str:
    stem = Path(tree).stem
    return stem if alone else f"{stem} ({provenance.path})"


def _read(path: Path, notes: list[str]) -> tuple[Provenance, tuple[dict[str, Any], ...]]:
    file, plan = path, None
    runs: list[dict[str, Any]] = []
    if path.is_dir():
        file = path / FLIGHTS_FILE
        if not file.is_file():
            raise FileError(
                path, f"no flights in this folder; `uav-bt campaign` keeps them in {FLIGHTS_FILE}"
            )
        if (path / PLAN_FILE).exists():
            plan, runs = read_plan(path)
    lines = read_flights(file)
    if not lines.flights:
        raise _without_flights(path, file, plan, lines.damaged)
    notes += [f"left out: {line}" for line in lines.damaged]
    if plan is not None and len(lines.flights) < len(plan):
        notes.append(f"{path}: {len(lines.flights)} of {len(plan)} planned flights were flown")
    return Provenance(path=path, plan=plan, runs=tuple(runs)), lines.flights


def _without_flights(
    path: Path, file: Path, plan: CampaignPlan | None, damaged: Sequence[str]
) -> FileError:
    """Return the error of a folder or file without a flight, with its remedy."""
    if damaged:
        count = "1 damaged line" if len(damaged) == 1 else f"{len(damaged)} damaged lines"
        return FileError(file, f"no flights, {count}; the first of them: {damaged[0]}")
    if plan is None:
        return FileError(file, "no flights; expected lines that `uav-bt campaign` wrote")
    folder = shlex.quote(str(path))
    return FileError(
        path,
        f"this campaign has no flight yet; `uav-bt campaign --resume {folder}` flies it, and "
        f"`uav-bt campaign TREE... --out {folder}` flies another one in its place",
    )
