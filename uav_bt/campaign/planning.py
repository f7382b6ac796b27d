"""From names and patterns to a campaign's plan: every file is read and fingerprinted."""

from __future__ import annotations

import fnmatch
import glob
import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from sim_bridge.twin.scene_file import load_scene, scene_files, scene_path, shipped_scenes
from uav_bt.app import provenance
from uav_bt.app.drone_of_flight import check_faults, check_phases
from uav_bt.app.loading import is_text, load_mission
from uav_bt.app.options import FlightOptions, given_options
from uav_bt.app.place import lab_of, scene_of
from uav_bt.campaign.plan import CampaignPlan, PlannedFile
from uav_bt.campaign.store import read_plan
from uav_bt.errors import InputError, UnknownNameError
from uav_bt.lab.lab import Lab
from uav_bt.lab.shipped import lab_address, load_lab
from uav_bt.tree import MissionTree, TreeFolders
from uav_bt.tree.loading.parameter_file import ParameterFile
from uav_bt.tree.loading.parameters import Parameters
from uav_bt.tree.shipped import shipped_missions


def make_plan(
    trees: Sequence[str | Path],
    options: FlightOptions | None = None,
    *,
    scenes: Sequence[str] | None = None,
    flights: int = 10,
    seed_from: int = 0,
    record: bool = False,
    timeout_s: float = CampaignPlan.timeout_s,
    **how: Any,
) -> CampaignPlan:
    """Return the plan of a campaign; everything it names was read.

    Args:
        trees: tree files, or names of shipped missions.
        options: how all are flown, by the fields in `uav_bt.app.options.SHARED`, and
            `params`, each of whose variants is flown.
        scenes: names of the lab's scenes, files, or patterns (`test-*`) of either. Default:
            all scenes of the lab's folder; without a lab `val-*`.
        flights: of each tree in each scene, one seed each.
        seed_from: the first seed.
        record: keep a record of every flight.
        timeout_s: wall time after which a flight counts as hung.
        how: fields of `FlightOptions`, in place of an object or to change one.

    Raises:
        InputError: a tree, a scene or a policy cannot be used, a scene is of another lab, or a
            number is out of range.
    """
    options = given_options(options, how)
    planned = tuple(file for tree in trees for file in _variants(tree, options))
    common = options.parameters
    options = replace(
        options,
        lab=lab_address(options.lab) if isinstance(options.lab, Lab) else None,
        tree_folders=TreeFolders(**options.tree_folders.to_json()),
        leaves=tuple(str(Path(file).resolve()) for file in options.leaves),
        ports=common.ports,
        variables=common.variables,
        params=None,
    )
    plan = CampaignPlan(
        trees=planned,
        scenes=tuple(planned_scenes(scenes, options)),
        flights=flights,
        seed_from=seed_from,
        options=options,
        record=record,
        timeout_s=timeout_s,
    )
    return _fingerprinted(plan)


def plan_of(folder: Path) -> CampaignPlan:
    """Return the plan that a campaign's folder holds, as it would be made today.

    Raises:
        FileError: the folder holds no campaign.
        InputError: a file that it needs cannot be used any more.
    """
    return _fingerprinted(read_plan(folder)[0])


def _loaded(tree: str | Path, options: FlightOptions) -> MissionTree:
    mission = load_mission(tree, options)
    check_phases(mission, check_faults(options.faults))
    return mission


def _variants(tree: str | Path, options: FlightOptions) -> Iterator[PlannedFile]:
    """Yield a tree once for each variant of the parameters."""
    if is_text(tree) or not isinstance(tree, str | Path):
        raise InputError(f"a campaign flies tree files, which its workers read; got {tree!r:.40}")
    variants = {"": Parameters()}
    if isinstance(options.params, ParameterFile):
        variants = dict(options.params.variants) or {"": options.params.common}
    shipped = {file.resolve() for file in shipped_missions().values()}
    for variant, values in variants.items():
        file = ParameterFile(path=Path("campaign"), common=values)
        path = _loaded(tree, replace(options, params=file)).path
        yield PlannedFile(
            name=f"{path.stem}[{variant}]{path.suffix}" if variant else path.name,
            # A shipped mission is found by its name on other machines, too.
            path=path.stem if path in shipped else str(path),
            # Values of the command line take precedence over a variant.
            ports={k: v for k, v in values.ports.items() if k not in options.ports},
            variables={k: v for k, v in values.variables.items() if k not in options.variables},
        )


def planned_scenes(wanted: Sequence[str] | None, options: FlightOptions) -> Iterator[PlannedFile]:
    """Yield the scenes that names and patterns match, each once; None: those of the lab."""
    own = options.lab.scenes if isinstance(options.lab, Lab) else {}
    if wanted is None:
        wanted = tuple(own)
        if not own:
            scene_of(options)  # refuses a lab without scenes
            wanted = ("val-*",)
    known: dict[str, str | Path] = {**{name: name for name in scene_files()}, **own}
    found: list[str] = []
    for word in (part.strip() for text in wanted for part in text.split(",")):
        if not word:
            continue
        among = fnmatch.filter(own, word) or fnmatch.filter(known, word)
        matches = among or sorted(glob.glob(word))  # noqa: PTH207 - absolute ones too
        if not matches and glob.has_magic(word):
            raise UnknownNameError("scene pattern", word, known)
        found += [str(known.get(name, name)) for name in matches or [word]]
    for scene in dict.fromkeys(found):
        path = scene if scene in shipped_scenes() else str(scene_path(scene).resolve())
        yield PlannedFile(name=load_scene(scene).name, path=path)


def _fingerprinted(plan: CampaignPlan) -> CampaignPlan:
    """Return a plan with today's versions, and hashes of all files that it needs."""
    options = plan.options
    missions = [_loaded(tree.path, tree.options(options)) for tree in plan.trees]
    places = [load_scene(scene.path) for scene in plan.scenes]
    texts = [shipped_scenes().get(scene.path, Path(scene.path)) for scene in plan.scenes]
    labs = [lab_of(options, place) or load_lab(place.lab) for place in places]
    trees = zip(plan.trees, missions, strict=True)
    scenes = zip(plan.scenes, texts, strict=True)
    return replace(
        plan,
        trees=tuple(replace(tree, sha256=provenance.sha256_of(found)) for tree, found in trees),
        scenes=tuple(replace(scene, sha256=_sha256(text)) for scene, text in scenes),
        weights=provenance.weights_of(*missions),
        leaves_sha256={str(file): _sha256(Path(file)) for file in options.leaves},
        lab_sha256=_lab_sha256(options, labs),
        versions=provenance.package_versions(),
    )


def _lab_sha256(options: FlightOptions, of_scenes: Sequence[Lab]) -> dict[str, str]:
    """Return the SHA-256 of all labs' files; of the default lab only where it is named."""
    named = [options.lab] if isinstance(options.lab, Lab) else []
    labs = {lab.file.resolve(): lab for lab in (*of_scenes, *named)}
    if not named:
        labs.pop(load_lab().file.resolve(), None)
    found = {}
    for lab in labs.values():
        model = Path(lab.network.get("model", ""))
        network = model if model.suffix else None  # else the name of a shipped one
        built = () if lab.room is None else lab.room.files
        for file in (lab.file, lab.flight.camera, network, lab.network.get("classes"), *built):
            if file is not None:
                found[f"{lab.name}/{file.name}"] = _sha256(file)
    return found


def _sha256(file: Path) -> str:
    return hashlib.sha256(file.read_bytes()).hexdigest()
