"""Checks every tree of a file, node by node, before anything is built."""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Any, Final

from uav_bt.errors import did_you_mean
from uav_bt.tree.conditions import ASKED, CONDITION_ATTRIBUTES, check_condition
from uav_bt.tree.loading.document import Document, autoremaps
from uav_bt.tree.loading.elements import doors, node_attributes, node_id_of
from uav_bt.tree.loading.findings import Findings, Rule
from uav_bt.tree.loading.source import Element, circles, walk
from uav_bt.tree.loading.structure import check_structure
from uav_bt.tree.loading.unit_doubts import unit_doubt
from uav_bt.tree.loading.variable_checker import check_variables, key_fits
from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.nodes import SubTree
from uav_bt.tree.port import Port, Reference, bind_ports, parse_reference
from uav_bt.tree.script import SCRIPTS, Script, parse_question, parse_script, parsed_by
from uav_bt.tree.script.expressions import Known, Name
from uav_bt.tree.script.values import ONLY_LEAVES_WRITE

_VARIABLE: Final = re.compile(r"[A-Za-z_][A-Za-z0-9_.\-]*")


class Checker:
    """Adds a finding for each fault in the trees of a document.

    Args:
        document: the file's outline.
        findings: collects the findings.
    """

    def __init__(self, document: Document, findings: Findings) -> None:
        self._document = document
        self._registry = document.registry
        self._findings = findings
        self._board_keys = document.registry.board_keys

    def check(self, roots: Iterable[str]) -> None:
        """Check all trees.

        Of a tree that nothing uses only the structure must be right, as the engine has it: the rest
        is noted as a warning.

        Args:
            roots: the trees that may be flown.
        """
        document = self._document
        roots = list(roots)
        for tree in document.trees.values():
            check_structure(tree, document, self._findings)
        flown = document.within(roots)
        self._check_trees(tree for tree_id, tree in document.trees.items() if tree_id in flown)
        check_variables(document, self._findings, roots)
        self._check_recursion()
        idle = Findings()
        Checker(document, idle)._check_trees(  # noqa: SLF001  # of the same class
            tree for tree_id, tree in document.trees.items() if tree_id not in flown
        )
        unused = [tree_id for tree_id in document.unused if tree_id not in flown]
        check_variables(document, idle, unused)
        self._findings.take_as_warnings(idle)

    def _check_trees(self, trees: Iterable[Element]) -> None:
        for tree in trees:
            for element in walk(tree):
                self.check_element(element)

    def _note(
        self, element: Element, message: str, attribute: str = "", rule: Rule = Rule.ATTRIBUTE
    ) -> None:
        self._findings.note(element, message, attribute, rule=rule)

    def check_element(self, element: Element) -> None:
        """Check the attributes of one node, which is known and has its place."""
        if element.tag == NodeKind.SUBTREE.value:
            self._check_subtree(element)
        elif node_id_of(element) in self._registry:
            self._check_ports(element, self._registry[node_id_of(element)])

    # --- ports ------------------------------------------------------------------------------------

    def _check_ports(self, element: Element, node: type[Node]) -> None:
        given: dict[str, object] = {}
        for name, text in node_attributes(element).items():
            if name in CONDITION_ATTRIBUTES:
                self._check_condition(element, name, text)
            else:
                given[name] = text
        ports = node.ports_over(len(element.children))
        bound, wrong = bind_ports(ports, given, CONDITION_ATTRIBUTES)
        scripts = {port.name for port in node.ports if port.check in SCRIPTS}
        for name, message in wrong.items():
            self._note(element, message, name, Rule.SCRIPT if name in scripts else Rule.ATTRIBUTE)
        for port in node.ports:
            value = bound.get(port.name)
            if isinstance(value, Reference) and value.on_board:
                self._check_board_reference(element, port, value)
            elif port.check in SCRIPTS and isinstance(value, str):
                script = parsed_by(port.check, value)
                self._check_script(element, port.name, script, asked=port.check is parse_question)
            doubt = unit_doubt(port, value) if port.name in given else None
            if doubt is not None:
                message = f"attribute '{port.name}': {doubt}"
                self._findings.warn(element, message, port.name, rule=Rule.UNIT)

    def _check_condition(self, element: Element, name: str, text: str) -> None:
        message = check_condition(text)
        if message is not None:
            self._note(element, f"attribute '{name}': {message}", name, Rule.SCRIPT)
        else:
            self._check_script(element, name, parse_script(text), asked=name in ASKED)

    def _check_script(
        self, element: Element, attribute: str, script: Script, *, asked: bool
    ) -> None:
        fault = script.fault(self._document.enum_members, asked=asked)
        if fault is not None:
            message = f"attribute '{attribute}': the script always fails: {fault}"
            self._note(element, message, attribute, Rule.SCRIPT)
        for odd in script.oddities:
            message = f"attribute '{attribute}': {odd}"
            self._findings.warn(element, message, attribute, rule=Rule.SCRIPT)
        for name in script.board_writes:
            if name in self._board_keys or not self._registry.foreign_board:
                message = f"attribute '{attribute}': '@{name}' is a board key; {ONLY_LEAVES_WRITE}"
                self._note(element, message, attribute, Rule.BOARD_KEY)
        for part in script.walk():
            if not isinstance(part, (Name, Known)) or not part.name.startswith("@"):
                continue
            key = self._board_keys.get(part.name[1:])
            if key is None and self._registry.foreign_board:
                continue
            if key is None:
                message = self._no_key(part.name[1:])
            elif isinstance(part, Name) and not issubclass(key.type, (int, float, str)):
                message = f"board key '{key.name}' holds {key.type.__name__}, no number and no text"
            else:
                continue
            whole = f"attribute '{attribute}': {message}"
            self._note(element, whole, attribute, Rule.BOARD_KEY)

    def _check_board_reference(self, element: Element, port: Port[Any], at: Reference) -> None:
        key = self._board_keys.get(at.key)
        if key is None and self._registry.foreign_board:
            return
        if key is None:
            message = f"attribute '{port.name}': {self._no_key(at.key)}"
            self._note(element, message, port.name, Rule.BOARD_KEY)
        elif not key_fits(port, key):
            self._note(
                element,
                f"attribute '{port.name}' takes {port.words}, "
                f"but board key '{at.key}' holds {key.type.__name__}",
                port.name,
                Rule.BOARD_KEY,
            )

    def _no_key(self, key: str) -> str:
        return f"the board has no key '{key}'{did_you_mean(key, self._board_keys)}"

    # --- subtrees ---------------------------------------------------------------------------------

    def _check_subtree(self, element: Element) -> None:
        trees = self._document.trees
        tree_id = element.attributes.get("ID", "")
        if tree_id and tree_id not in trees and tree_id not in self._registry:
            hint = self._hint(tree_id) or "; --trees DIR adds the trees of a folder"
            message = f"there is no tree '{tree_id}'{hint}"
            self._note(element, message, "ID", Rule.UNKNOWN_TREE)
        if "_autoremap" in element.attributes:
            try:
                SubTree.AUTOREMAP.convert(element.attributes["_autoremap"])
            except ValueError as error:
                self._note(element, f"attribute '_autoremap': {error}", "_autoremap")
        for name, text in node_attributes(element).items():
            self._check_entry(element, name, text)
        described = self._document.subtree_ports.get(tree_id)
        if described is not None and not autoremaps(element):
            self._check_missing_entries(element, described)

    def _hint(self, tree_id: str) -> str:
        known = [*self._document.trees, *self._document.elsewhere]
        return f"{did_you_mean(tree_id, known)}{self._document.unread}"

    def _check_missing_entries(self, element: Element, described: dict[str, str | None]) -> None:
        for name, default in described.items():
            if default is None and name not in element.attributes:
                self._note(
                    element,
                    f"entry '{name}' is missing: the tree is described with it, without a default",
                )

    def _check_entry(self, element: Element, name: str, text: str) -> None:
        if name in CONDITION_ATTRIBUTES:
            self._check_condition(element, name, text)
            return
        if not _VARIABLE.fullmatch(name):
            self._note(element, f"'{name}' cannot be a variable's name", name)
        try:
            reference = parse_reference(text, name)
        except ValueError as error:
            self._note(element, f"attribute '{name}': {error}", name)
            return
        unknown = reference is not None and reference.key not in self._board_keys
        if reference and reference.on_board and unknown and not self._registry.foreign_board:
            message = f"attribute '{name}': {self._no_key(reference.key)}"
            self._note(element, message, name, Rule.BOARD_KEY)

    def _check_recursion(self) -> None:
        trees = self._document.trees

        def used(tree_id: str) -> list[tuple[Element, str]]:
            return [(node, inner) for node, inner in doors(trees[tree_id]) if inner in trees]

        for node, loop in circles(trees, used):
            message = f"the tree contains itself: {' > '.join(loop)}"
            self._note(node, message, "ID", rule=Rule.UNKNOWN_TREE)
