"""From names and patterns to a campaign's plan: every file is looked at and fingerprinted."""

from __future__ import annotations

import fnmatch
import glob
import hashlib
import importlib.metadata
import platform
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any, Final

from perception.networks.weights_file import SHIPPED_WEIGHTS
from sim_bridge.twin.scene_file import load_scene, scene_names
from uav_bt import app
from uav_bt.campaign.plan import CampaignPlan, PlannedFile
from uav_bt.campaign.store import read_plan
from uav_bt.errors import TreeError, UnknownNameError
from uav_bt.tree import MissionTree, load_tree
from uav_bt.tree.loading.source import parse_source, read_source
from uav_bt.tree.policy_check import unknown_policies
from uav_bt.tree.shipped import shipped_trees

__all__ = ["make_plan", "plan_of"]

# What decides over a flight's numbers, ours first.
_PACKAGES: Final = (
    *("uav-bt", "numpy", "py_trees", "opencv-python-headless", "openvino", "mujoco"),
    *("scikit-learn", "filterpy"),
)


def make_plan(
    trees: Sequence[str | Path],
    *,
    scenes: Sequence[str] = ("val-*",),
    flights: int = 10,
    policies: Mapping[str, str] | None = None,
    **how: Any,
) -> CampaignPlan:
    """Return the plan of a campaign; everything it names was looked at.

    Args:
        trees: tree files, or names of shipped missions.
        scenes: names of shipped scenes, scene files, or patterns (`test-*`) of either.
        flights: of each tree in each scene, one seed each.
        policies: leaf policies by node, for every tree that has the node.
        how: further fields of `CampaignPlan`.

    Raises:
        InputError: a tree, a scene or a policy cannot be used, or a number is out of range.
    """
    loaded = [_checked_tree(tree, policies or {}) for tree in trees]
    return CampaignPlan(
        trees=tuple(_planned_tree(path) for path, _ in loaded),
        scenes=tuple(_planned_scene(name) for name in _scenes(scenes)),
        flights=flights,
        policies=dict(policies or {}),
        weights=_weights(mission for _, mission in loaded),
        versions=_versions(),
        **how,
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
        scenes=[glob.escape(scene.path) for scene in before.scenes],
        flights=before.flights,
        policies=before.policies,
    )
    return replace(
        before,
        trees=plan.trees,
        scenes=tuple(
            replace(now, name=then.name)
            for now, then in zip(plan.scenes, before.scenes, strict=True)
        ),
        weights=plan.weights,
        versions=plan.versions,
    )


def _checked_tree(tree: str | Path, policies: Mapping[str, str]) -> tuple[Path, MissionTree]:
    path = app.resolve_tree(tree)
    overrides = {node: {"policy": policy} for node, policy in policies.items()}
    mission = load_tree(path, overrides=overrides)
    unknown = unknown_policies(mission, path)
    if unknown:
        raise TreeError(path, [str(finding) for finding in unknown])
    return path.resolve(), mission


def _planned_tree(path: Path) -> PlannedFile:
    # A shipped mission by its name is found on other machines and in other installations, too.
    shipped = path.parent == shipped_trees().resolve()
    sha256 = hashlib.sha256(_tree_text(path)).hexdigest()
    return PlannedFile(name=path.name, path=path.stem if shipped else str(path), sha256=sha256)


def _planned(name: str, path: Path, content: bytes) -> PlannedFile:
    return PlannedFile(name=name, path=str(path), sha256=hashlib.sha256(content).hexdigest())


def _tree_text(path: Path) -> bytes:
    """Return the texts of a tree file and of all that it includes."""
    files, texts = [path.resolve()], []
    for file in files:  # grows while it is walked through
        text = read_source(file)
        texts.append(text)
        for element in parse_source(text, file).children:
            if element.tag == "include" and "path" in element.attributes:
                included = (file.parent / element.attributes["path"]).resolve()
                if included not in files:
                    files.append(included)
    return b"\0".join(texts)


def _scenes(wanted: Sequence[str]) -> list[str]:
    """Return the scenes that names and patterns stand for, each once."""
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
    scene = load_scene(name)
    if name in scene_names():
        file = resources.files("sim_bridge.twin") / "scenes" / f"{name}.yaml"
        return PlannedFile(
            name=scene.name, path=name, sha256=hashlib.sha256(file.read_bytes()).hexdigest()
        )
    path = Path(name).resolve()
    return _planned(scene.name, path, path.read_bytes())


def _weights(missions: Iterable[MissionTree]) -> dict[str, str]:
    """Return the hashes of the files that leaves name in their ports, shipped weights included."""
    files: dict[str, Path] = {}
    for mission in missions:
        for leaf in mission.leaves():
            for port in leaf.ports:
                value = leaf.port_value(port.name) if port.type is str else None
                files |= {file.name: file for file in _files_meant(value)}
    return {name: hashlib.sha256(file.read_bytes()).hexdigest() for name, file in files.items()}


def _files_meant(value: object) -> list[Path]:
    if not isinstance(value, str) or not value:
        return []
    for name in (value, value.partition(":")[2]):  # of a policy: NAME:FILE
        if name and Path(name).is_file():
            return [Path(name)]
    # A network's name; what flies is the ONNX file, where there is one.
    shipped = [SHIPPED_WEIGHTS / f"{value}{suffix}" for suffix in (".onnx", ".safetensors")]
    return [file for file in shipped if file.is_file()][:1]


def _versions() -> dict[str, str]:
    versions = {"python": platform.python_version()}
    for package in _PACKAGES:
        try:
            versions[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            versions[package] = "none"
    return versions
