"""Completion at the cursor: nodes, attributes, trees, variables, board keys, policies."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, Final

from lsprotocol import types

from uav_bt.lsp.desk import Desk
from uav_bt.lsp.explain import explain_key, explain_node, explain_port
from uav_bt.lsp.names import SUBTREE, What, is_script, is_text
from uav_bt.lsp.page import Page, attribute_at, tree_of
from uav_bt.tree.conditions import CONDITION_ATTRIBUTES
from uav_bt.tree.editing.markup import Branch, Kind, Piece
from uav_bt.tree.loading.builder import POLICY_PORT
from uav_bt.tree.loading.elements import KIND_TAGS
from uav_bt.tree.loading.models import PORT_DIRECTIONS
from uav_bt.tree.loading.variable_checker import key_fits
from uav_bt.tree.node import Node, NodeKind
from uav_bt.tree.port import Port, port_text

_Items = Iterator[types.CompletionItem]
_Part = tuple[int, int]  # of the text, which is replaced
_Kind = types.CompletionItemKind
_REFERENCE: Final = re.compile(r"^\s*\{\s*(@?)([\w.\-]*)$")
_WORD: Final = re.compile(r"(@?)([A-Za-z_]\w*)?$")
_ROOT_CHILDREN: Final = {
    "BehaviorTree": '<BehaviorTree ID="$1">\n  $0\n</BehaviorTree>',
    "TreeNodesModel": "<TreeNodesModel>\n  $0\n</TreeNodesModel>",
    "include": '<include path="$1"/>$0',
}
_BOOLEANS: Final = ("true", "false")


class Completer:
    """Completes at one place of a page.

    Args:
        desk: the known nodes, board keys and files.
        page: the document.
        offset: of the cursor.
        snippets: whether the client takes `$1` as a place for the cursor.
    """

    def __init__(self, desk: Desk, page: Page, offset: int, *, snippets: bool) -> None:
        self._desk = desk
        self._page = page
        self._at = offset
        self._snippets = snippets
        self._ranges: dict[_Part, types.Range] = {}

    def items(self) -> list[types.CompletionItem]:
        """Return all completions for this place."""
        page, at = self._page, self._at
        piece = page.piece_at(at)
        if piece is not None and piece.kind is Kind.TEXT:
            tag = page.before(piece)
            blank = not page.text[piece.start : at].strip()
            if tag is not None and not tag.whole and tag.name and blank:
                return list(self._attributes(tag, at, at))
        elif piece is not None and (at < piece.end or not piece.whole):
            return list(self._in_markup(piece))
        return list(self._elements(page.around(at), at, at))

    def _in_markup(self, piece: Piece) -> _Items:
        if piece.kind is Kind.END:
            yield from self._end(piece)
        elif piece.kind in {Kind.START, Kind.EMPTY}:
            yield from self._in_tag(piece)

    def _item(
        self,
        label: str,
        kind: types.CompletionItemKind,
        part: _Part,
        new: str,
        doc: str = "",
        **more: Any,
    ) -> types.CompletionItem:
        plain = re.sub(r"\$\d", "", new)
        if part not in self._ranges:  # all items of an answer replace one or two parts
            self._ranges[part] = self._page.range(*part)
        return types.CompletionItem(
            label=label,
            kind=kind,
            text_edit=types.TextEdit(self._ranges[part], new if self._snippets else plain),
            insert_text_format=types.InsertTextFormat.Snippet
            if self._snippets and plain != new
            else types.InsertTextFormat.PlainText,
            documentation=types.MarkupContent(types.MarkupKind.Markdown, doc) if doc else None,
            **more,
        )

    # --- elements ---------------------------------------------------------------------------------

    def _end(self, piece: Piece) -> _Items:
        around = self._page.around(piece.start)
        if around is not None:
            name = around.tag.name
            closed = "" if piece.whole else ">"
            start, end = piece.start + 2, piece.start + 2 + len(piece.name)
            yield self._item(name, _Kind.Class, (start, end), f"{name}{closed}")

    def _in_tag(self, piece: Piece) -> _Items:
        name_end = piece.start + 1 + len(piece.name)
        if self._at <= name_end:
            parent = self._page.around(piece.start)
            started = piece.whole or bool(piece.attributes)
            yield from self._elements(parent, piece.start, name_end, only_name=started)
            return
        found = attribute_at(piece, self._at)
        if piece.start not in self._page.by_tag:
            return  # a tag without a name
        if found is None or self._at == found.start or self._at == found.end > found.value_end:
            yield from self._attributes(piece, self._at, self._at)
        elif self._at <= found.start + len(found.name):
            end = found.start + len(found.name)
            yield from self._attributes(piece, found.start, end, only_name=end != found.end)
        elif self._at >= found.value_start:
            branch = self._page.by_tag[piece.start]
            yield from _Values(self, branch, found.name).items(found.value_start, found.value_end)

    def _elements(
        self, parent: Branch | None, start: int, end: int, *, only_name: bool = False
    ) -> _Items:
        """Yield the children that an element can have, as whole elements or names alone."""
        tag = "" if parent is None else parent.tag.name
        if parent is None:
            if not any(root.tag.name == "root" for root in self._page.roots):
                new = '<root BTCPP_format="4">\n  $0\n</root>'
                yield self._item("root", _Kind.Module, (start, end), new)
        elif tag == "root":
            for name, new in _ROOT_CHILDREN.items():
                yield self._item(name, _Kind.Module, (start, end), f"<{name}" if only_name else new)
        elif tag == "TreeNodesModel":
            for name in sorted(KIND_TAGS):
                new = f"<{name}" if only_name else f'<{name} ID="$1">\n  $0\n</{name}>'
                yield self._item(name, _Kind.Class, (start, end), new)
        elif parent.parent is not None and parent.parent.tag.name == "TreeNodesModel":
            for name in PORT_DIRECTIONS:
                new = f"<{name}" if only_name else f'<{name} name="$1"/>$0'
                yield self._item(name, _Kind.Field, (start, end), new)
        else:
            yield from self._nodes(start, end, only_name=only_name)

    def _nodes(self, start: int, end: int, *, only_name: bool) -> _Items:
        registry = self._desk.registry
        for node_id in registry:
            node = registry[node_id]
            new = f"<{node_id}" if only_name else _element(node_id, node)
            detail = node.kind.value
            doc = explain_node(node, registry)
            yield self._item(node_id, _Kind.Class, (start, end), new, doc, detail=detail)
        for tree_id, path in self._desk.trees(self._page).items():
            if tree_id in registry:
                continue  # the tree that a node is made of
            new = f"<{SUBTREE}" if only_name else f'<{SUBTREE} ID="{tree_id}"/>'
            detail = f"tree of {path.name}"
            label = f"{SUBTREE} {tree_id}"
            yield self._item(label, _Kind.Function, (start, end), new, detail=detail)

    # --- attributes -------------------------------------------------------------------------------

    def _attributes(self, tag: Piece, start: int, end: int, *, only_name: bool = False) -> _Items:
        given = {one.name for one in tag.attributes if not one.start < self._at <= one.end}
        branch = self._page.by_tag[tag.start]
        for name, doc, detail, rank in self._known_attributes(branch):
            if name not in given:
                new = name if only_name else f'{name}="$1"'
                more = {"detail": detail, "sort_text": f"{rank}{name}"}
                yield self._item(name, _Kind.Property, (start, end), new, doc, **more)

    def _known_attributes(self, branch: Branch) -> Iterator[tuple[str, str, str, int]]:
        """Yield name, documentation, a short remark, and the rank in the list."""
        tag = branch.tag.name
        if tag == "root":
            yield from (("BTCPP_format", "", "4", 0), ("main_tree_to_execute", "", "", 1))
        elif tag == "BehaviorTree":
            yield "ID", "", "", 0
        elif tag == "include":
            yield "path", "", "", 0
        elif tree_of(branch) is not None:
            node = self._desk.node(branch)
            for port in () if node is None else node.ports:
                yield port.name, explain_port(port), port.type.__name__, 0 if port.required else 1
            if tag == SUBTREE:
                yield from (("ID", "", "tree", 0), ("_autoremap", "", "bool", 2))
                for name in self._inner_names(branch.text("ID")):
                    yield name, "", "variable of the tree", 1
            elif tag in KIND_TAGS:
                yield "ID", "", "node", 0
            yield "name", "The node's name, free to choose.", "", 3
            yield from ((name, "", "script", 4) for name in sorted(CONDITION_ATTRIBUTES))
        else:
            yield from ((name, "", "", 0) for name in ("ID", "name", "type", "default"))

    def _inner_names(self, tree_id: str) -> list[str]:
        found = self._desk.tree(self._page, tree_id)
        return [] if found is None else variables(self._desk, found[0], tree_id)


def variables(desk: Desk, page: Page, tree_id: str) -> list[str]:
    """Return the names of a tree's variables."""
    uses = desk.uses(page)
    return sorted({u.name for u in uses if u.what is What.VARIABLE and u.tree == tree_id})


def _element(node_id: str, node: type[Node]) -> str:
    ports = [port for port in node.ports if port.required]
    given = "".join(f' {port.name}="${place}"' for place, port in enumerate(ports, 1))
    if node.max_children == 0:
        return f"<{node_id}{given}/>$0"
    return f"<{node_id}{given}>\n  $0\n</{node_id}>"


class _Values:
    """Completes an attribute's value."""

    def __init__(self, completer: Completer, branch: Branch, attribute: str) -> None:
        self._completer = completer
        self._desk = completer._desk  # noqa: SLF001 - a part of it
        self._page = completer._page  # noqa: SLF001
        self._at = completer._at  # noqa: SLF001
        self._branch = branch
        self._attribute = attribute
        self._node = self._desk.node(branch)
        around = tree_of(branch)
        self._tree = "" if around is None else around.text("ID")

    def items(self, start: int, end: int) -> _Items:
        """Yield completions of the value between two offsets."""
        typed = self._page.text[start : self._at]
        tag, attribute = self._branch.tag.name, self._attribute
        if (tag, attribute) in {(SUBTREE, "ID"), ("root", "main_tree_to_execute")}:
            for tree_id in self._desk.trees(self._page):
                yield self._item(tree_id, _Kind.Function, (start, end))
        elif attribute == "ID" and tag in KIND_TAGS:
            registry = self._desk.registry
            for node_id in registry:
                if registry[node_id].kind is NodeKind(tag):
                    doc = explain_node(registry[node_id], registry)
                    yield self._item(node_id, _Kind.Class, (start, end), doc)
        elif attribute in CONDITION_ATTRIBUTES or is_script(self._node, attribute):
            placeholder = "{" in typed.rpartition("}")[2]  # an open one
            if placeholder or not is_text(self._node, attribute):
                yield from self._in_script(typed)
        elif self._tree:
            yield from self._port(typed, start, end)

    def _item(self, name: str, kind: types.CompletionItemKind, part: _Part, doc: str = "") -> Any:
        return self._completer._item(name, kind, part, name, doc)  # noqa: SLF001

    def _in_script(self, typed: str) -> _Items:
        word = _WORD.search(typed)
        length = len(word[0]) if word is not None else 0
        start, on_board = self._at - length, bool(word and word[1])
        for key in self._desk.board_keys.values():
            if issubclass(key.type, (int, float, str)):
                name, doc = f"@{key.name}", explain_key(key)
                yield self._item(name, _Kind.Constant, (start, self._at), doc)
        for name in () if on_board else variables(self._desk, self._page, self._tree):
            yield self._item(name, _Kind.Variable, (start, self._at))

    def _port(self, typed: str, start: int, end: int) -> _Items:
        ports = () if self._node is None else self._node.ports
        port = next((one for one in ports if one.name == self._attribute), None)
        if port is not None and port.direction == "input" and _REFERENCE.match(typed) is None:
            for literal in self._literals(port):
                yield self._item(literal, _Kind.Value, (start, end))
        if port is None and self._branch.tag.name != SUBTREE:
            return
        for name in variables(self._desk, self._page, self._tree):
            yield self._item(f"{{{name}}}", _Kind.Variable, (start, end))
        for key in self._desk.board_keys.values():
            if port is None or key_fits(port, key):
                name, doc = f"{{@{key.name}}}", explain_key(key)
                yield self._item(name, _Kind.Constant, (start, end), doc)

    def _literals(self, port: Port[Any]) -> Iterator[str]:
        if port.name == POLICY_PORT:
            yield from sorted(self._desk.registry.policies or ())
        elif port.type is bool:
            yield from _BOOLEANS
        else:
            yield from map(port_text, port.choices)
            if port.default is not Port.REQUIRED and not port.choices:
                yield port_text(port.default)
