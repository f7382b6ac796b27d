"""Renaming trees and variables, through every subtree that shares them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from lsprotocol import types

from uav_bt.errors import InputError
from uav_bt.lsp.desk import MAX_FAMILY, Desk, Named, key_of
from uav_bt.lsp.find import use_at
from uav_bt.lsp.names import SUBTREE, What
from uav_bt.lsp.page import Page, tree_of

_VARIABLE: Final = re.compile(r"[A-Za-z_]\w*")
_TREE_ID: Final = re.compile(r"[^\s<>&\"'/\\:.{}]+")
_SAME: Final = re.compile(r"\s*\{\s*@?=\s*\}\s*")
_Tree = tuple[Path, str]  # its file and its ID
_Variable = tuple[_Tree, str]


def renamed(desk: Desk, page: Page, offset: int, new: str) -> types.WorkspaceEdit:
    """Return the edits that give a tree or a variable another name, in all files of its family.

    Args:
        desk: the known nodes, board keys and files.
        page: the document.
        offset: of the name, or behind it.
        new: the other name.

    Raises:
        InputError: nothing here can be renamed, or the new name cannot be used.
    """
    use = use_at(desk, page, offset)
    if use is None or use.what is What.KEY:
        raise InputError("only trees and variables can be renamed")
    pages = desk.family(page)
    if len(pages) >= MAX_FAMILY:
        raise InputError(f"{MAX_FAMILY} files or more share this: open a smaller folder to rename")
    found = desk.named(pages)
    (here,) = [one for one in found if one.page is page and one.use is use]
    if use.what is What.TREE:
        chosen = list(_tree(desk, found, here, new))
    else:
        chosen = list(_variable(found, here, new))
    edits: dict[str, dict[int, types.TextEdit]] = {}
    for named in chosen:
        home, one = named.page, named.use
        known = edits.setdefault(home.uri, {})
        known[one.start] = types.TextEdit(home.range(one.start, one.end), new)
        given = one.branch.attribute(one.attribute)
        if one.entry and given is not None and _SAME.fullmatch(given.value):
            # `x="{=}"` means the outer x; unless that is renamed, too, it keeps its name.
            at = given.value_start + given.value.index("=")
            known.setdefault(at, types.TextEdit(home.range(at, at + 1), use.name))
    return types.WorkspaceEdit(changes={uri: list(known.values()) for uri, known in edits.items()})


def _tree(desk: Desk, found: list[Named], here: Named, new: str) -> Iterator[Named]:
    """Yield every use of a tree.

    Raises:
        InputError: the name cannot be a tree's, or is taken in a file that uses it.
    """
    if not _TREE_ID.fullmatch(new):
        raise InputError(f"'{new}' cannot be a tree's ID: write letters, digits and '_'")
    if new in desk.registry:
        raise InputError(f"'{new}' is a node: choose another ID")
    chosen = [one for one in found if one.same(here)]
    for page in dict.fromkeys(one.page for one in chosen):
        taken = any(one.page is page and one.use.name == new for one in found if _of_tree(one))
        if taken or new in desk.trees(page):
            raise InputError(f"there is a tree '{new}'")
    yield from chosen


def _of_tree(named: Named) -> bool:
    return named.use.what is What.TREE


def _variable(found: list[Named], here: Named, new: str) -> Iterator[Named]:
    """Yield every use of a variable, in its tree and in the trees that share it.

    Raises:
        InputError: the name cannot be a variable's, is taken, or would end the sharing.
    """
    if not _VARIABLE.fullmatch(new):
        raise InputError(f"'{new}' cannot be a variable's name: write letters, digits and '_'")
    shared = _shared(found, ((here.home, here.use.tree), here.use.name))
    if len(shared) > 1 and new.startswith("_"):
        raise InputError(f"'{new}' would be private, but the variable is shared by _autoremap")
    trees = {tree for tree, _ in shared}
    variables = [one for one in found if one.use.what is What.VARIABLE]
    for one in variables:
        if one.use.name == new and (one.home, one.use.tree) in trees:
            raise InputError(f"tree '{one.use.tree}' has a variable '{new}'")
    yield from (one for one in variables if ((one.home, one.use.tree), one.use.name) in shared)


def _shared(found: list[Named], start: _Variable) -> set[_Variable]:
    """Return a variable and those that `_autoremap` makes the same in other trees."""
    doors: list[tuple[_Tree, _Tree, frozenset[str]]] = []  # outer, inner, own names inside
    for named in found:
        use, branch = named.use, named.use.branch
        if use.what is What.TREE and branch.tag.name == SUBTREE and use.attribute == "ID":
            outer = tree_of(branch)
            if outer is not None and branch.text("_autoremap").strip().lower() in {"true", "1"}:
                own = frozenset(one.name for one in branch.tag.attributes)
                doors.append(((key_of(named.page), outer.text("ID")), (named.home, use.name), own))
    shared = {start}
    waiting = [start]
    while waiting:
        tree, name = waiting.pop()
        for outer_tree, inner_tree, own in doors:
            if name in own or name.startswith("_"):
                continue
            for one, other in ((outer_tree, inner_tree), (inner_tree, outer_tree)):
                if one == tree and (other, name) not in shared:
                    shared.add((other, name))
                    waiting.append((other, name))
    return shared
