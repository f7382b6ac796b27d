"""Lookup of the files that a tree file includes, and of trees in other files."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Final

from uav_bt.errors import FileError, InputError, TreeError
from uav_bt.tree.loading.findings import Findings, Rule
from uav_bt.tree.loading.source import MAX_BYTES, Element, circles, parse_source, read_source

MAX_INCLUDES: Final = 50
MAX_LIBRARY_FILES: Final = 5_000
MAX_LIBRARY_BYTES: Final = 50_000_000  # of all of them
MAX_FOLDER_FILES: Final = 200_000  # of any kind, so that a whole disk is not searched
TREE_SUFFIXES: Final = (".xml", ".btproj")
"""Of the files that hold trees; `.btproj` is a project of Groot2, which includes its files."""
_FAULTS_SHOWN: Final = 3


def shipped_trees() -> Path:
    """Return the folder of the missions that ship with uav-bt."""
    from importlib import resources  # noqa: PLC0415 - slow, and mostly not needed

    return Path(str(resources.files("trees")))


def files_in(folder: Path) -> tuple[Path, ...]:
    """Return the tree files of a folder and below, hidden ones left out."""
    found: list[Path] = []
    passed, size = 0, 0
    for place, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if not name.startswith(".")]
        passed += len(names)
        shown = (Path(place, name) for name in names if not name.startswith("."))
        new = [path for path in shown if path.suffix in TREE_SUFFIXES and path.is_file()]
        found += new
        for path in new:
            with contextlib.suppress(FileNotFoundError):  # gone by now
                size += min(path.stat().st_size, MAX_BYTES)  # of a larger one no more is read
        for count, most, what in (
            (len(found), MAX_LIBRARY_FILES, "tree files"),
            (size, MAX_LIBRARY_BYTES, "bytes of tree files"),
            (passed, MAX_FOLDER_FILES, "files"),
        ):
            if count > most:
                raise FileError(folder, f"more than {most} {what}: choose a folder inside it")
    return tuple(sorted(found))


@dataclass(frozen=True, eq=False)
class LibraryFile:
    """A tree file whose trees others use."""

    root: Element
    source: bytes


_Found = list[tuple[Element, LibraryFile]]  # trees, each with its file


class Library:
    """The trees of tree files, for SubTrees whose tree is in another file."""

    def __init__(self, files: Iterable[Path] = ()) -> None:
        self._files = tuple(dict.fromkeys(path.resolve() for path in files))
        self.trees: dict[str, _Found] = {}  # by ID
        self._faults: list[str] = []  # why files could not be read
        for path in self._files:
            try:
                source = read_source(path)
                file = LibraryFile(parse_source(source, path), source)
            except TreeError as error:
                self._faults.append(error.findings[0])
                continue
            for element in file.root.children:
                if element.tag == "BehaviorTree" and element.attributes.get("ID"):
                    self.trees.setdefault(element.attributes["ID"], []).append((element, file))

    def find(self, tree_id: str, path: Path) -> _Found:
        """Return the trees of an ID, those of the file that asks left out."""
        own = path.resolve()
        return [each for each in self.trees.get(tree_id, []) if each[0].path != own]

    def hint(self) -> str:
        """Return the files that could not be read, for the message that a tree does not exist."""
        more = len(self._faults) - _FAULTS_SHOWN
        parts = self._faults[:_FAULTS_SHOWN] + [f"{more} more like this"] * (more > 0)
        return "".join(f"; could not be read: {fault}" for fault in parts)

    def joined_by(self, files: Iterable[Path]) -> Library:
        """Return a library that has the trees of further files."""
        return Library((*self._files, *files))


@dataclass(frozen=True)
class Lookup:
    """Sources of the trees and files that a tree file names but does not hold."""

    library: Library = field(default_factory=Library)
    include_root: Path | None = None  # files may be included from there, too
    packages: Mapping[str, Path] = field(default_factory=dict)  # of ROS, for `<include ros_pkg=`

    @cached_property
    def shipped(self) -> Library:
        """The trees that ship with the package, in `trees/lib/`; read when first asked for."""
        return Library(files_in(shipped_trees() / "lib"))

    @cached_property
    def described(self) -> Mapping[str, Element]:
        """The models of the shipped trees whose ports a TreeNodesModel describes, by ID."""
        files = (file for places in self.shipped.trees.values() for _, file in places)
        return {
            model.attributes["ID"]: model
            for file in files
            for part in file.root.children
            if part.tag == "TreeNodesModel"
            for model in part.children
            if model.attributes.get("ID", "") in self.shipped.trees
        }

    def find(self, tree_id: str, path: Path) -> _Found:
        """Return the trees of an ID: the library's, or else the shipped one."""
        return self.library.find(tree_id, path) or self.shipped.find(tree_id, path)


class Includes:
    """Reads included files, each once; the folder of the main file bounds what may be included."""

    def __init__(self, main: Path, lookup: Lookup) -> None:
        self._main = main.resolve()
        self._packages = {name: path.resolve() for name, path in lookup.packages.items()}
        root = lookup.include_root
        self._folders = [
            *([self._main.parent] if main.is_file() else []),
            *([] if root is None else [root.resolve()]),
            *self._packages.values(),
        ]
        self.sources: dict[Path, bytes] = {}  # texts of the included files
        self._after: dict[Path, list[tuple[Element, Path]]] = {}  # what each file includes

    def read(self, include: Element, findings: Findings) -> list[Element]:
        """Return the root of the included file; nothing when it was read before or is refused."""
        try:
            target = self._target(include)
        except InputError as error:
            where = include.at("path")
            findings.add(include.path, where, str(error), "include", rule=Rule.INCLUDE)
            return []
        self._after.setdefault(include.path.resolve(), []).append((include, target))
        if target == self._main or target in self.sources:
            return []
        self.sources[target] = read_source(target)
        return [parse_source(self.sources[target], target)]

    def _target(self, include: Element) -> Path:
        """Return the file that an include names, or raise an InputError."""
        package = include.attributes.get("ros_pkg")
        name = include.attributes.get("path", "")
        if set(include.attributes) - {"ros_pkg"} != {"path"} or not name:
            raise InputError("needs exactly the attribute 'path', and may have 'ros_pkg'")
        if package is not None and package not in self._packages:
            raise InputError(
                f"ROS package '{package}' is not known here: add --ros-pkg {package}=DIR"
            )
        if not self._folders:
            raise InputError("only a tree that is loaded from a file can include another")
        if len(self.sources) >= MAX_INCLUDES:
            raise InputError(f"more than {MAX_INCLUDES} files are included")
        start = include.path.parent if package is None else self._packages[package]
        try:
            target = (start / name).resolve()
            there = target.is_file()
        except OSError as error:  # a name may be too long for the system
            raise InputError(f"'{name:.40}...': {error.strerror}") from error
        if target == self._main or target in self.sources:
            return target
        if not any(target.is_relative_to(folder) for folder in self._folders):
            raise InputError(
                f"'{name}' lies outside the folder {self._folders[0]}: allow it with "
                "--include-root DIR"
            )
        if not there:
            raise InputError(f"'{name}': no such file in {start}")
        return target

    def note_circles(self, findings: Findings) -> None:
        """Note files that include each other in a circle, of which the engine finds no end."""
        for include, files in circles([self._main], lambda path: self._after.get(path, ())):
            message = (
                f"the files include each other in a circle, {' > '.join(p.name for p in files)}: "
                "take one of these includes out"
            )
            findings.note(include, message, "path", rule=Rule.INCLUDE)
