"""Imports only go down. Late imports and those for type checkers are checked, too."""

from __future__ import annotations

import ast
import tomllib
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.worlds.processes import ROOT, python

ROOMS = ("uav_bt", "perception", "sim_bridge", "behaviours", "trees")

# The vocabulary: the single-file modules of `uav_bt`, and the package `types`.
VOCABULARY = """
answers types clock compiled errors files inputs lab landing_marks
option plugins protocols settings yaml_file
"""
FLOOR_ONE = {f"uav_bt.{name}" for name in VOCABULARY.split()}
# The top floor composes everything: it may import all, and only the top floor may import it.
FLOOR_FOUR = {f"uav_bt.{name}" for name in ("__main__", "app", "campaign", "cli", "learning")}
# Packages that build and train networks. Flights do not need torch.
TRAINERS = tuple(
    f"perception.{room}.training" for room in ("segmentation", "depth", "control", "networks")
)
# These libraries report their use; one module disables that before it imports them.
REPORTING = ("openvino", "nncf", "onnxruntime")
REPORTS_OFF = "perception.networks.inference_packages"


class Import(NamedTuple):
    """One module imports another."""

    importer: str
    imported: str
    line: int

    def __str__(self) -> str:
        return f"{self.importer}:{self.line} imports {self.imported}"


def module_name(path: Path, root: Path = ROOT) -> str:
    parts = path.relative_to(root).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def imports_of(source: str, name: str, *, is_package: bool = False) -> Iterator[Import]:
    """Find all imports in a module, at any place."""
    package = name if is_package else name.rpartition(".")[0]
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            for alias in node.names:
                yield Import(name, alias.name, node.lineno)
        elif isinstance(node, ast.ImportFrom):
            base = node.module or ""
            if node.level:
                above = package.split(".")[: len(package.split(".")) - node.level + 1]
                base = ".".join([*above, *filter(None, [node.module])])
            # `from uav_bt import app` imports a module, `from uav_bt.app import fly` one too.
            for alias in node.names:
                yield Import(name, f"{base}.{alias.name}", node.lineno)
        elif isinstance(node, ast.Call) and _imports_by_name(node.func):
            for argument in node.args[:1]:
                if isinstance(argument, ast.Constant) and isinstance(argument.value, str):
                    yield Import(name, argument.value, node.lineno)


@cache
def imports_in(path: Path) -> tuple[Import, ...]:
    """Return the imports of one of our modules."""
    text, is_package = path.read_text(encoding="utf-8"), path.stem == "__init__"
    return tuple(imports_of(text, module_name(path), is_package=is_package))


def _imports_by_name(function: ast.expr) -> bool:
    called = function.attr if isinstance(function, ast.Attribute) else getattr(function, "id", "")
    return called in {"import_module", "__import__"}


def within(module: str, *homes: str) -> bool:
    return any(module == home or module.startswith(f"{home}.") for home in homes)


def floor(module: str) -> int:
    if within(module, *FLOOR_FOUR):
        return 4
    if within(module, "behaviours"):
        return 3
    return 1 if within(module, *FLOOR_ONE) or module in {"uav_bt", "uav_bt.__version__"} else 2


def objection(found: Import) -> str | None:
    """Return why an import is forbidden, None if it is allowed."""
    importer, imported = found.importer, found.imported
    if within(imported, "torch"):
        trains = floor(importer) == 4 or within(importer, *TRAINERS)
        return None if trains else "torch is for training only"
    if within(imported, *REPORTING):
        return None if importer == REPORTS_OFF else f"only {REPORTS_OFF} imports it, reports off"
    return _objection_to_ours(importer, imported) if within(imported, *ROOMS) else None


def _objection_to_ours(importer: str, imported: str) -> str | None:
    mine, theirs = floor(importer), floor(imported)
    rooms = [name.partition(".")[0] for name in (importer, imported)]
    if mine < 4 and theirs > mine:
        return f"floor {mine} imports floor {theirs}"
    if mine == 2 and theirs == 2 and rooms[0] != rooms[1]:
        return f"rooms of floor 2 do not know each other, and '{rooms[0]}' imports '{rooms[1]}'"
    if mine == 3 and rooms[1] == "sim_bridge":
        return "leaves fly any drone: they must not import 'sim_bridge'"
    return None


def modules() -> list[Path]:
    return [path for room in ROOMS for path in sorted((ROOT / room).rglob("*.py"))]


def test_there_are_modules_to_look_at() -> None:
    assert len(modules()) > 100
    assert {path.relative_to(ROOT).parts[0] for path in modules()} == set(ROOMS)


@pytest.mark.parametrize("room", ROOMS)
def test_imports_only_go_down(room: str) -> None:
    against = [
        f"{item}: {why}"
        for path in sorted((ROOT / room).rglob("*.py"))
        for item in imports_in(path)
        if (why := objection(item)) is not None
    ]
    assert against == []


# Packages whose modules must not import each other in a circle.
WITHOUT_CIRCLES = ("uav_bt", "behaviours", "perception", "sim_bridge")


def arrows_between(packages: tuple[str, ...]) -> dict[str, set[str]]:
    """Return, for each module of some packages, its imports from these packages."""
    sources = {
        module_name(path): path for path in modules() if within(module_name(path), *packages)
    }
    arrows: dict[str, set[str]] = {}
    for name, path in sources.items():
        found = {item.imported for item in imports_in(path)}
        # `from uav_bt.tree import Leaf` imports the package, not a module of that name.
        named = {each if each in sources else each.rpartition(".")[0] for each in found}
        arrows[name] = (named & sources.keys()) - {name}
    return arrows


@pytest.mark.parametrize("package", WITHOUT_CIRCLES)
def test_imports_go_in_no_circle(package: str) -> None:
    """Late imports and those for type checkers count; a CycleError has the circle."""
    TopologicalSorter(arrows_between((package,))).prepare()


UPWARD = """
uav_bt.types: import uav_bt.board
uav_bt.clock: from uav_bt import tree
uav_bt.tree.loading.loader: from uav_bt.app import fly
uav_bt.tree.loading.loader: def late(): from uav_bt import cli
uav_bt.mission.runner: import behaviours.fly.explore
uav_bt.mission.runner: if TYPE_CHECKING: from sim_bridge.twin import drone
uav_bt.display.lab_map: import perception.pose
uav_bt.display.lab_map: import importlib; importlib.import_module('perception.landing')
uav_bt.plugins: from ..behaviours import explore
uav_bt.display.lab_map: from .. import app
perception.landing.detector: from uav_bt.board import MARK
perception.landing.detector: with suppress(ImportError): import sim_bridge
perception.landing.detector: import torch
perception.networks.onnx_runtime: def late(): from openvino import Type
perception.networks.training.network_files: import nncf
sim_bridge.twin.drone: from perception import classes
sim_bridge.twin.drone: from uav_bt.mission import runner
behaviours.fly.explore: from sim_bridge.twin import TwinConfig
behaviours.fly.explore: def late(): import torch.nn
behaviours.fly.explore: from uav_bt import app
"""
DOWNWARD = """
uav_bt.protocols: import numpy; from uav_bt.types import Frame
uav_bt.tree.registry: from uav_bt import errors; from uav_bt.tree import node
perception.segmentation.training.unet: import torch; from uav_bt.lab.classes import LabClass
behaviours.fly.explore: from perception import helipad; from uav_bt.tree import Leaf
uav_bt.app: from sim_bridge.twin import TwinConfig; import behaviours
uav_bt.cli.fly: from uav_bt import __version__, app
"""


@pytest.mark.parametrize("line", UPWARD.strip().splitlines())
def test_an_upward_import_would_be_found(line: str) -> None:
    importer, _, source = line.partition(": ")
    assert any(objection(item) for item in imports_of(source, importer))


@pytest.mark.parametrize("line", DOWNWARD.strip().splitlines())
def test_a_downward_import_is_allowed(line: str) -> None:
    importer, _, source = line.partition(": ")
    found = list(imports_of(source, importer))
    assert found
    assert not any(map(objection, found))


FLOWN = ["perception.segmentation.runtime", "perception.depth.runtime", "sim_bridge.twin.drone"]
FLOWN += ["uav_bt.app", "uav_bt.app.film", "uav_bt.cli.fly"]
FLOWN += [module_name(path) for path in (ROOT / "behaviours").rglob("*.py")]
KNOWN = ["behaviours.nodes", "behaviours.perceive.depth", "behaviours.perceive.site_map"]


@pytest.mark.parametrize(
    "code",
    [
        pytest.param(f"sys.modules['torch'] = None; import {', '.join(FLOWN)}", id="flights"),
        pytest.param(f"sys.modules['numba'] = None; import {', '.join(KNOWN)}", id="lists"),
        pytest.param(
            "import perception.mapping.site_mapper; sys.modules['perception.mapping.contact_scan']",
            id="compiled before the flight",
        ),
    ],
)
def test_what_flies_needs_no_torch_and_what_is_listed_no_numba(code: str) -> None:
    done = python("-c", f"import sys; {code}")
    assert done.returncode == 0, done.stderr


@cache
def registered_names() -> set[str]:
    """Return the concrete leaves, policies and drones that our own packages register."""
    with (ROOT / "pyproject.toml").open("rb") as file:
        groups = tomllib.load(file)["project"]["entry-points"]
    names = {name for group in ("uav_bt.policies", "uav_bt.drones") for name in groups[group]}
    from behaviours.nodes import NODES  # only this test needs one of our packages

    return names | {node.node_id for node in NODES}


def words_of(source: str) -> Iterator[tuple[int, str]]:
    """Yield the names and the string constants of a module, without docstrings."""
    tree = ast.parse(source)
    prose = {
        id(node.value)
        for node in ast.walk(tree)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
    }
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in prose:
            yield node.lineno, node.value


COMMANDS = {"TakeOff", "Land", "MoveBy"}  # which have the names of the leaves that send them
# Writers of the mission board's keys, and a key with the name of the policy that reads it.
WRITERS = "Segment EstimateDepth BuildCorridor FindMark TrackMotion MapSite RememberViews Advise"
ALLOWED = {
    "uav_bt.types": COMMANDS,
    "uav_bt.types.commands": COMMANDS,
    "uav_bt.board.keys": {*WRITERS.split(), "corridor"},
}


def test_the_framework_names_no_concrete_leaf_policy_or_drone() -> None:
    named = [
        f"{name}:{line}: '{word}'"
        for path in sorted((ROOT / "uav_bt").rglob("*.py"))
        if floor(name := module_name(path)) in (1, 2)
        for line, word in words_of(path.read_text(encoding="utf-8"))
        if word in registered_names() - ALLOWED.get(name, set())
    ]
    assert named == []
