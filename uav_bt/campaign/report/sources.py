"""Where a report's flights come from: campaigns' folders, and plain files of flights."""

from __future__ import annotations

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
    """One folder or file that was read."""

    path: Path  # as it was given
    plan: CampaignPlan | None  # None for a plain file of flights
    runs: tuple[dict[str, Any], ...]  # when, where and of which commit it was flown

    @property
    def folder(self) -> Path:
        """The folder that it lies in, or is."""
        return self.path if self.path.is_dir() else self.path.parent


@dataclass(frozen=True, kw_only=True)
class FlightSet:
    """The flights of one tree from one source: what is compared side by side."""

    label: str  # unlike the other sets' labels
    tree: str
    flights: tuple[dict[str, Any], ...]
    source: Provenance

    def scene_path(self, scene: str) -> str:
        """Return where a scene of these flights is found: a file, or a shipped scene's name."""
        planned = self.source.plan.scenes if self.source.plan is not None else ()
        return next((file.path for file in planned if file.name == scene), scene)

    def tree_path(self) -> str:
        """Return where the tree is found: a file, or a shipped mission's name."""
        planned = self.source.plan.trees if self.source.plan is not None else ()
        known = (file.path for file in planned if file.name == self.tree)
        return next(known, Path(self.tree).stem)


@dataclass(frozen=True, kw_only=True)
class Sources:
    """Everything that a report is about."""

    sets: tuple[FlightSet, ...]
    provenance: tuple[Provenance, ...]
    notes: tuple[str, ...]  # damaged lines, flights that are still to be flown

    @property
    def scenes(self) -> tuple[str, ...]:
        """Names of all scenes, in alphabetical order."""
        flights = (flight for one in self.sets for flight in one.flights)
        return tuple(sorted({flight["scene"] for flight in flights if flight["scene"]}))


def read_sources(paths: Sequence[Path]) -> Sources:
    """Read flights, each tree of each source a set of its own.

    Args:
        paths: campaigns' folders, or files with a flight a line.

    Raises:
        FileError: there is nothing to read, or nothing that is a flight.
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
        more = f"; the first of them: {lines.damaged[0]}" if lines.damaged else ""
        raise FileError(file, f"no flights, {len(lines.damaged)} damaged lines{more}")
    notes += [f"left out: {line}" for line in lines.damaged]
    if plan is not None and len(lines.flights) < len(plan):
        notes.append(f"{path}: {len(lines.flights)} of {len(plan)} planned flights were flown")
    return Provenance(path=path, plan=plan, runs=tuple(runs)), lines.flights
