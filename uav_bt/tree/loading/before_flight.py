"""Faults of a whole tree that would end its flight: values that are missing, two movers."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any, Final

from uav_bt.board import MISSION_KEYS, Key
from uav_bt.tree.leaf import Leaf
from uav_bt.tree.loading.assigned import early_reads, named_scripts
from uav_bt.tree.loading.builder import POLICY_PORT
from uav_bt.tree.loading.findings import Finding, Rule
from uav_bt.tree.loading.kept_rules import faults_of_rules
from uav_bt.tree.loading.kinds import misfits
from uav_bt.tree.loading.node_findings import finding_at
from uav_bt.tree.mission_tree import MissionTree
from uav_bt.tree.node import Node
from uav_bt.tree.nodes import (
    IfThenElse,
    LoopBool,
    LoopDouble,
    LoopInt,
    Parallel,
    ParallelAll,
    WhileDoElse,
)
from uav_bt.tree.port import Port
from uav_bt.tree.script.expressions import Name

_RUNNER: Final = "runner"  # the writer of the keys that every mission has


def faults_of(tree: MissionTree, given: Iterable[str] = ()) -> Iterator[Finding]:
    """Yield the faults of a tree that is flown as it is.

    Args:
        tree: loaded from a file.
        given: variables of the tree that get a value from outside before the flight.
    """
    yield from faults_of_part(tree)
    yield from _unwritten_keys(tree)
    yield from _late_values(tree)
    for early in early_reads(tree, given):
        message = (
            f"attribute '{early.attribute}': variable '{early.name}' may have no value here: what "
            "sets it may run later, or not at all; give it a value in a Script before"
        )
        yield finding_at(tree, early.node, message, Rule.VARIABLE)
    for odd in misfits(tree):
        message = f"attribute '{odd.attribute}' {odd.message}"
        yield finding_at(tree, odd.node, message, Rule.VARIABLE)


def faults_of_part(tree: MissionTree) -> Iterator[Finding]:
    """Yield the faults that a tree has in every mission that uses it.

    Args:
        tree: loaded from a file.
    """
    yield from _loops_over_words(tree)
    yield from _two_movers(tree)
    yield from _skipped_conditions(tree)
    yield from faults_of_rules(tree)


# --- board keys -----------------------------------------------------------------------------------


def _unwritten_keys(tree: MissionTree) -> Iterator[Finding]:
    """Yield reads of keys which neither the runner nor a leaf of the tree writes."""
    written = {key.name for key in MISSION_KEYS if key.writer == _RUNNER}
    keys: dict[str, Key[Any]] = {key.name: key for key in MISSION_KEYS}
    for leaf in tree.leaves():
        written |= {key.name for key in leaf.writes}
        keys |= {key.name: key for key in leaf.reads}
        outputs = (leaf.reference(port) for port in leaf.ports if port.direction != "input")
        written |= {at.key for at in outputs if at is not None and at.on_board}
    for node in tree.nodes():
        reads = [*_keys_of_ports(node), *_keys_of_scripts(node)]
        for attribute, key in reads:
            if key not in written:
                writer = f": {keys[key].writer} writes it" if key in keys else ""
                message = (
                    f"attribute '{attribute}': no leaf of the tree writes board key '{key}'{writer}"
                )
                yield finding_at(tree, node, message, Rule.BOARD_KEY)


def _keys_of_ports(node: Node) -> Iterator[tuple[str, str]]:
    """Yield port and board key of the input ports that the file connects to the board."""
    for port in node.ports:
        at = node.reference(port)
        if at is None or not at.on_board or port.direction == "output":
            continue
        if port.default is Port.REQUIRED or port.bound_default != at:
            yield port.name, at.key


def _keys_of_scripts(node: Node) -> Iterator[tuple[str, str]]:
    """Yield attribute and board key of the scripts that read one without asking `known(...)`."""
    for attribute, script in named_scripts(node):
        names = {part.name for part in script.walk() if isinstance(part, Name)}
        at = {
            name[1:] if name.startswith("@") else node.variables.board_key(name)
            for name in names - script.asked_known
        }
        yield from ((attribute, key) for key in sorted(key for key in at if key is not None))


def _loops_over_words(tree: MissionTree) -> Iterator[Finding]:
    """Yield loops over numbers or truth values whose queue is a board key that holds a text."""
    texts = {key.name for leaf in tree.leaves() for key in leaf.writes if key.type is str}
    for node in tree.nodes():
        if isinstance(node, LoopBool | LoopDouble | LoopInt):
            at = node.reference(node.QUEUE)
            if at is not None and at.on_board and at.key in texts:
                message = (
                    f"attribute 'queue': board key '{at.key}' holds a text, which may be no queue "
                    f"of {node.VALUE.type.__name__}: use LoopString"
                )
                yield finding_at(tree, node, message, Rule.BOARD_KEY)


# --- values that are needed before the take-off ---------------------------------------------------


def _late_values(tree: MissionTree) -> Iterator[Finding]:
    """Yield ports that are read before the take-off, when their variable has no value."""
    for leaf in tree.leaves():
        for port in leaf.ports:
            at = leaf.reference(port)
            if at is not None and _is_read_early(port) and leaf.initial_value(port) is None:
                message = (
                    f"attribute '{port.name}': its value is needed before the take-off, when {at} "
                    "has none: write the value here, or in an entry of the SubTree"
                )
                yield finding_at(tree, leaf, message, Rule.ATTRIBUTE)


def _is_read_early(port: Port[Any]) -> bool:
    return port.name == POLICY_PORT or port.at_setup


# --- nodes with children --------------------------------------------------------------------------


def _skipped_conditions(tree: MissionTree) -> Iterator[Finding]:
    """Yield conditions of `IfThenElse` and `WhileDoElse` that may be skipped."""
    for node in tree.nodes():
        if isinstance(node, IfThenElse | WhileDoElse):
            asked = node.children[0]
            for attribute in ("_skipIf", "_while"):
                if attribute in asked.condition_scripts:
                    message = (
                        f"attribute '{attribute}': the condition of {node.node_id} must not be "
                        "skipped: ask this in a ScriptCondition before"
                    )
                    yield finding_at(tree, asked, message, Rule.CHILDREN)


def _two_movers(tree: MissionTree) -> Iterator[Finding]:
    """Yield Parallels of which two children have leaves that may ask for the same thing."""
    for node in tree.nodes():
        if not isinstance(node, Parallel | ParallelAll):
            continue
        leaves = [list(_leaves_below(child)) for child in node.children]
        movers = [next((leaf for leaf in below if leaf.moves), None) for below in leaves]
        pointers = [next((leaf for leaf in below if leaf.may_point()), None) for below in leaves]
        for what, found in (("a movement", movers), ("a camera direction", pointers)):
            asks = [leaf for leaf in found if leaf is not None]
            if len(asks) > 1:
                message = (
                    f"'{asks[0].name}' and '{asks[1].name}' may ask for {what} in the same tick, "
                    "and only one leaf may: run them one after another"
                )
                yield finding_at(tree, node, message, Rule.CHILDREN)


def _leaves_below(node: Node) -> Iterator[Leaf]:
    """Yield the leaves of a branch, itself included; none of a branch that is deactivated."""
    if node.condition_scripts.get("_skipIf", "").strip() in {"true", "1"}:
        return
    if isinstance(node, Leaf):
        yield node
    for child in node.children:
        yield from _leaves_below(child)
