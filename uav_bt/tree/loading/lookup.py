"""Where a tree file finds what it names but does not hold: included files, trees of other files."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from uav_bt.errors import FileError, InputError
from uav_bt.tree.loading.findings import Findings
from uav_bt.tree.loading.source import Element, parse_source, read_source

MAX_INCLUDES: Final = 50
MAX_LIBRARY_FILES: Final = 5_000
TREE_SUFFIXES: Final = (".xml", ".btproj")
"""Of the files that hold trees; `.btproj` is a project of Groot2, which includes its files."""


def files_in(folder: Path) -> tuple[Path, ...]:
    """Return the tree files of a folder and below, hidden folders left out.

    Raises:
        FileError: there are too many to be read.
    """
    found: list[Path] = []
    for path in folder.rglob("*"):
        hidden = any(part.startswith(".") for part in path.relative_to(folder).parts)
        if path.suffix in TREE_SUFFIXES and not hidden and path.is_file():
            found.append(path)
        if len(found) > MAX_LIBRARY_FILES:
            raise FileError(folder, f"more than {MAX_LIBRARY_FILES} tree files")
    return tuple(sorted(found))


@dataclass(frozen=True)
class LibraryFile:
    """A tree file whose trees others use."""

    root: Element
    source: bytes


class Library:
    """The trees of whole folders, for SubTrees whose tree is in another file.

    Args:
        files: tree files; one that cannot be read has no trees here. Whoever checks it sees why.
    """

    def __init__(self, files: Iterable[Path] = ()) -> None:
        self._files = tuple(dict.fromkeys(path.resolve() for path in files))
        self._trees: dict[str, list[tuple[Element, LibraryFile]]] = {}
        for path in self._files:
            try:
                source = read_source(path)
                file = LibraryFile(parse_source(source, path), source)
            except InputError:
                continue
            for element in file.root.children:
                if element.tag == "BehaviorTree" and element.attributes.get("ID"):
                    places = self._trees.setdefault(element.attributes["ID"], [])
                    places.append((element, file))

    def find(self, tree_id: str) -> list[tuple[Element, LibraryFile]]:
        """Return the trees of an ID, with their files."""
        return self._trees.get(tree_id, [])

    def joined_by(self, files: Iterable[Path]) -> Library:
        """Return a library that has the trees of further files."""
        return Library((*self._files, *files))


@dataclass(frozen=True)
class Lookup:
    """Where to look for what a tree file does not hold.

    Attributes:
        library: trees of other files.
        include_root: a folder that files may be included from, besides the file's own and below.
        packages: folders of ROS packages, for `<include ros_pkg="...">`.
    """

    library: Library = field(default_factory=Library)
    include_root: Path | None = None
    packages: Mapping[str, Path] = field(default_factory=dict)


class Includes:
    """Reads included files, each once.

    Args:
        main: the file that was asked for; its folder bounds what may be included.
        lookup: where else files may be included from.
    """

    def __init__(self, main: Path, lookup: Lookup) -> None:
        self._main = main.resolve()
        self._packages = {name: path.resolve() for name, path in lookup.packages.items()}
        self._folders = [self._main.parent] if main.is_file() else []
        if lookup.include_root is not None:
            self._folders.append(lookup.include_root.resolve())
        self._folders += self._packages.values()
        self.sources: dict[Path, bytes] = {}  # of the included files, by path

    def read(self, include: Element, findings: Findings) -> list[Element]:
        """Return the root of the included file; nothing when it was read before or is refused.

        Args:
            include: the element that names the file.
            findings: where they are added.

        Raises:
            TreeError: the file cannot be read or is no XML.
        """
        attributes = include.attributes
        package = attributes.get("ros_pkg")
        message = ""
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
            return self._read(include, findings, start)
        findings.add(include.path, include.at("path"), message, "include")
        return []

    def _read(self, include: Element, findings: Findings, start: Path) -> list[Element]:
        name = include.attributes["path"]
        try:
            target = (start / name).resolve()
            there = target.is_file()
        except OSError as error:  # a name may be too long for the system
            message = f"'{name:.40}...': {error.strerror}"
        else:
            if target == self._main or target in self.sources:
                return []
            if not any(target.is_relative_to(folder) for folder in self._folders):
                message = (
                    f"'{name}' lies outside the folder {self._folders[0]}: allow it with "
                    "--include-root DIR"
                )
            elif not there:
                message = f"'{name}': no such file in {start}"
            else:
                self.sources[target] = read_source(target)
                return [parse_source(self.sources[target], target)]
        findings.add(include.path, include.at("path"), message, "include")
        return []
