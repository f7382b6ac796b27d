"""Nodes, board keys and files of the server beside the open documents."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final
from weakref import WeakKeyDictionary

from uav_bt.board.blackboard import Key
from uav_bt.errors import FileError
from uav_bt.lsp.names import Use, What, node_of, uses_of
from uav_bt.lsp.page import Page
from uav_bt.lsp.workspace import Workspace
from uav_bt.tree.editing.markup import Branch
from uav_bt.tree.loading.lookup import MAX_INCLUDES, Lookup
from uav_bt.tree.loading.source import read_source
from uav_bt.tree.node import Node
from uav_bt.tree.registry import NodeRegistry

_KEPT: Final = 200  # pages of files that are not open
MAX_FAMILY: Final = 200  # files that a renaming looks through


@dataclass(frozen=True)
class Named:
    """A place where something is named, and the file that it belongs to."""

    page: Page
    use: Use
    home: Path  # of the tree that is named, or whose variable it is: of several trees of one ID one

    def same(self, other: Named) -> bool:
        """Return whether two places name the same thing."""
        mine, its = self.use, other.use
        if (mine.what, mine.name) != (its.what, its.name):
            return False
        return mine.what is What.KEY or (self.home, mine.tree) == (other.home, its.tree)


class Desk:
    """The nodes that may occur, and the pages that an editor or the disk has.

    Args:
        registry: the nodes.
        open_pages: returns the documents that the editor has open.
        workspace: returns the folder of the editor that a file lies in, None for no folder.
        units: returns the length of a text in the client's units.
    """

    def __init__(
        self,
        registry: NodeRegistry,
        open_pages: Callable[[], list[Page]],
        workspace: Callable[[Path], Workspace | None],
        units: Callable[[str], int] = len,
    ) -> None:
        self.registry = registry
        self.board_keys: dict[str, Key[Any]] = dict(registry.board_keys)
        self.units = units
        self._open_pages = open_pages
        self._workspace = workspace
        self._read: dict[Path, tuple[int, Page]] = {}
        self._shipped = Lookup()  # of a page that lies in no folder of the editor
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
        for one in self._open_pages():
            if path in {one.path, key_of(one)}:
                return one
        try:
            stamp = path.stat().st_mtime_ns
            known = self._read.get(path)
            if known is None or known[0] != stamp:
                known = (stamp, Page(read_source(path).decode(), path, self.units))
                if len(self._read) >= _KEPT:
                    self._read.clear()
                self._read[path] = known
        except (OSError, FileError, ValueError):  # the check of the file reports it
            return None
        return known[1]

    def together(self, page: Page) -> Iterator[Page]:
        """Iterate over a page and those that it includes, each once."""
        folder = page.path.absolute().parent.resolve()
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
                    target = _beside(one.path, name)
                    # As the loader has it, nothing is read from outside the file's folder.
                    inside = name and target.is_relative_to(folder)
                    other = self.page(target) if inside else None
                    if other is not None:
                        waiting.append(other)

    def _beside_in_folder(self, page: Page) -> list[Page]:
        """Return the other open documents of a page's workspace."""
        workspace = self._workspace(page.path)
        return [
            one
            for one in self._open_pages()
            if one is not page and workspace is not None
            if self._workspace(one.path) is workspace
        ]

    def trees(self, page: Page) -> dict[str, Path]:
        """Return the files of the trees that a page can use, by ID."""
        found: dict[str, Path] = {}
        for one in (*self.together(page), *self._beside_in_folder(page)):
            for tree_id, _ in one.trees():
                found.setdefault(tree_id, one.path)
        workspace = self._workspace(page.path)
        others = {} if workspace is None else workspace.places()
        shown = {key_of(page), *(key_of(one) for one in self._beside_in_folder(page))}
        found = {**{name: at for name, at in others.items() if at not in shown}, **found}
        found.pop("", None)
        shipped = self._lookup(workspace).shipped.trees
        return {**{name: each[0][0].path for name, each in shipped.items()}, **found}

    def _lookup(self, workspace: Workspace | None) -> Lookup:
        return self._shipped if workspace is None else workspace.lookup

    def tree(self, page: Page, tree_id: str) -> tuple[Page, Branch] | None:
        """Return the tree that an ID names in a page, with the page that holds it."""
        workspace = self._workspace(page.path)
        for one in (*self.together(page), *self._beside_in_folder(page)):
            branch = _tree_in(one, tree_id)
            if branch is not None:
                return one, branch
        for element, _ in self._lookup(workspace).find(tree_id, page.path):
            other = self.page(element.path)
            branch = None if other is None else _tree_in(other, tree_id)
            if other is not None and branch is not None:
                return other, branch
        return None

    def home(self, page: Page, tree_id: str) -> Path:
        """Return the file whose tree an ID stands for in a page; the page's own for no tree."""
        found = self.tree(page, tree_id)
        return key_of(page if found is None else found[0])

    def family(self, page: Page) -> list[Page]:
        """Return a page, the files whose trees it uses or includes, and those that use its trees.

        Each is followed further, as a variable may be shared through all of them; after
        `MAX_FAMILY` of them no more are looked for.
        """
        found: dict[Path, Page] = {}
        waiting = [page]
        while waiting and len(found) < MAX_FAMILY:
            one = waiting.pop(0)
            if key_of(one) in found:
                continue
            found[key_of(one)] = one
            waiting += self.together(one)
            named = {use.name: use.defines for use in self.uses(one) if use.what is What.TREE}
            for tree_id in named:
                inner = self.tree(one, tree_id)
                waiting += [] if inner is None else [inner[0]]
                waiting += self._users(one, tree_id)
        return [*found.values()]

    def named(self, pages: list[Page]) -> list[Named]:
        """Return all names of a family of pages, each with the file whose tree it belongs to."""
        found = []
        for one in pages:
            homes: dict[str, Path] = {}
            for use in self.uses(one):
                tree = use.name if use.what is What.TREE else use.tree
                if use.defines and use.what is What.TREE:
                    home = key_of(one)
                elif use.what is What.TREE or use.entry:
                    home = homes.get(tree) or homes.setdefault(tree, self.home(one, tree))
                else:
                    home = key_of(one)
                found.append(Named(one, use, home))
        return found

    def _users(self, page: Page, tree_id: str) -> Iterator[Page]:
        """Iterate over the pages of the workspace that use a tree of this page."""
        if _tree_in(page, tree_id) is None:
            return
        workspace = self._workspace(page.path)
        paths = () if workspace is None else workspace.users(tree_id)
        others = (*self._beside_in_folder(page), *filter(None, map(self.page, paths)))
        for one in dict.fromkeys(others):
            names = any(use.what is What.TREE and use.name == tree_id for use in self.uses(one))
            if names and self.home(one, tree_id) == key_of(page):
                yield one


def key_of(page: Page) -> Path:
    """Return the path that stands for a page's file, however it was named."""
    return page.path.resolve()


def _tree_in(page: Page, tree_id: str) -> Branch | None:
    return next((branch for name, branch in page.trees() if name == tree_id and name), None)


def _beside(path: Path, name: str) -> Path:
    try:
        return (path.parent / name).resolve()
    except (OSError, ValueError):  # too long, or with a zero byte
        return path
