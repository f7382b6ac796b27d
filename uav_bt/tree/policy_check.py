"""What can be said against a mission file before anything flies."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from uav_bt import plugins
from uav_bt.errors import FileError, InputError, TreeError, UnknownNameError
from uav_bt.tree import MissionTree, NodeRegistry, load_tree
from uav_bt.tree.loading.findings import WHOLE_FILE, Finding, Position
from uav_bt.tree.loading.palette import PaletteLeaf
from uav_bt.tree.loading.source import Element, parse_source

__all__ = ["POLICY_PORT", "check_file", "findings_of", "tree_findings", "unknown_policies"]

POLICY_PORT = "policy"
"""By this name a leaf declares the port that names its leaf policy."""


def check_file(path: Path, registry: NodeRegistry | None = None) -> tuple[Finding, ...]:
    """Return all that is wrong with a tree file; nothing for a good one.

    Args:
        path: the file.
        registry: the nodes that may occur; default: all installed.
    """
    try:
        mission = load_tree(path, registry)
    except InputError as error:
        return findings_of(error, path)
    return unknown_policies(mission, path)


def tree_findings(path: Path, registry: NodeRegistry | None = None) -> tuple[str, ...]:
    """Return all that is wrong with a tree file, a line each; nothing for a good one.

    Args:
        path: the file.
        registry: the nodes that may occur; default: all installed.
    """
    return tuple(str(finding) for finding in check_file(path, registry))


def findings_of(error: InputError, path: Path) -> tuple[Finding, ...]:
    """Return what an error says as findings.

    Args:
        error: what was raised when a tree file was to be loaded.
        path: the file.
    """
    if isinstance(error, FileError) and not isinstance(error, TreeError):
        position = WHOLE_FILE if error.line is None else Position(error.line, 1)
        where = error.path if error.line is None else f"{error.path}:{error.line}"
        message = str(error).removeprefix(f"{where}: ")
        return (Finding(str(error.path), position, message),)
    details = error.details if isinstance(error, TreeError) else (error,)
    return tuple(
        detail if isinstance(detail, Finding) else Finding(str(path), WHOLE_FILE, str(detail))
        for detail in details
    )


def unknown_policies(mission: MissionTree, path: Path) -> tuple[Finding, ...]:
    """Return a finding for each leaf that names a policy which nobody registered.

    Args:
        mission: the loaded file; a policy that a variable names is only known in flight, and a leaf
            that is known from a palette only has policies of its own.
        path: what the findings call the file.

    Raises:
        InputError: two packages registered one policy.
    """
    known = plugins.names(plugins.POLICIES)
    places = {
        element.attributes[POLICY_PORT]: element.at(POLICY_PORT)
        for element in reversed(list(_elements(parse_source(mission.text.encode(), path))))
        if POLICY_PORT in element.attributes
    }
    findings: dict[Finding, None] = {}
    for leaf in mission.leaves():
        port = next((port for port in leaf.ports if port.name == POLICY_PORT), None)
        if port is None or leaf.reference(port) is not None or isinstance(leaf, PaletteLeaf):
            continue
        name = str(leaf.port_value(POLICY_PORT))
        registered = name.partition(":")[0]  # what follows is the policy's own business
        if registered not in known:
            message = str(UnknownNameError("policy", registered, known))
            place = places.get(name, Position(1, 1))
            findings[Finding(str(path), place, message, leaf.path)] = None
    return tuple(sorted(findings))


def _elements(root: Element) -> Iterator[Element]:
    yield root
    for child in root.children:
        yield from _elements(child)
