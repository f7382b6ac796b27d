"""Faults of a whole tree that would end its flight: keys without a writer, two movers, rules."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from uav_bt.board import FLIGHT_HEIGHT, MISSION_KEYS, ODOMETRY
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.loading.builder import POLICY_PORT
from uav_bt.tree.loading.findings import Finding, Position, Rule
from uav_bt.tree.mission_tree import MissionTree
from uav_bt.tree.node import Node
from uav_bt.tree.nodes import Parallel, ParallelAll
from uav_bt.tree.nodes.base import ControlNode, DecoratorNode
from uav_bt.tree.rules import Rules
from uav_bt.tree.script import SCRIPTS, parse_script
from uav_bt.tree.script.expressions import Name
from uav_bt.types.mission_rules import LandOn

# Decorators whose first tick may not reach the child.
_LATER: Final = frozenset(
    {"Delay", "LoopBool", "LoopDouble", "LoopInt", "LoopString", "Precondition"}
    | {"SkipUnlessUpdated", "WaitValueUpdate"}
)
_RUNNER: Final = "runner"  # the writer of the keys that every mission has


def faults_of(tree: MissionTree) -> Iterator[Finding]:
    """Yield the faults of a tree that is flown as it is, without values from Python.

    Args:
        tree: loaded from a file.
    """
    yield from _unwritten_keys(tree)
    yield from _two_movers(tree)
    yield from _late_policies(tree)
    yield from _rules(tree)


def _finding(tree: MissionTree, node: Node, message: str, rule: Rule) -> Finding:
    place = tree.places.get(node.path)
    path, position = (tree.path, Position(1, 1)) if place is None else (place.path, place.position)
    return Finding(str(path), position, message, node.path, rule=rule)


# --- board keys -----------------------------------------------------------------------------------


def _unwritten_keys(tree: MissionTree) -> Iterator[Finding]:
    """Yield scripts that read keys which neither the runner nor a leaf of the tree writes."""
    written = {key.name for key in MISSION_KEYS if key.writer == _RUNNER}
    writers = {key.name: key.writer for key in MISSION_KEYS}
    for leaf in tree.leaves():
        written |= {key.name for key in leaf.writes}
        outputs = (leaf.reference(port) for port in leaf.ports if port.direction != "input")
        written |= {at.key for at in outputs if at is not None and at.on_board}
    for node in tree.nodes():
        for attribute, text in _scripts(node):
            for key in sorted(_board_reads(node, text) - written):
                writer = f": {writers[key]} writes it" if writers.get(key) else ""
                message = (
                    f"attribute '{attribute}': no leaf of the tree writes board key '{key}'{writer}"
                )
                yield _finding(tree, node, message, Rule.BOARD_KEY)


def _scripts(node: Node) -> Iterator[tuple[str, str]]:
    yield from node.condition_scripts.items()
    for port in node.ports:
        text = node.literals.get(port.name)
        if port.check in SCRIPTS and isinstance(text, str):
            yield port.name, text


def _board_reads(node: Node, text: str) -> set[str]:
    """Return the board keys that every run of a script reads, also by a variable's name."""
    script = parse_script(text)
    names = {
        part.name for part in script.walk() if isinstance(part, Name) and id(part) in script.certain
    }
    at = {name[1:] if name.startswith("@") else node.variables.board_key(name) for name in names}
    return {key for key in at if key is not None}


# --- policies -------------------------------------------------------------------------------------


def _late_policies(tree: MissionTree) -> Iterator[Finding]:
    """Yield leaves whose policy is named by a variable that has no value before the take-off."""
    for leaf in tree.leaves():
        for port in leaf.ports:
            at = leaf.reference(port)
            if port.name == POLICY_PORT and at is not None and leaf.initial_value(port) is None:
                message = (
                    f"attribute '{port.name}': the policy is made before the take-off, when {at} "
                    "has no value: write the policy's name here, or in an entry of the SubTree"
                )
                yield _finding(tree, leaf, message, Rule.ATTRIBUTE)


# --- rules ----------------------------------------------------------------------------------------


def _rules(tree: MissionTree) -> Iterator[Finding]:
    """Yield rules that cannot be read before the take-off, or that the tree cannot keep."""
    found = [leaf for leaf in tree.leaves() if isinstance(leaf, Rules)]
    for leaf in found[1:]:
        message = f"the mission has its rules already, in '{found[0].path}': put all in one node"
        yield _finding(tree, leaf, message, Rule.CHILDREN)
    for leaf in found[:1]:
        late = [port.name for port in leaf.ports if leaf.initial_value(port) is None]
        for name in late:
            message = (
                f"attribute '{name}': the rules are read before the take-off, when the reference "
                "has no value: write the value here, or in an entry of the SubTree"
            )
            yield _finding(tree, leaf, message, Rule.ATTRIBUTE)
        if not late:
            yield from _unkept(tree, leaf)


def _unkept(tree: MissionTree, leaf: Rules) -> Iterator[Finding]:
    rules = leaf.stated()
    written = {key: each for each in tree.leaves() for key in each.writes}
    if rules.land_on is LandOn.NONE and FLIGHT_HEIGHT in written:
        message = (
            f"attribute 'land_on': 'none' says that the mission never takes off, but "
            f"'{written[FLIGHT_HEIGHT].name}' does: write where it may land, or leave that node out"
        )
        yield _finding(tree, leaf, message, Rule.ATTRIBUTE)
    if rules.area is not None and ODOMETRY not in written:
        message = (
            f"attribute 'area': the drone keeps within it by board key '{ODOMETRY.name}', which no "
            f"leaf of the tree writes: add {ODOMETRY.writer}"
        )
        yield _finding(tree, leaf, message, Rule.BOARD_KEY)


# --- movements ------------------------------------------------------------------------------------


def _two_movers(tree: MissionTree) -> Iterator[Finding]:
    """Yield Parallels of which two children begin with leaves that ask for the same thing."""
    for node in tree.nodes():
        if not isinstance(node, Parallel | ParallelAll):
            continue
        begun = [_first_leaf(child) for child in node.children]
        for what, asks in (
            ("a movement", [leaf for leaf in begun if leaf is not None and leaf.moves]),
            ("a camera direction", [leaf for leaf in begun if leaf is not None and leaf.points]),
        ):
            if len(asks) > 1:
                message = (
                    f"'{asks[0].name}' and '{asks[1].name}' ask for {what} in the same tick, and "
                    "only one leaf may: run them one after another"
                )
                yield _finding(tree, node, message, Rule.CHILDREN)


def _first_leaf(node: Node) -> Leaf | None:
    """Return the leaf that a node's first tick always reaches; None when it may reach none."""
    while not isinstance(node, Leaf):
        starts = isinstance(node, ControlNode) or (
            isinstance(node, DecoratorNode) and node.node_id not in _LATER
        )
        if node.condition_scripts or not starts:
            return None
        node = node.children[0]
    return None if node.condition_scripts else node
