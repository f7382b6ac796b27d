"""Folders of an editor and their trees, looked up as by `uav-bt check FOLDER`."""

from __future__ import annotations

import threading
from collections.abc import Iterable
from pathlib import Path

from uav_bt.errors import FileError, TreeError
from uav_bt.lsp.page import Page
from uav_bt.tree.loading.findings import WARNING, WHOLE_FILE, Finding
from uav_bt.tree.loading.loader import check_text
from uav_bt.tree.loading.lookup import (
    Library,
    LibraryFile,
    Lookup,
    files_in,
    read_library_file,
)
from uav_bt.tree.loading.source import walk
from uav_bt.tree.node import NodeKind
from uav_bt.tree.registry import NodeRegistry

_Stamp = tuple[int, int]  # when a file was changed, in nanoseconds; its bytes


class Workspace:
    """The trees of one folder on the disk. A changed file is read again.

    Args:
        folder: the folder.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder.resolve()
        self.lookup = Lookup()
        self.fault: FileError | None = None  # why the folder cannot be looked through
        self._users: dict[str, set[Path]] = {}
        self._read: dict[Path, tuple[_Stamp, LibraryFile | TreeError]] = {}
        self._changed = True
        self._lock = threading.Lock()

    def note_change(self) -> None:
        """Look the folder through again when it is needed next."""
        self._changed = True

    def refresh(self) -> None:
        """Look the folder through, if something may have changed in it."""
        with self._lock:
            if not self._changed:
                return
            self._changed = False
            self.fault = None
            files: tuple[Path, ...] = ()
            try:
                files = files_in(self.folder)
            except FileError as error:
                self.fault = error
            library = Library(files, self._file)
            users: dict[str, set[Path]] = {}
            for element, _ in (each for found in library.trees.values() for each in found):
                for node in (one for one in walk(element) if one.tag == NodeKind.SUBTREE.value):
                    users.setdefault(node.attributes.get("ID", ""), set()).add(element.path)
            kept = {path.resolve() for path in files}
            self._read = {path: one for path, one in self._read.items() if path in kept}
            self._users, self.lookup = users, Lookup(library)

    def _file(self, path: Path) -> LibraryFile:
        try:
            status = path.stat()
            stamp = (status.st_mtime_ns, status.st_size)
        except OSError:
            return read_library_file(path)  # raises the error
        known = self._read.get(path)
        if known is None or known[0] != stamp:
            file: LibraryFile | TreeError
            try:
                file = read_library_file(path)
            except TreeError as error:
                file = error
            known = self._read[path] = (stamp, file)
        if isinstance(known[1], TreeError):
            raise known[1].with_traceback(None)
        return known[1]

    def users(self, tree_id: str) -> Iterable[Path]:
        """Return the files whose trees use a tree of this ID."""
        return sorted(self._users.get(tree_id, ()))

    def places(self) -> dict[str, Path]:
        """Return the files of all trees, by ID; of several, the first."""
        return {tree_id: found[0][0].path for tree_id, found in self.lookup.library.trees.items()}


class Folders:
    """The folders of an editor, each one workspace."""

    def __init__(self) -> None:
        self._workspaces: list[Workspace] = []

    def take(self, folders: Iterable[Path]) -> None:
        """Replace the folders. Folders that stay are not read again."""
        known = {one.folder: one for one in self._workspaces}
        paths = dict.fromkeys(path.resolve() for path in folders if path.is_dir())
        self._workspaces = [known.get(path) or Workspace(path) for path in paths]

    def note_change(self) -> None:
        """Look all folders through again when they are needed next."""
        for workspace in self._workspaces:
            workspace.note_change()

    def around(self, path: Path) -> Workspace | None:
        """Return the innermost folder that a file lies in; None when it lies in none."""
        if not path.is_absolute():
            return None  # an unsaved document
        target = path.resolve()
        holding = [one for one in self._workspaces if target.is_relative_to(one.folder)]
        return max(holding, key=lambda one: len(one.folder.parts), default=None)

    def check(self, page: Page, registry: NodeRegistry) -> tuple[Finding, ...]:
        """Return the findings of a page.

        Args:
            page: the document.
            registry: the nodes that may occur.
        """
        workspace = self.around(page.path)
        lookup, fault = None, None
        if workspace is not None:
            workspace.refresh()
            lookup, fault = workspace.lookup, workspace.fault
        data = page.text.encode(errors="surrogatepass")
        found = check_text(data, registry, path=page.path, lookup=lookup)
        if fault is not None:
            message = f"trees of other files are not looked up: {fault}"
            found = (*found, Finding(str(page.path), WHOLE_FILE, message, severity=WARNING))
        return found
