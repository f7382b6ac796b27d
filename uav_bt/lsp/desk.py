"""What the server knows beside the documents: nodes, board keys, and the other files of a page."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final
from weakref import WeakKeyDictionary

from uav_bt.board.blackboard import Key
from uav_bt.errors import FileError
from uav_bt.lsp.names import Use, node_of, uses_of
from uav_bt.lsp.page import Page
from uav_bt.tree.editing.markup import Branch
from uav_bt.tree.loading.lookup import MAX_INCLUDES
from uav_bt.tree.loading.source import read_source
from uav_bt.tree.node import Node
from uav_bt.tree.registry import NodeRegistry

_KEPT: Final = 200  # pages of files that are not open


class Desk:
    """The nodes that may occur, and the pages that an editor or the disk has.

    Args:
        registry: the nodes.
        open_page: returns the page of a file that an editor has open, None for another.
        units: how many of the client's units a text has.
    """

    def __init__(
        self,
        registry: NodeRegistry,
        open_page: Callable[[Path], Page | None],
        units: Callable[[str], int] = len,
    ) -> None:
        self.registry = registry
        self.board_keys: dict[str, Key[Any]] = dict(registry.board_keys)
        self.units = units
        self._open_page = open_page
        self._read: dict[Path, tuple[int, Page]] = {}
        self._uses: WeakKeyDictionary[Page, list[Use]] = WeakKeyDictionary()

    def node(self, branch: Branch) -> type[Node] | None:
        """Return the class of a node, None for an unknown one."""
        return node_of(branch, self.registry)

    def uses(self, page: Page) -> list[Use]:
        """Return all names of a page."""
        if page not in self._uses:
            self._uses[page] = uses_of(page, self.registry)
        return self._uses[page]

    def page(self, path: Path) -> Page | None:
        """Return a file as the editor has it, else as the disk has it; None for no text."""
        found = self._open_page(path)
        if found is not None:
            return found
        try:
            stamp = path.stat().st_mtime_ns
            known = self._read.get(path)
            if known is None or known[0] != stamp:
                known = (stamp, Page(read_source(path).decode(), path, self.units))
                if len(self._read) >= _KEPT:
                    self._read.clear()
                self._read[path] = known
        except (OSError, FileError, ValueError):  # whoever checks the file says what is wrong
            return None
        return known[1]

    def together(self, page: Page) -> Iterator[Page]:
        """Iterate over a page and those that it includes, each once."""
        seen: set[Path] = set()
        waiting = [page]
        while waiting and len(seen) <= MAX_INCLUDES:
            one = waiting.pop(0)
            if one.path.absolute() in seen:
                continue
            seen.add(one.path.absolute())
            yield one
            for root in one.roots:
                for child in root.children:
                    name = child.text("path") if child.tag.name == "include" else ""
                    other = self.page(_beside(one.path, name)) if name else None
                    if other is not None:
                        waiting.append(other)

    def trees(self, page: Page) -> dict[str, tuple[Page, Branch]]:
        """Return the trees that a page can use, by ID."""
        found: dict[str, tuple[Page, Branch]] = {}
        for one in self.together(page):
            for tree_id, branch in one.trees():
                found.setdefault(tree_id, (one, branch))
        found.pop("", None)
        return found


def _beside(path: Path, name: str) -> Path:
    try:
        return (path.parent / name).resolve()
    except (OSError, ValueError):  # too long, or with a zero byte
        return path
