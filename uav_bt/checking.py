"""What can be said against a mission file before anything flies."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from uav_bt import plugins
from uav_bt.errors import InputError, TreeError, UnknownNameError
from uav_bt.tree import MissionTree, NodeRegistry, load_tree
from uav_bt.tree.findings import Finding, Position
from uav_bt.tree.source import Element, parse_source

__all__ = ["POLICY_PORT", "tree_findings", "unknown_policies"]

POLICY_PORT = "policy"
"""By this name a leaf declares the port that names its leaf policy."""


def tree_findings(path: Path, registry: NodeRegistry | None = None) -> tuple[str, ...]:
    """Return all that is wrong with a tree file, a line each; empty for a good one.

    Args:
        path: the file.
        registry: the nodes that may occur; default: all installed.
    """
    try:
        mission = load_tree(path, registry)
    except TreeError as error:
        return error.findings
    except InputError as error:
        return (str(error),)
    return tuple(str(finding) for finding in unknown_policies(mission, path))


def unknown_policies(mission: MissionTree, path: Path) -> tuple[Finding, ...]:
    """Return a finding for each leaf that names a policy which nobody registered.

    Args:
        mission: the loaded file; a policy that a variable names is only known in flight.
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
        if port is None or leaf.reference(port) is not None:
            continue
        name = str(leaf.port_value(POLICY_PORT))
        if name not in known:
            message = str(UnknownNameError("policy", name, known))
            place = places.get(name, Position(1, 1))
            findings[Finding(str(path), place, message, leaf.path)] = None
    return tuple(sorted(findings))


def _elements(root: Element) -> Iterator[Element]:
    yield root
    for child in root.children:
        yield from _elements(child)
