"""Which variables surely have a value where a node reads them.

The analysis follows the first tick through a tree. A child of a Sequence runs after those before it
have succeeded, a child of a Fallback after those before it have failed. What a script, a loop or a
leaf's output has written by then has a value; the rest may have none.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from uav_bt.tree.leaf import Leaf
from uav_bt.tree.loading.uses import Uses, variable_at
from uav_bt.tree.mission_tree import MissionTree
from uav_bt.tree.node import Node
from uav_bt.tree.nodes.base import DecoratorNode
from uav_bt.tree.port import Port
from uav_bt.tree.script.expressions import Assignment, Expression, Name, certain_parts
from uav_bt.tree.script.parser import Script, parse_script
from uav_bt.tree.variables import After, Known, Out, Variable, both


def early_reads(uses: Uses) -> Iterator[tuple[Node, str, str]]:
    """Yield the reads of variables that may have no value yet.

    Variables of the main tree that no node writes are left out: `Uses.unset` has them.
    """
    tree = uses.tree
    flow = _Flow(tree)
    first = {tree.variables.location(name) for name in tree.variables}
    flow.follow(tree.root, frozenset(first))
    seen: set[tuple[str, Variable]] = set()
    for node, attribute, variable in flow.early:
        ours = variable in flow.written or variable[0] is not tree.variables
        if ours and (node.path, variable) not in seen:
            seen.add((node.path, variable))
            yield node, attribute, variable[1]


class _Flow:
    def __init__(self, tree: MissionTree) -> None:
        self.early: list[tuple[Node, str, Variable]] = []
        self.written: set[Variable] = set()
        self._unset: dict[Node, Known] = {}
        for node in reversed(list(tree.nodes())):  # children first
            below = frozenset[Variable]().union(*(self._unset[one] for one in node.children))
            self._unset[node] = below | self._removed(node)
            self.written |= self.outputs(node)
            for _, script in node.scripts():
                for part in script.parts:
                    if isinstance(part, Assignment):
                        self.written |= self._variable(node, part.name)

    # --- one node ---------------------------------------------------------------------------------

    def follow(self, node: Node, known: Known) -> After:
        """Return the variables with a value after a node; note its early reads."""
        if isinstance(node.parent, DecoratorNode):
            known |= self.outputs(node.parent)  # the element of a loop
        if node.ticks_again:
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
            if (script := node.script_at(port)) is not None:
                known = self._run(node, port.name, script, known)
            else:
                self._read_port(node, port, known)
        after = node.variables_after(self.follow, known)
        if not isinstance(node, Leaf) or after.success is None:
            return after
        return after._replace(success=(known | self.outputs(node)) - self._removed(node))

    def _read_port(self, node: Node, port: Port[Any], known: Known) -> None:
        at = node.reference(port)
        if at is None or at.on_board or port.direction == "output" or not node.needs_value(port):
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
        names = (written.name for written in node.variables_written() if written.name is not None)
        return frozenset[Variable]().union(*(self._variable(node, name) for name in names))

    def _removed(self, node: Node) -> Known:
        return frozenset[Variable]().union(
            *(self._variable(node, one) for one in node.variables_removed())
        )

    def _reads_board(self, node: Node) -> bool:
        """Return whether a node may fail because a board key is unknown."""
        ports = (node.reference(port) for port in node.ports if port.direction != "output")
        if any(at is not None and at.on_board for at in ports):
            return True
        parts = (part for _, script in node.scripts() for part in script.parts)
        names = (part.name for part in parts if isinstance(part, Name))
        return any(name.startswith("@") or node.variables.board_key(name) for name in names)


def _reads(statement: Expression, parts: list[Expression]) -> Iterator[str]:
    yield from (part.name for part in parts if isinstance(part, Name))
    if isinstance(statement, Assignment) and statement.sign != ":=":
        yield statement.name
