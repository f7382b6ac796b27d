"""Lookup of the files that a tree file includes, and of trees in other files."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Final

from uav_bt.errors import FileError, TreeError
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
    """Return the tree files of a folder and below, hidden folders left out.

    Raises:
        FileError: there are too many to be read.
    """
    found: list[Path] = []
    passed, size = 0, 0
    for place, folders, names in os.walk(folder):
        folders[:] = [name for name in folders if not name.startswith(".")]
        passed += len(names)
        for name in names:
            path = Path(place, name)
            if path.suffix in TREE_SUFFIXES and not name.startswith(".") and path.is_file():
                found.append(path)
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


class Library:
    """The trees of whole folders, for SubTrees whose tree is in another file.

    Args:
        files: tree files; one that cannot be read has no trees here.
    """

    def __init__(self, files: Iterable[Path] = ()) -> None:
        self._files = tuple(dict.fromkeys(path.resolve() for path in files))
        self._trees: dict[str, list[tuple[Element, LibraryFile]]] = {}
        self.faults: list[str] = []  # why files could not be read
        for path in self._files:
            try:
                source = read_source(path)
                file = LibraryFile(parse_source(source, path), source)
            except TreeError as error:
                self.faults.append(error.findings[0])
                continue
            for element in file.root.children:
                if element.tag == "BehaviorTree" and element.attributes.get("ID"):
                    places = self._trees.setdefault(element.attributes["ID"], [])
                    places.append((element, file))

    @property
    def trees(self) -> Mapping[str, list[tuple[Element, LibraryFile]]]:
        """All trees by ID, with their files."""
        return self._trees

    def find(self, tree_id: str, path: Path) -> list[tuple[Element, LibraryFile]]:
        """Return the trees of an ID, with their files.

        Args:
            tree_id: the ID.
            path: the file that refers to the tree; its trees are left out.
        """
        own = path.resolve()
        return [each for each in self._trees.get(tree_id, []) if each[0].path != own]

    def hint(self) -> str:
        """Return the files that could not be read, for the message that a tree does not exist."""
        shown = self.faults[:_FAULTS_SHOWN]
        more = len(self.faults) - len(shown)
        parts = [*shown, f"{more} more like this"] if more else shown
        return "".join(f"; could not be read: {fault}" for fault in parts)

    def joined_by(self, files: Iterable[Path]) -> Library:
        """Return a library that has the trees of further files."""
        return Library((*self._files, *files))


@dataclass(frozen=True, order=True)
class Inclusion:
    """An `<include>` of a file."""

    path: Path  # of the file that includes
    package: str | None  # the ROS package that is named
    name: str  # the path as it is written


@dataclass(frozen=True)
class Lookup:
    """Sources of the trees and files that a tree file names but does not hold.

    Attributes:
        library: trees of other files.
        include_root: a folder that files may be included from, besides the file's own and below.
        packages: folders of ROS packages, for `<include ros_pkg="...">`.
        included: the target of each include, from an earlier reading in another place.
    """

    library: Library = field(default_factory=Library)
    include_root: Path | None = None
    packages: Mapping[str, Path] = field(default_factory=dict)
    included: Mapping[Inclusion, Path] = field(default_factory=dict)

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

    def find(self, tree_id: str, path: Path) -> list[tuple[Element, LibraryFile]]:
        """Return the trees of an ID, with their files: the library's, or else the shipped one.

        Args:
            tree_id: the ID.
            path: the file that asks.
        """
        return self.library.find(tree_id, path) or self.shipped.find(tree_id, path)


class Includes:
    """Reads included files, each once.

    Args:
        main: the file that was asked for; its folder bounds what may be included.
        lookup: where else files may be included from.

    Attributes:
        sources: the texts of the included files, by path.
        found: which file each `<include>` stands for.
    """

    def __init__(self, main: Path, lookup: Lookup) -> None:
        self._main = main.resolve()
        self._packages = {name: path.resolve() for name, path in lookup.packages.items()}
        self._folders = [self._main.parent] if main.is_file() else []
        if lookup.include_root is not None:
            self._folders.append(lookup.include_root.resolve())
        self._folders += self._packages.values()
        self._known = lookup.included
        self.sources: dict[Path, bytes] = {}
        self.found: dict[Inclusion, Path] = {}
        self._elements: dict[Inclusion, Element] = {}

    def read(self, include: Element, findings: Findings) -> list[Element]:
        """Return the root of the included file; nothing when it was read before or is refused.

        Args:
            include: the element that names the file.
            findings: collects the findings.

        Raises:
            TreeError: the file cannot be read or is not XML.
        """
        attributes = include.attributes
        package = attributes.get("ros_pkg")
        message = ""
        inclusion = Inclusion(include.path.resolve(), package, attributes.get("path", ""))
        if inclusion in self._known:
            return self._taken(include, inclusion, self._known[inclusion])
        if set(attributes) - {"ros_pkg"} != {"path"} or not attributes["path"]:
            message = "needs exactly the attribute 'path', and may have 'ros_pkg'"
        elif package is not None and package not in self._packages:
            message = f"ROS package '{package}' is not known here: add --ros-pkg {package}=DIR"
        elif not self._folders:
            message = "only a tree that is loaded from a file can include another"
        elif len(self.sources) >= MAX_INCLUDES:
            message = f"more than {MAX_INCLUDES} files are included"
        else:
            start = include.path.parent if package is None else self._packages[package]
            return self._read(include, inclusion, findings, start)
        findings.add(include.path, include.at("path"), message, "include", rule=Rule.INCLUDE)
        return []

    def _read(
        self, include: Element, inclusion: Inclusion, findings: Findings, start: Path
    ) -> list[Element]:
        name = inclusion.name
        try:
            target = (start / name).resolve()
            there = target.is_file()
        except OSError as error:  # a name may be too long for the system
            message = f"'{name:.40}...': {error.strerror}"
        else:
            if target == self._main or target in self.sources:
                return self._taken(include, inclusion, target)
            if not any(target.is_relative_to(folder) for folder in self._folders):
                message = (
                    f"'{name}' lies outside the folder {self._folders[0]}: allow it with "
                    "--include-root DIR"
                )
            elif not there:
                message = f"'{name}': no such file in {start}"
            else:
                return self._taken(include, inclusion, target)
        findings.add(include.path, include.at("path"), message, "include", rule=Rule.INCLUDE)
        return []

    def _taken(self, include: Element, inclusion: Inclusion, target: Path) -> list[Element]:
        """Return the root of a file that may be included; nothing when it was read before."""
        self.found[inclusion] = target
        self._elements[inclusion] = include
        if target == self._main or target in self.sources:
            return []
        self.sources[target] = read_source(target)
        return [parse_source(self.sources[target], target)]

    def note_circles(self, findings: Findings) -> None:
        """Note files that include each other in a circle, of which the engine finds no end.

        Args:
            findings: where each include is added that closes a circle.
        """
        after: dict[Path, list[tuple[Element, Path]]] = {}
        for inclusion, element in self._elements.items():
            after.setdefault(inclusion.path, []).append((element, self.found[inclusion]))
        for include, files in circles([self._main], lambda path: after.get(path, ())):
            message = (
                f"the files include each other in a circle, {' > '.join(p.name for p in files)}: "
                "take one of these includes out"
            )
            findings.note(include, message, "path", rule=Rule.INCLUDE)
