"""Lookup of the files that a tree file includes, and of trees in other files and folders."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Final

from uav_bt.errors import FileError, InputError, TreeError
from uav_bt.files import did_you_mean_file
from uav_bt.option import Option, pairs
from uav_bt.settings import brief_repr
from uav_bt.tree.loading.findings import Findings, Rule
from uav_bt.tree.loading.source import MAX_BYTES, Element, circles, parse_source, read_source

MAX_INCLUDES: Final = 50
MAX_LIBRARY_FILES: Final = 5_000
MAX_LIBRARY_BYTES: Final = 50_000_000  # of all of them
MAX_FOLDER_FILES: Final = 200_000  # of any kind, so that a whole disk is not searched
TREE_SUFFIXES: Final = (".xml", ".btproj")
"""Of the files that hold trees; `.btproj` is a project of Groot2, which includes its files."""
_FAULTS_SHOWN: Final = 3
TreeId = Annotated[
    str | None,
    Option(
        "Which of the file's trees; default: the one that it names, or that no other uses.",
        "--tree ID",
        "Mission",
    ),
]


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


def file_in(start: Path, name: str, folders: Sequence[Path], where: str) -> Path:
    """Return the file that a tree file names, or raise an InputError.

    Args:
        start: the folder that the name begins at.
        name: the file's name.
        folders: resolved; the file lies in one of them or below.
        where: names them in the message, with a cure.
    """
    try:
        target = (start / name).resolve()
        there = target.is_file()
    except (OSError, ValueError) as error:  # too long for the system, or with a zero byte
        raise InputError(f"'{name:.40}' is no name of a file: {error}") from error
    if not any(target.is_relative_to(folder) for folder in folders):
        raise InputError(f"'{name}' lies outside the folder {where}")
    if not there:
        raise InputError(f"'{name}': no such file in {start}{did_you_mean_file(start / name)}")
    return target


@dataclass(frozen=True, eq=False)
class LibraryFile:
    """A tree file whose trees others use."""

    root: Element
    source: bytes


_Found = list[tuple[Element, LibraryFile]]  # trees, each with its file


class Library:
    """The trees of tree files, for SubTrees whose tree is in another file."""

    def __init__(self, files: Iterable[Path] = ()) -> None:
        self.files = tuple(dict.fromkeys(path.resolve() for path in files))
        self.trees: dict[str, _Found] = {}  # by ID
        self._faults: list[str] = []  # why files could not be read
        for path in self.files:
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
        return "".join(f"; could not be read: {fault}" for fault in self._faults[:_FAULTS_SHOWN])


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


@dataclass(frozen=True, kw_only=True)
class TreeFolders:
    """Folders, besides that of the tree file, for the trees and files that it names.

        TreeFolders(trees=["parts"], packages={"robot": "workspace/src/robot"})

    Nothing is read before `lookup`.

    Attributes:
        trees: folders whose files have the trees that SubTrees may use.
        include_root: a folder that files may be included from, besides the file's own and below.
        packages: folders of ROS packages by name, for `<include ros_pkg="...">`.

    Raises:
        InputError: a value names no folder.
    """

    trees: Sequence[str | Path] = ()
    include_root: str | Path | None = None
    packages: Mapping[str, str | Path] = field(default_factory=dict)

    __repr__ = brief_repr

    def __post_init__(self) -> None:
        if isinstance(self.trees, str | Path) or not isinstance(self.trees, Sequence):
            raise InputError(f"trees: expected a list of folders, got {self.trees!r:.80}")
        if not isinstance(self.packages, Mapping):
            raise InputError(
                "packages: expected folders by the name of a ROS package, such as "
                f"{{'robot': 'src/robot'}}, got {self.packages!r:.80}"
            )
        root = self.include_root
        packages = {name: _path(f"packages['{name}']", one) for name, one in self.packages.items()}
        for name, value in {  # as the class is frozen for all others
            "trees": tuple(_path("trees", folder) for folder in self.trees),
            "include_root": None if root is None else _path("include_root", root),
            "packages": packages,
        }.items():
            object.__setattr__(self, name, value)

    def lookup(self) -> Lookup:
        """Read the trees of the folders, and return where to look for what files do not hold."""
        files = [file for folder in self.trees for file in files_in(_folder(folder))]
        root = None if self.include_root is None else _folder(self.include_root)
        packages = {name: _folder(path) for name, path in self.packages.items()}
        return Lookup(Library(files), root, packages)

    def to_json(self) -> dict[str, Any]:
        """Return the fields as plain JSON values that make the class again in any folder."""
        root = self.include_root
        return {
            "trees": [str(Path(folder).absolute()) for folder in self.trees],
            "include_root": None if root is None else str(Path(root).absolute()),
            "packages": {name: str(Path(one).absolute()) for name, one in self.packages.items()},
        }


def _packages(texts: Iterable[str]) -> dict[str, Path]:
    found = pairs(texts, "package", "NAME=DIR, a folder that exists")
    return {name: Path(folder or "?") for name, folder in found.items()}


def _folders(
    *,
    libraries: Annotated[
        tuple[Path, ...],
        Option(
            "Look for trees that a file does not hold in the files of this folder. Repeatable.",
            "--trees DIR",
            "Mission",
        ),
    ] = (),
    include_root: Annotated[
        Path | None,
        Option(
            "Files may be included from this folder and below, not only from beside the file.",
            "DIR",
            "Mission",
        ),
    ] = None,
    packages: Annotated[
        Mapping[str, Path],
        Option(
            'The folder of a ROS package, for <include ros_pkg="NAME"/>. Repeatable.',
            "--ros-pkg NAME=DIR",
            "Mission",
            read=_packages,
        ),
    ] = MappingProxyType({}),
) -> TreeFolders:
    return TreeFolders(trees=libraries, include_root=include_root, packages=packages)


Folders = Annotated[
    TreeFolders,
    Option(
        "Folders of trees and included files that the tree file does not hold.",
        "",
        "Mission",
        parts=_folders,
    ),
]


def _path(name: str, value: object) -> Path:
    if not isinstance(value, str | Path) or not str(value):
        raise InputError(f"{name}: expected a folder, as str or Path, got {value!r:.80}")
    return Path(value)


def _folder(path: str | Path) -> Path:
    if not Path(path).is_dir():
        raise FileError(path, "no such folder to look for tree files in")
    return Path(path)


class Includes:
    """Reads included files, each once; the folder of the main file bounds what may be included."""

    def __init__(self, main: Path, lookup: Lookup) -> None:
        self._main = main.resolve()
        self._packages = lookup.packages
        root = lookup.include_root
        self._folders = [
            *([self._main.parent] if main.is_file() else []),
            *([] if root is None else [root.resolve()]),
            *(folder.resolve() for folder in self._packages.values()),
        ]
        self.sources: dict[Path, bytes] = {}  # texts of the included files
        self._after: dict[Path, list[tuple[Element, Path]]] = {}  # what each file includes

    def read(self, include: Element, findings: Findings) -> list[Element]:
        """Return the root of the included file; nothing when it was read before or is refused."""
        try:
            target = self._target(include)
        except InputError as error:
            findings.note(include, str(error), "path", rule=Rule.INCLUDE, label="include")
            return []
        self._after.setdefault(include.path.resolve(), []).append((include, target))
        if target == self._main or target in self.sources:
            return []
        self.sources[target] = read_source(target)
        return [parse_source(self.sources[target], target)]

    def _target(self, include: Element) -> Path:
        """Return the file that an include names, or raise an InputError."""
        package, name = include.attributes.get("ros_pkg"), include.attributes.get("path", "")
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
        where = f"{self._folders[0]}: allow it with --include-root DIR"
        return file_in(start, name, self._folders, where)

    def note_circles(self, findings: Findings) -> None:
        """Note files that include each other in a circle, of which the engine finds no end."""
        for include, files in circles([self._main], lambda path: self._after.get(path, ())):
            message = (
                f"the files include each other in a circle, {' > '.join(p.name for p in files)}: "
                "take one of these includes out"
            )
            findings.note(include, message, "path", rule=Rule.INCLUDE)
