"""Loads a mission, with the values that options and site replace in it."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any, Final, TypeGuard

from py_trees.behaviour import Behaviour

from uav_bt.app.options import FlightOptions
from uav_bt.app.place_of_flight import limits_of, site_of
from uav_bt.app.site import Site
from uav_bt.board import CLASS_MAP, FLIGHT_HEIGHT, METRIC_DEPTH, Key
from uav_bt.errors import FileError, InputError, TreeError
from uav_bt.lab.lab import Lab
from uav_bt.mission.limits import Limits
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

A text is a `str` whose first character, blanks aside, is `<`. A root is a node, or a behaviour of
py_trees in whose tree nodes may stand.
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
    """Load the tree of a flight: as `read_mission`, and within the flight's limits.

    Args:
        tree: the mission.
        options: how it is flown.
        registry: the nodes that may occur; default: all installed.

    Raises:
        InputError: the tree was refused, or its flight height lies above the ceiling.
        TreeError: the tree would surely fail in flight.
    """
    mission = read_mission(tree, options, registry)
    if faults := errors_of(faults_of(Uses(mission))):
        raise TreeError(mission.path, faults)
    check_ceiling(mission, limits_of(options))
    return mission


def read_mission(
    tree: Mission,
    options: FlightOptions,
    registry: NodeRegistry | None = None,
    *,
    replaced: Mapping[str, Mapping[str, str]] | None = None,
) -> MissionTree:
    """Load a tree with the values that options and site replace in it.

    Args:
        tree: the mission.
        options: which tree of a file, where else trees are, policies by node, and the site.
        registry: the nodes that may occur; default: all installed.
        replaced: further attribute values that replace the tree's, by a node's name or path.

    Raises:
        TreeError: the file was refused, or a policy is unknown.
        FileError: the file or folder does not exist, or the parameter file has variants.
        InputError: `tree` is not a mission or was set up before, or its leaves cannot take a
            setting of the site.
    """
    if isinstance(options.params, ParameterFile) and options.params.variants:
        raise FileError(
            options.params.path,
            f"has variants ({', '.join(options.params.variants)}), and a campaign flies them; give "
            "a file with `set` and `var` only",
        )
    overrides = _overrides(options, replaced or {})
    site = site_of(options)
    by_key, source = _site_values(site), "site" if site is None else site.source
    stated = _stated(by_key, options)
    if isinstance(tree, Node | Behaviour):
        tree = MissionTree(tree, name=tree.name)
    if isinstance(tree, MissionTree):
        _check_made(tree, options)
        known = registry or NodeRegistry.installed()
        replace_in(tree, known, options.parameters, overrides, by_key)
        _check_site_reaches(tree, stated, source)
        return tree
    if registry is not None and not isinstance(registry, NodeRegistry):
        raise InputError(
            "registry: expected a NodeRegistry, such as "
            f"NodeRegistry.installed().with_nodes(Peek); got {registry!r:.80}"
        )
    registry = (registry or NodeRegistry.installed()).with_policies(options.policy_objects)
    registry = with_leaves(registry, [Path(file) for file in options.leaves])
    if isinstance(tree, str | Path):
        load = (
            partial(parse_tree, tree) if is_text(tree) else partial(load_tree, resolve_tree(tree))
        )
        loaded = load(
            registry,
            tree_id=options.tree_id,
            overrides=overrides,
            by_key=by_key,
            lookup=options.tree_folders.lookup(),
            parameters=options.parameters,
        )
        _check_site_reaches(loaded, stated, source)
        return loaded
    raise InputError(
        "expected a mission: a shipped one's name, a tree file, a MissionTree, the root of a tree "
        f"or a tree file's text; got {tree!r:.80}"
    )


def _check_made(tree: MissionTree, options: FlightOptions) -> None:
    """Refuse a tree that flew, and options that are for tree files."""
    if tree.is_set_up:
        raise InputError(
            f"tree '{tree.name}' was flown or set up before, and a tree flies once: load or "
            "compose it anew for each flight"
        )
    this = f"this is '{tree.name}', which is loaded already"
    if options.tree_id not in {None, tree.name}:
        raise InputError(f"tree_id={options.tree_id!r} is for tree files; {this}")
    if options.tree_folders != TreeFolders():
        raise InputError(f"tree_folders are for tree files; {this}")
    if options.leaves:
        raise InputError(f"leaves are for tree files; {this} and has its own")
    for name, value in options.parameters.variables.items():
        raise InputError(
            f"variables are for tree files; {this}: write tree.variables['{name}'] = {value!r}"
        )


def _overrides(
    options: FlightOptions, replaced: Mapping[str, Mapping[str, str]]
) -> dict[str, dict[str, str]]:
    """Return the attribute values that replace the tree's, by node, besides ports."""
    overrides = {node: dict(given) for node, given in replaced.items()}
    for node, policy in options.policy_names.items():
        overrides.setdefault(node, {})["policy"] = policy
    return overrides


def _site_values(site: Site | None) -> _ByKey:
    """Return the attributes that a site replaces, by the board key that their leaves write."""
    if site is None:
        return {}
    height_m = None if site.flight_height_m is None else f"{site.flight_height_m:g}"
    classes = None if site.classes is None else str(site.classes)
    wanted: dict[Key[Any], dict[str, str | None]] = {
        CLASS_MAP: {"model": site.model, "classes": classes},
        METRIC_DEPTH: {"model": site.depth},
        FLIGHT_HEIGHT: {_HEIGHT_PORT: height_m},
    }
    given = {
        key: {name: value for name, value in attributes.items() if value is not None}
        for key, attributes in wanted.items()
    }
    return {key: attributes for key, attributes in given.items() if attributes}


def _stated(by_key: _ByKey, options: FlightOptions) -> _ByKey:
    """Return the attributes without networks that a tree may ignore.

    They are those of depth, and a segmentation network that no lab file states.
    """
    ignored: set[Key[Any]] = {METRIC_DEPTH}
    if isinstance(options.lab, Lab) and "model" not in (options.lab.flight.network or {}):
        ignored.add(CLASS_MAP)
    return {key: values for key, values in by_key.items() if key not in ignored}


def _check_site_reaches(mission: MissionTree, by_key: _ByKey, source: str) -> None:
    """Refuse a tree whose leaves cannot take a site's setting; log one that no leaf asks for.

    Args:
        mission: the tree.
        by_key: attributes that the site replaces, by board key.
        source: what states them, in messages.

    Raises:
        InputError: leaves write the board key of the setting, and none of them has its port.
    """
    for key, attributes in by_key.items():
        writers = [leaf for leaf in mission.leaves() if key in leaf.writes]
        for name, value in attributes.items():
            if not writers:
                _log.warning(
                    "Warning: the %s's %s='%s' has no effect: no leaf of tree '%s' writes '%s'",
                    source,
                    name,
                    value,
                    mission.name,
                    key.name,
                )
            elif not any(name in leaf.values_taken({key: attributes}) for leaf in writers):
                raise InputError(
                    f"the {source}'s {name}='{value}' reaches no leaf of tree '{mission.name}': "
                    f"'{writers[0].path}' writes '{key.name}' but has no port '{name}'; give it "
                    "that port, or fly without this setting"
                )


def check_ceiling(mission: MissionTree, limits: Limits) -> None:
    """Refuse a tree that is to fly higher than it may.

    Args:
        mission: the tree; a height that a leaf or a script writes is known in flight only.
        limits: the ceiling is among them.

    Raises:
        InputError: a flight height lies above the ceiling.
    """
    for leaf in mission.leaves():
        height = next((port for port in leaf.ports if port.name == _HEIGHT_PORT), None)
        if FLIGHT_HEIGHT not in leaf.writes or height is None:
            continue
        height_m = leaf.initial_value(height)
        if height_m is not None and height_m > limits.ceiling_m:
            raise InputError(
                f"node '{leaf.path}' is to fly at {height_m:g} m, above the ceiling of "
                f"{limits.ceiling_m:g} m: lower the flight height or raise the limit ceiling_m"
            )
