"""Names of trees, variables and board keys in a document, for definitions and renaming."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum
from functools import lru_cache
from typing import Final

from uav_bt.lsp.page import Page, node_id_of, tree_of
from uav_bt.tree.conditions import CONDITION_ATTRIBUTES
from uav_bt.tree.editing.markup import Attribute, Branch, resolve
from uav_bt.tree.expanded import ExpandedNode
from uav_bt.tree.loading.elements import EDITOR_ATTRIBUTES
from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.nodes import SetBlackboard, UnsetBlackboard
from uav_bt.tree.registry import NodeRegistry
from uav_bt.tree.script import SCRIPTS, ScriptError, parse_script, parse_text
from uav_bt.tree.script.expressions import Assignment
from uav_bt.tree.script.parser import tokenize
from uav_bt.tree.script.text import names_in_text

SUBTREE: Final = NodeKind.SUBTREE.value
_FIXED: Final = frozenset({"ID", "name", "_autoremap", *EDITOR_ATTRIBUTES})
_REFERENCE: Final = re.compile(r"\s*\{\s*(@?)([A-Za-z_][A-Za-z0-9_.\-]*|=)\s*\}\s*")
# Ports whose text is a variable's name, without braces.
_NAMING: Final = {
    SetBlackboard.node_id: SetBlackboard.OUTPUT_KEY.name,
    UnsetBlackboard.node_id: UnsetBlackboard.KEY.name,
}

# Names in a script: name, offset, whether on the board, whether written there.
_Names = tuple[tuple[str, int, bool, bool], ...]


class What(Enum):
    """Kinds of things that have names."""

    TREE = "tree"
    VARIABLE = "variable"
    KEY = "board key"


@dataclass(frozen=True, slots=True)
class Use:
    """One place where something is named."""

    what: What
    name: str
    tree: str  # the tree whose variable it is, or that stands around; empty for none
    start: int  # of the name in the text
    end: int
    branch: Branch
    attribute: str
    defines: bool = False  # the ID of a BehaviorTree, or a variable that is written here
    entry: bool = False  # the name of a SubTree's entry, which is a variable of the tree inside
    same: bool = False  # written as `{=}`


class _Text:
    """An attribute's text, and the offset of each of its characters in the document."""

    def __init__(self, found: Attribute) -> None:
        self.attribute = found.name
        self.text, self._start = found.value, found.value_start
        self._places: list[int] | None = None  # None: as they follow each other
        if "&" in found.value:
            self.text, self._places = resolve(found.value)

    def place(self, start: int, end: int) -> tuple[int, int]:
        """Return the offsets of a part of the text in the document."""
        places = self._places
        if places is None:
            return self._start + start, self._start + end
        return self._start + places[start], self._start + places[end]


def node_of(branch: Branch, registry: NodeRegistry) -> type[Node] | None:
    """Return the class of a node, None for an unknown one."""
    if branch.tag.name == SUBTREE:
        node = registry.get(branch.text("ID"))
        if node is not None and issubclass(node, ExpandedNode):
            return node
    return registry.get(node_id_of(branch))


def uses_of(page: Page, registry: NodeRegistry) -> list[Use]:
    """Return all names of a document, in the order of its elements."""
    return [use for branch in page.walk() for use in _of_branch(branch, registry)]


def _of_branch(branch: Branch, registry: NodeRegistry) -> Iterator[Use]:
    tag, parent = branch.tag.name, branch.parent
    if tag == "BehaviorTree":
        yield from _tree(branch, "ID", defines=True)
    elif tag == "root":
        yield from _tree(branch, "main_tree_to_execute")
    elif parent is not None and parent.tag.name == "TreeNodesModel":
        yield from _tree(branch, "ID") if tag == SUBTREE else ()
    elif parent is not None and parent.tag.name == SUBTREE:
        name = branch.attribute("name")  # a port of a described subtree
        if name is not None:
            yield _entry(branch, name, parent.text("ID"), name.value_start, name.value_end)
    elif (around := tree_of(branch)) is not None:
        yield from _of_node(branch, around.text("ID"), registry)


def _tree(branch: Branch, attribute: str, *, defines: bool = False) -> Iterator[Use]:
    found = branch.attribute(attribute)
    if found is not None:
        name = resolve(found.value)[0]
        place = (found.value_start, found.value_end)
        yield Use(What.TREE, name, name, *place, branch, attribute, defines=defines)


def _entry(branch: Branch, found: Attribute, tree: str, start: int, end: int) -> Use:
    name = found.name if start == found.start else resolve(found.value)[0]
    return Use(What.VARIABLE, name, tree, start, end, branch, found.name, entry=True)


def _of_node(branch: Branch, tree: str, registry: NodeRegistry) -> Iterator[Use]:
    node = node_of(branch, registry)
    is_subtree = branch.tag.name == SUBTREE
    if is_subtree:
        yield from _tree(branch, "ID")
        # The ports of a node that is made of a tree are those of its class.
        is_subtree = node is None or not issubclass(node, ExpandedNode)
    for found in branch.tag.attributes:
        if found.name in _FIXED:
            continue
        text = _Text(found)
        if found.name in CONDITION_ATTRIBUTES or is_script(node, found.name):
            if _REFERENCE.fullmatch(text.text) is None:
                names = _in_placeholders if is_text(node, found.name) else _names_in
                yield from _script(branch, text, tree, names(text.text))
                continue
        elif is_subtree:
            end = found.start + len(found.name)
            yield _entry(branch, found, branch.text("ID"), found.start, end)
        yield from _value(branch, node, text, tree)


def is_script(node: type[Node] | None, attribute: str) -> bool:
    """Return whether a port of a node takes a script."""
    ports = () if node is None else node.ports
    return any(port.name == attribute and port.check in SCRIPTS for port in ports)


def is_text(node: type[Node] | None, attribute: str) -> bool:
    """Return whether a port of a node takes a text with placeholders."""
    ports = () if node is None else node.ports
    return any(port.name == attribute and port.check is parse_text for port in ports)


def _value(branch: Branch, node: type[Node] | None, value: _Text, tree: str) -> Iterator[Use]:
    attribute, text = value.attribute, value.text
    ports = () if node is None else node.ports
    port = next((one for one in ports if one.name == attribute), None)
    match = _REFERENCE.fullmatch(text)
    if match is None:
        if node is not None and _NAMING.get(node.node_id) == attribute and text:
            place = value.place(0, len(text))
            yield Use(What.VARIABLE, text, tree, *place, branch, attribute, defines=True)
        return
    same = match[2] == "="
    name = attribute if same else match[2]
    what = What.KEY if match[1] else What.VARIABLE
    written = port is not None and port.direction != "input"
    place = value.place(*match.span(2))
    yield Use(what, name, tree, *place, branch, attribute, defines=written, same=same)


def _script(branch: Branch, value: _Text, tree: str, names: _Names) -> Iterator[Use]:
    for name, start, on_board, written in names:
        what = What.KEY if on_board else What.VARIABLE
        place = value.place(start, start + len(name))
        yield Use(what, name, tree, *place, branch, value.attribute, defines=written)


def _in_placeholders(text: str) -> _Names:
    """Return the names in a text's placeholders, as `_names_in` does."""
    return tuple(
        (name.removeprefix("@"), start + name.startswith("@"), name.startswith("@"), False)
        for name, start in names_in_text(text)
    )


@lru_cache(maxsize=4096)  # of the scripts of a document, a keystroke changes one
def _names_in(text: str) -> _Names:
    """Return the names of a script: name, offset, whether on the board, whether written here."""
    try:
        tokens = tokenize(text)
    except ScriptError:
        return ()
    written = _assigned(text)
    found = []
    for token in tokens:
        if token.kind == "name" and token.text not in {"true", "false"}:
            on_board = token.text.startswith("@")
            name = token.text.removeprefix("@")
            defines = not on_board and name in written
            found.append((name, token.column - 1 + on_board, on_board, defines))
    return tuple(found)


def _assigned(text: str) -> frozenset[str]:
    try:
        parts = parse_script(text).walk()
        return frozenset(part.name for part in parts if isinstance(part, Assignment))
    except ScriptError:
        return frozenset()
