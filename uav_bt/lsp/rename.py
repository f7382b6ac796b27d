"""Renaming trees and variables, through every subtree that shares them."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Final

from lsprotocol import types

from uav_bt.errors import InputError
from uav_bt.lsp.desk import Desk
from uav_bt.lsp.find import use_at
from uav_bt.lsp.names import SUBTREE, Use, What
from uav_bt.lsp.page import Page, tree_of

_VARIABLE: Final = re.compile(r"[A-Za-z_]\w*")
_TREE: Final = re.compile(r"[^\s<>&\"'/\\:.{}]+")
_SAME: Final = re.compile(r"\s*\{\s*@?=\s*\}\s*")
_Variable = tuple[str, str]  # tree and name


def renamed(desk: Desk, page: Page, offset: int, new: str) -> types.WorkspaceEdit:
    """Return the edits that give a tree or a variable another name, in the page and its includes.

    Args:
        desk: what there is.
        page: the document.
        offset: of the name, or behind it.
        new: the other name.

    Raises:
        InputError: nothing here can be renamed, or not so.
    """
    use = use_at(desk, page, offset)
    if use is None or use.what is What.KEY:
        raise InputError("only trees and variables can be renamed")
    pages = list(desk.together(page))
    found = [(home, one) for home in pages for one in desk.uses(home)]
    if use.what is What.TREE:
        if not _TREE.fullmatch(new):
            raise InputError(f"'{new}' cannot be a tree's ID: write letters, digits and '_'")
        if any(one.what is What.TREE and one.name == new for _, one in found):
            raise InputError(f"there is a tree '{new}'")
        chosen = [(h, one) for h, one in found if (one.what, one.name) == (What.TREE, use.name)]
    else:
        chosen = list(_variable(found, use, new))
    edits: dict[str, dict[int, types.TextEdit]] = {}
    for home, one in chosen:
        known = edits.setdefault(home.uri, {})
        known[one.start] = types.TextEdit(home.range(one.start, one.end), new)
        given = one.branch.attribute(one.attribute)
        if one.entry and given is not None and _SAME.fullmatch(given.value):
            # `x="{=}"` means the outer x; unless that is renamed, too, it keeps its name.
            at = given.value_start + given.value.index("=")
            known.setdefault(at, types.TextEdit(home.range(at, at + 1), use.name))
    return types.WorkspaceEdit(changes={uri: list(known.values()) for uri, known in edits.items()})


def _variable(found: list[tuple[Page, Use]], use: Use, new: str) -> Iterator[tuple[Page, Use]]:
    """Yield every use of a variable, in its own tree and in those that share it.

    Raises:
        InputError: the name cannot be a variable's, is taken, or would change what is shared.
    """
    if not _VARIABLE.fullmatch(new):
        raise InputError(f"'{new}' cannot be a variable's name: write letters, digits and '_'")
    uses = [one for _, one in found]
    shared = _shared(uses, (use.tree, use.name))
    if len(shared) > 1 and new.startswith("_"):
        raise InputError(f"'{new}' would be private, but the variable is shared by _autoremap")
    for one in uses:
        taken = one.what is What.VARIABLE and one.name == new
        if taken and any(tree == one.tree for tree, _ in shared):
            raise InputError(f"tree '{one.tree}' has a variable '{new}'")
    for home, one in found:
        if one.what is What.VARIABLE and (one.tree, one.name) in shared:
            yield home, one


def _shared(uses: list[Use], start: _Variable) -> set[_Variable]:
    """Return a variable and those that `_autoremap` makes the same in other trees."""
    doors: list[tuple[str, str, frozenset[str]]] = []  # outer tree, inner tree, own names inside
    for use in uses:
        branch = use.branch
        if use.what is What.TREE and branch.tag.name == SUBTREE and use.attribute == "ID":
            outer = tree_of(branch)
            if outer is not None and branch.text("_autoremap").strip().lower() in {"true", "1"}:
                own = frozenset(one.name for one in branch.tag.attributes)
                doors.append((outer.text("ID"), use.name, own))
    shared = {start}
    waiting = [start]
    while waiting:
        tree, name = waiting.pop()
        for outer_id, inner_id, own in doors:
            if name in own or name.startswith("_"):
                continue
            for here, there in ((outer_id, inner_id), (inner_id, outer_id)):
                if here == tree and (there, name) not in shared:
                    shared.add((there, name))
                    waiting.append((there, name))
    return shared
