"""Sources of a report: folders of campaigns, and files of flights."""

from __future__ import annotations

import shlex
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any

from uav_bt.app.options import FlightOptions
from uav_bt.campaign.plan import CampaignPlan
from uav_bt.campaign.store import (
    FLIGHTS_FILE,
    PLAN_FILE,
    file_stem,
    key_of,
    read_flights,
    read_plan,
)
from uav_bt.errors import FileError
from uav_bt.lab.lab import Lab
from uav_bt.lab.shipped import lab_address

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

    @property
    def options(self) -> FlightOptions:
        """How the flights of the plan are flown."""
        return FlightOptions() if self.plan is None else self.plan.options

    def scene_path(self, scene: str) -> str:
        """Return the file of a scene of these flights, or the name of a shipped scene."""
        planned = self.plan.scenes if self.plan else ()
        return next((file.path for file in planned if file.name == scene), scene)

    def tree_path(self) -> str:
        """Return the file of the tree, or the name of a shipped mission."""
        planned = self.plan.trees if self.plan else ()
        return next((f.path for f in planned if f.name == self.tree), Path(self.tree).stem)

    def repeat_command(self, flight: Mapping[str, Any]) -> str:
        """Return the command that flies one of the flights again."""
        scene = None if flight["scene"] is None else self.scene_path(flight["scene"])
        out = PurePosixPath(flight.get("folder") or file_stem(key_of(flight))).name
        return fly_command(self.tree_path(), scene, flight, self.options, out=out)


def read_sources(paths: Sequence[Path]) -> tuple[FlightSet, ...]:
    """Read folders of campaigns, or files with one flight per line, each tree as a set."""
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
    file = path / FLIGHTS_FILE if path.is_dir() else path
    if path.is_dir() and not file.is_file():
        kept = f"`uav-bt campaign` keeps them in {FLIGHTS_FILE}"
        raise FileError(path, f"no flights in this folder; {kept}")
    flights, about = read_flights(file), dict[str, Any]()
    remedy = "expected lines that `uav-bt campaign` wrote"
    if path.is_dir() and (path / PLAN_FILE).exists():
        about["plan"], about["runs"] = read_plan(path)
        planned = len(about["plan"])
        remedy = f"`uav-bt campaign --resume {shlex.quote(str(path))}` flies them"
        if len(flights) < planned:
            about["note"] = f"{path}: {len(flights)} of {planned} planned flights were flown"
    if not flights:
        raise FileError(file, f"no flights; {remedy}")
    for tree, some in by_tree(flights).items():
        yield FlightSet(label=Path(tree).stem, tree=tree, flights=some, path=path, **about)


def fly_command(
    tree: str, scene: str | None, flight: Mapping[str, Any], options: FlightOptions, *, out: str
) -> str:
    """Return the `uav-bt fly` command of a flight.

    `flight` has what was drawn or changed for it, by the names in a flight's line, and
    `options` say how its campaign was flown. Leaves that write files need the output folder.
    """
    drone, folders, limit_s = flight.get("drone"), options.tree_folders, options.judge.time_limit_s
    is_default_size = options.image_size_px == FlightOptions.image_size_px
    given: list[tuple[str, object]] = [
        ("--scene", scene),
        ("--seed", str(flight["seed"])),
        ("--exact-masks", bool(flight.get("exact_masks") or options.exact_masks)),
        ("--drone", None if drone == FlightOptions.drone else drone),
        ("--profile", flight.get("profile")),
        ("--vary-room", bool(flight.get("vary_room"))),
        ("--movers", flight.get("movers") or None),
        *(("--faults", fault) for fault in flight.get("faults") or ()),
        *(("--set", f"{name}={value}") for name, value in (flight.get("ports") or {}).items()),
        *(("--var", f"{name}={value}") for name, value in (flight.get("variables") or {}).items()),
        ("--image-size", None if is_default_size else "{}x{}".format(*options.image_size_px)),
        ("--time-limit", None if limit_s is None else f"{limit_s:g}"),
        ("--lab", lab_address(options.lab) if isinstance(options.lab, Lab) else None),
        ("--tree", options.tree_id),
        *(("--trees", folder) for folder in folders.trees),
        ("--include-root", folders.include_root),
        *(("--ros-pkg", f"{name}={folder}") for name, folder in folders.packages.items()),
        *(("--policy", f"{node}={name}") for node, name in options.policy_names.items()),
        *(("--leaves", file) for file in options.leaves),
        ("--out", out),
    ]
    words = ["uav-bt", "fly", tree]
    for name, value in given:
        if value is True:
            words.append(name)
        elif value is not None and value is not False:
            words += [name, str(value)]
    return shlex.join(words)
