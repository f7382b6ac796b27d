"""From names and patterns to a campaign's plan: every file is read and fingerprinted."""

from __future__ import annotations

import fnmatch
import glob
import hashlib
from collections.abc import Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any

from sim_bridge.twin.scene_file import load_scene, scene_names
from uav_bt.app import provenance
from uav_bt.app.loading import load_mission
from uav_bt.app.options import FlightOptions, given_options
from uav_bt.app.random_faults import check_faults
from uav_bt.campaign.plan import CampaignPlan, PlannedFile
from uav_bt.campaign.store import read_plan
from uav_bt.errors import UnknownNameError
from uav_bt.tree import MissionTree
from uav_bt.tree.shipped import shipped_missions


def make_plan(
    trees: Sequence[str | Path],
    options: FlightOptions | None = None,
    *,
    scenes: Sequence[str] = ("val-*",),
    flights: int = 10,
    seed_from: int = 0,
    record: bool = False,
    timeout_s: float = CampaignPlan.timeout_s,
    **how: Any,
) -> CampaignPlan:
    """Return the plan of a campaign; everything it names was read.

    Args:
        trees: tree files, or names of shipped missions.
        options: how all are flown, by the fields in `uav_bt.campaign.plan.SHARED`.
        scenes: names of shipped scenes, scene files, or patterns (`test-*`) of either.
        flights: of each tree in each scene, one seed each.
        seed_from: the first seed.
        record: keep a record of every flight.
        timeout_s: wall time after which a flight counts as hung.
        how: fields of `FlightOptions`, in place of an object or to change one.

    Raises:
        InputError: a tree, a scene or a policy cannot be used, or a number is out of range.
    """
    options = given_options(options, how)
    leaves = [Path(file).resolve() for file in options.leaves]
    options = replace(
        options, tree_folders=options.tree_folders.absolute(), leaves=tuple(map(str, leaves))
    )
    check_faults(options.faults)
    missions = [load_mission(tree, options) for tree in trees]
    return CampaignPlan(
        trees=tuple(map(_planned_tree, missions)),
        scenes=tuple(_planned_scene(name) for name in _scenes(scenes)),
        flights=flights,
        seed_from=seed_from,
        options=options,
        record=record,
        timeout_s=timeout_s,
        weights=provenance.weights_of(*missions),
        leaves_sha256={str(file): hashlib.sha256(file.read_bytes()).hexdigest() for file in leaves},
        versions=provenance.package_versions(),
    )


def plan_of(folder: Path) -> CampaignPlan:
    """Return the plan that a campaign's folder holds, as it would be made today.

    Raises:
        FileError: the folder holds no campaign.
        InputError: a file that it needs cannot be used any more.
    """
    before, _ = read_plan(folder)
    plan = make_plan(
        [tree.path for tree in before.trees],
        before.options,
        scenes=[glob.escape(scene.path) for scene in before.scenes],
        flights=before.flights,
    )
    return replace(
        before,
        trees=plan.trees,
        scenes=tuple(
            replace(now, name=then.name)
            for now, then in zip(plan.scenes, before.scenes, strict=True)
        ),
        weights=plan.weights,
        leaves_sha256=plan.leaves_sha256,
        versions=plan.versions,
    )


def _planned_tree(mission: MissionTree) -> PlannedFile:
    # A shipped mission by its name is found on other machines and in other installations, too.
    path = mission.path
    shipped = path in {file.resolve() for file in shipped_missions().values()}
    return PlannedFile(
        name=path.name,
        path=path.stem if shipped else str(path),
        sha256=provenance.sha256_of(mission),
    )


def _scenes(wanted: Sequence[str]) -> list[str]:
    """Return the scenes that names and patterns match, each once."""
    shipped, found = scene_names(), []
    for word in (part.strip() for text in wanted for part in text.split(",")):
        if not word:
            continue
        matches = fnmatch.filter(shipped, word) or sorted(glob.glob(word))  # noqa: PTH207 - absolute ones too
        if not matches and glob.has_magic(word):
            raise UnknownNameError("scene pattern", word, shipped)
        found += matches or [word]
    return list(dict.fromkeys(found))


def _planned_scene(name: str) -> PlannedFile:
    scene, shipped = load_scene(name), name in scene_names()
    folder = resources.files("sim_bridge.twin") / "scenes"
    content = (folder / f"{name}.yaml" if shipped else Path(name)).read_bytes()
    return PlannedFile(
        name=scene.name,
        path=name if shipped else str(Path(name).resolve()),
        sha256=hashlib.sha256(content).hexdigest(),
    )
