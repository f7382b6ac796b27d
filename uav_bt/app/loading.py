"""Loads a mission, with the values that options and site replace in it."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, TypeGuard

from py_trees.behaviour import Behaviour

from uav_bt.app.option_values import expect
from uav_bt.app.options import FlightOptions
from uav_bt.app.place import limits_of
from uav_bt.app.site import Site
from uav_bt.board import CLASS_MAP, FLIGHT_HEIGHT, METRIC_DEPTH, Key
from uav_bt.errors import FileError, InputError, TreeError
from uav_bt.lab.lab import Lab
from uav_bt.tree import MissionTree, Node, NodeRegistry, load_tree, parse_tree
from uav_bt.tree.loading.before_flight import faults_of
from uav_bt.tree.loading.findings import errors_of
from uav_bt.tree.loading.lookup import TreeFolders
from uav_bt.tree.loading.parameter_file import ParameterFile
from uav_bt.tree.loading.replacements import replace_in
from uav_bt.tree.loading.uses import Uses
from uav_bt.tree.registry import with_leaves
from uav_bt.tree.shipped import resolve_tree

Mission = str | Path | MissionTree | Node | Behaviour
"""A mission: a shipped one's name, a tree file, a tree or its root, or a tree file's text.

A text begins with `<`. A root is a node, or a behaviour of py_trees.
"""

_HEIGHT_PORT: Final = "height_m"  # of a leaf that sets the flight height
_ByKey = Mapping[Key[Any], Mapping[str, str]]

_log = logging.getLogger(__name__)


def is_text(tree: Mission) -> TypeGuard[str]:
    """Return whether a mission is given as a tree file's text."""
    return isinstance(tree, str) and tree.lstrip().startswith("<")


def load_mission(
    tree: Mission, options: FlightOptions, registry: NodeRegistry | None = None
) -> MissionTree:
    """Load the tree of a flight: as `read_mission`, and within the flight's limits."""
    mission = read_mission(tree, options, registry)
    if faults := errors_of(faults_of(Uses(mission))):
        raise TreeError(mission.path, faults)
    _check_ceiling(mission, limits_of(options).ceiling_m)
    return mission


def read_mission(
    tree: Mission,
    options: FlightOptions,
    registry: NodeRegistry | None = None,
    *,
    replaced: Mapping[str, Mapping[str, str]] | None = None,
) -> MissionTree:
    """Load a tree with the values that options and site replace in it.

    `replaced`: further attribute values that replace the tree's, by a node's name or path.
    """
    if isinstance(options.params, ParameterFile) and options.params.variants:
        raise FileError(
            options.params.path,
            f"has variants ({', '.join(options.params.variants)}), which only a campaign flies",
        )
    expect("registry", registry, NodeRegistry | None, "NodeRegistry.installed().with_nodes(...)")
    overrides = {node: dict(given) for node, given in (replaced or {}).items()}
    for node, policy in options.policy_names.items():
        overrides.setdefault(node, {})["policy"] = policy
    by_key = _site_values(options.place or Site())
    registry = registry or NodeRegistry.installed()
    if isinstance(tree, Node | Behaviour):
        tree = MissionTree(tree, name=tree.name)
    if isinstance(tree, MissionTree):
        _check_made(tree, options)
        replace_in(tree, registry, options.parameters, overrides, by_key)
    else:
        expect("tree", tree, str | Path, "a mission's name, a tree file, its text, or a tree")
        read = parse_tree if is_text(tree) else load_tree
        source: Any = tree if is_text(tree) else resolve_tree(tree)
        registry = registry.with_policies(options.policy_objects)
        tree = read(
            source,
            with_leaves(registry, [Path(file) for file in options.leaves]),
            tree_id=options.tree_id,
            overrides=overrides,
            by_key=by_key,
            lookup=options.tree_folders.lookup(),
            parameters=options.parameters,
        )
    _check_site_reaches(tree, by_key, options)
    return tree


def _check_made(tree: MissionTree, options: FlightOptions) -> None:
    """Refuse a tree that flew, and options that are for tree files."""
    if tree.is_set_up:
        raise InputError(f"tree '{tree.name}' was flown or set up before: make it anew each time")
    for what, given in (
        ("tree_id", options.tree_id not in {None, tree.name}),
        ("tree_folders", options.tree_folders != TreeFolders()),
        ("leaves", options.leaves),
        ("variables", options.parameters.variables),
    ):
        if given:
            raise InputError(
                f"{what}: for tree files only; '{tree.name}' is loaded already (its variables are "
                "set with tree.variables['name'] = value)"
            )


def _site_values(site: Site) -> _ByKey:
    """Return the attributes that a site replaces, by the key that their leaves write."""
    stated: Mapping[Key[Any], Mapping[str, object]] = {
        CLASS_MAP: {"model": site.model, "classes": site.classes},
        METRIC_DEPTH: {"model": site.depth},
        FLIGHT_HEIGHT: {_HEIGHT_PORT: site.flight_height_m},
    }
    return {
        key: {name: str(value) for name, value in values.items() if value is not None}
        for key, values in stated.items()
    }


def _check_site_reaches(mission: MissionTree, by_key: _ByKey, options: FlightOptions) -> None:
    """Refuse a tree whose leaves cannot take a site's setting; log one that no leaf asks for.

    A tree may ignore the depth network, and a segmentation network that no lab file states.
    """
    source, ignored = "site", [METRIC_DEPTH.name]
    if isinstance(options.lab, Lab):
        source = "lab"
        ignored += [] if "model" in (options.lab.flight.network or {}) else [CLASS_MAP.name]
    for key, attributes in by_key.items():
        writers = [leaf for leaf in mission.leaves() if key in leaf.writes]
        for name, value in attributes.items() if key.name not in ignored else ():
            setting = f"the {source}'s {name}='{value}'"
            if not writers:
                _log.warning(
                    "Warning: %s has no effect: no leaf of tree '%s' writes '%s'",
                    *(setting, mission.name, key.name),
                )
            elif not any(name in leaf.values_taken({key: attributes}) for leaf in writers):
                raise InputError(
                    f"{setting} reaches no leaf of tree '{mission.name}': '{writers[0].path}' "
                    f"writes '{key.name}' but has no port '{name}'; add it, or drop this setting"
                )


def _check_ceiling(mission: MissionTree, ceiling_m: float) -> None:
    """Refuse a flight height above the ceiling, if it is known before the flight."""
    for leaf in mission.leaves():
        values = {port.name: leaf.initial_value(port) for port in leaf.ports}
        height_m = values.get(_HEIGHT_PORT) if FLIGHT_HEIGHT in leaf.writes else None
        if height_m is not None and height_m > ceiling_m:
            raise InputError(
                f"node '{leaf.path}' is to fly at {height_m:g} m, above the ceiling of "
                f"{ceiling_m:g} m: lower the flight height or raise the limit ceiling_m"
            )
