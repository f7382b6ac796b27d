"""From a name to where it is defined or used, and the outline of a page."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Final

from lsprotocol import types

from uav_bt.lsp.desk import Desk, Named
from uav_bt.lsp.names import SUBTREE, Use, What
from uav_bt.lsp.page import Page, attribute_at, node_id_of
from uav_bt.tree.editing.markup import Branch, resolve
from uav_bt.tree.expanded import ExpandedNode
from uav_bt.tree.node import Node

_MAX_DEPTH: Final = 100  # of an outline; the loader takes no deeper tree


def use_at(desk: Desk, page: Page, offset: int) -> Use | None:
    """Return the name that a cursor is on, or stands behind."""
    found = [one for one in desk.uses(page) if one.start <= offset <= one.end]
    return min(found, key=lambda one: one.end - one.start, default=None)


def definitions(desk: Desk, page: Page, offset: int) -> list[types.Location]:
    """Return where the thing at an offset is defined: a tree, a variable, a node's class."""
    use = use_at(desk, page, offset)
    if use is not None and use.what is What.TREE:
        return _tree(desk, page, use.name)
    if use is not None and use.what is What.VARIABLE:
        same = _same(desk, page, use)
        return [_location(one) for one in same if one.use.defines or one.use.entry]
    tag = page.tag_from(offset)
    branch = None if tag is None else page.by_tag.get(tag.start)
    if tag is None or branch is None:
        return []
    found = attribute_at(tag, offset)
    if tag.name == "include" and found is not None:
        target = page.path.parent / branch.text("path")
        return [types.Location(target.resolve().as_uri(), _line(0))] if target.is_file() else []
    if found is not None and found.name != "ID":
        return []
    return _node(desk, page, branch)


def references(
    desk: Desk, page: Page, offset: int, *, declaration: bool = True
) -> list[types.Location]:
    """Return where the name at an offset stands, in the page and in those that belong to it."""
    use = use_at(desk, page, offset)
    if use is None:
        return []
    same = _same(desk, page, use)
    return [_location(one) for one in same if declaration or not one.use.defines]


def _same(desk: Desk, page: Page, use: Use) -> list[Named]:
    named = desk.named(desk.family(page))
    (here,) = [one for one in named if one.page is page and one.use is use]
    return [one for one in named if one.same(here)]


def _tree(desk: Desk, page: Page, tree_id: str) -> list[types.Location]:
    found = desk.tree(page, tree_id)
    if found is None:
        return []
    home, branch = found
    return [types.Location(home.uri, home.range(branch.tag.start, branch.tag.end))]


def _node(desk: Desk, page: Page, branch: Branch) -> list[types.Location]:
    """Return where a node's class is, after the tree that it stands for."""
    node = desk.node(branch)
    if node is None:
        return []
    if issubclass(node, ExpandedNode):
        given = {one.name: resolve(one.value)[0] for one in branch.tag.attributes}
        return [*_tree(desk, page, node.tree_of(given)), *_class(node)]
    return _tree(desk, page, branch.text("ID")) if branch.tag.name == SUBTREE else _class(node)


def _location(named: Named) -> types.Location:
    return types.Location(named.page.uri, named.page.range(named.use.start, named.use.end))


def _line(line: int) -> types.Range:
    return types.Range(types.Position(line, 0), types.Position(line, 0))


def _class(node: type[Node]) -> list[types.Location]:
    try:
        file = inspect.getsourcefile(node)
        _, line = inspect.getsourcelines(node)
    except (OSError, TypeError):  # made by a palette, or from no file
        return []
    return [types.Location(Path(file).as_uri(), _line(line - 1))] if file else []


def symbols(page: Page) -> list[types.DocumentSymbol]:
    """Return the outline of a page: its trees, and their nodes as they lie in each other."""
    return [
        _symbol(child, page, 0)
        for root in page.roots
        for child in root.children
        if child.tag.name == "BehaviorTree"
    ]


def _symbol(branch: Branch, page: Page, depth: int) -> types.DocumentSymbol:
    tag = branch.tag
    is_tree = tag.name == "BehaviorTree"
    name = branch.text("name")
    inner = branch.children if depth < _MAX_DEPTH else []
    return types.DocumentSymbol(
        name=(branch.text("ID") if is_tree else name or _title(branch)) or tag.name or "?",
        detail="" if is_tree or not name else _title(branch),
        kind=types.SymbolKind.Class if is_tree else types.SymbolKind.Function,
        range=page.range(tag.start, max(branch.end, tag.end)),
        selection_range=page.range(tag.start, tag.end),
        children=[_symbol(child, page, depth + 1) for child in inner],
    )


def _title(branch: Branch) -> str:
    if branch.tag.name == SUBTREE:
        return f"{SUBTREE} {branch.text('ID')}".strip()
    return node_id_of(branch) or branch.tag.name
