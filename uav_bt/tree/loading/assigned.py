"""Which variables surely have a value where a node reads them.

The analysis follows the first tick through a tree. A child of a Sequence runs after those before it
have succeeded, a child of a Fallback after those before it have failed. What a script, a loop or a
leaf's output has written by then has a value; the rest may have none.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from uav_bt.tree.leaf import Leaf
from uav_bt.tree.loading.after_children import (
    ROUNDS,
    After,
    Known,
    Out,
    Variable,
    after_children,
    both,
)
from uav_bt.tree.mission_tree import MissionTree
from uav_bt.tree.node import Node
from uav_bt.tree.nodes import SetBlackboard, UnsetBlackboard
from uav_bt.tree.nodes.base import DecoratorNode
from uav_bt.tree.port import Port
from uav_bt.tree.script import SCRIPTS, Script, parse_script, parsed_by
from uav_bt.tree.script.expressions import Assignment, Expression, Name, certain_parts
from uav_bt.tree.status import FAILURE, SKIPPED, SUCCESS


@dataclass(frozen=True)
class EarlyRead:
    """A read of a variable that other nodes set, perhaps later."""

    node: Node
    attribute: str
    name: str


def early_reads(tree: MissionTree, given: Iterable[str] = ()) -> Iterator[EarlyRead]:
    """Yield the reads of variables that may have no value yet.

    Variables of the main tree that no node writes are left out: `MissionTree.unset` has them.

    Args:
        tree: loaded from a file.
        given: variables of the tree that have a value before the first tick, besides those that
            `tree.variables` holds.
    """
    flow = _Flow(tree)
    first = {tree.variables.location(name) for name in (*given, *tree.variables)}
    flow.follow(tree.root, frozenset(first))
    seen: set[tuple[str, Variable]] = set()
    for node, attribute, variable in flow.early:
        ours = variable in flow.written or variable[0] is not tree.variables
        if ours and (node.path, variable) not in seen:
            seen.add((node.path, variable))
            yield EarlyRead(node, attribute, variable[1])


def named_scripts(node: Node) -> Iterator[tuple[str, Script]]:
    """Yield the scripts of a node by attribute: its conditions, and its ports."""
    for attribute, source in node.condition_scripts.items():
        yield attribute, parse_script(source)
    for port in node.ports:
        text = node.literals.get(port.name)
        if port.check in SCRIPTS and isinstance(text, str):
            yield port.name, parsed_by(port.check, text)


def variable_at(node: Node, name: str) -> Variable | None:
    """Return the variable that a name in a node's script is; None for a board key or a constant."""
    variables = node.variables
    if name.startswith("@") or name in variables.enum_members:
        return None
    return None if variables.board_key(name) is not None else variables.location(name)


class _Flow:
    def __init__(self, tree: MissionTree) -> None:
        self.early: list[tuple[Node, str, Variable]] = []
        self.written: set[Variable] = set()
        self._unset: dict[Node, Known] = {}
        for node in reversed(list(tree.nodes())):  # children first
            below = frozenset[Variable]().union(*(self._unset[one] for one in node.children))
            self._unset[node] = below | self._removed(node)
            self.written |= self.outputs(node)
            for _, script in named_scripts(node):
                for part in script.walk():
                    if isinstance(part, Assignment):
                        self.written |= self._variable(node, part.name)

    # --- one node ---------------------------------------------------------------------------------

    def follow(self, node: Node, known: Known) -> After:
        """Return the variables with a value after a node; note its early reads.

        Args:
            node: is about to be ticked.
            known: the variables with a value.
        """
        if isinstance(node.parent, DecoratorNode):
            known |= self.outputs(node.parent)  # the element of a loop
        if node.node_id in ROUNDS:
            known -= self._unset[node]  # a later round may find them removed
        scripts = node.condition_scripts
        answered: dict[str, Known] = {}
        for name in ("_failureIf", "_successIf", "_skipIf", "_while"):
            if name in scripts:
                answered[name] = known = self._run(node, name, parse_script(scripts[name]), known)
        if "_onHalted" in scripts:
            self._run(node, "_onHalted", parse_script(scripts["_onHalted"]), known)
        after = self._work(node, known)
        failure = both(after.failure, answered.get("_failureIf"))
        if self._reads_board(node):
            failure = both(failure, known)
        success = both(after.success, answered.get("_successIf"))
        return After(
            self._end(node, success, "_onSuccess"),
            self._end(node, failure, "_onFailure"),
            both(both(after.skipped, answered.get("_skipIf")), answered.get("_while")),
        )

    def _end(self, node: Node, known: Out, attribute: str) -> Out:
        """Return the variables with a value after the scripts of an end."""
        scripts = node.condition_scripts
        for name in (attribute, "_post"):
            if name in scripts and known is not None:
                known = self._run(node, name, parse_script(scripts[name]), known)
        return known

    def _work(self, node: Node, known: Known) -> After:
        for port in node.ports:
            text = node.literals.get(port.name)
            if port.check in SCRIPTS and isinstance(text, str):
                known = self._run(node, port.name, parsed_by(port.check, text), known)
            else:
                self._read_port(node, port, known)
        if isinstance(node, Leaf):
            success = (known | self.outputs(node)) - self._removed(node)
            answers = node.answers
            return After(
                success if SUCCESS in answers else None,
                known if FAILURE in answers else None,
                known if SKIPPED in answers else None,
            )
        return after_children(self.follow, node, known)

    def _read_port(self, node: Node, port: Port[Any], known: Known) -> None:
        at = node.reference(port)
        asks = port.type is not object or port is SetBlackboard.VALUE
        if at is None or at.on_board or port.direction == "output" or not asks:
            return
        self._need(node, port.name, node.variables.location(at.key), known)

    def _run(self, node: Node, attribute: str, script: Script, known: Known) -> Known:
        """Note a script's early reads; return the variables with a value after it."""
        for statement in script.statements:
            parts = list(certain_parts(statement))
            for name in _reads(statement, parts):
                variable = variable_at(node, name)
                if variable is not None and name not in script.asked_known:
                    self._need(node, attribute, variable, known)
            for part in parts:
                if isinstance(part, Assignment):
                    known |= self._variable(node, part.name)
        return known

    def _need(self, node: Node, attribute: str, variable: Variable, known: Known) -> None:
        scope, name = variable
        if variable not in known and scope.entry(name) is None:
            self.early.append((node, attribute, variable))

    def _variable(self, node: Node, name: str) -> Known:
        variable = variable_at(node, name)
        return frozenset() if variable is None else frozenset((variable,))

    def outputs(self, node: Node) -> Known:
        """Return the variables that a node writes when it succeeds."""
        found: set[Variable] = set()
        for port in node.ports:
            at = node.reference(port)
            if port.direction != "input" and at is not None and not at.on_board:
                found.add(node.variables.location(at.key))
        name = node.literals.get(SetBlackboard.OUTPUT_KEY.name)
        if isinstance(node, SetBlackboard) and isinstance(name, str):
            found |= self._variable(node, name)
        return frozenset(found)

    def _removed(self, node: Node) -> Known:
        name = node.literals.get(UnsetBlackboard.KEY.name)
        unsets = isinstance(node, UnsetBlackboard) and isinstance(name, str)
        return self._variable(node, str(name)) if unsets else frozenset()

    def _reads_board(self, node: Node) -> bool:
        """Return whether a node may fail because a board key is unknown."""
        ports = (node.reference(port) for port in node.ports if port.direction != "output")
        if any(at is not None and at.on_board for at in ports):
            return True
        parts = (part for _, script in named_scripts(node) for part in script.walk())
        names = (part.name for part in parts if isinstance(part, Name))
        return any(name.startswith("@") or node.variables.board_key(name) for name in names)


def _reads(statement: Expression, parts: list[Expression]) -> Iterator[str]:
    yield from (part.name for part in parts if isinstance(part, Name))
    if isinstance(statement, Assignment) and statement.sign != ":=":
        yield statement.name
