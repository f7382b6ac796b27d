"""Folders to look for tree files in, as plain values that plans and records keep."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from uav_bt.brief import brief_repr
from uav_bt.errors import FileError, InputError
from uav_bt.tree.loading.lookup import Library, Lookup, files_in

WHICH_TREE: Final = (
    "Which of the file's trees; default: the one that it names, or that no other uses."
)
"""Description of the option `tree_id` of flights and commands."""


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
        trees = tuple(_path("trees", folder) for folder in self.trees)
        named = {name: _path(f"packages['{name}']", path) for name, path in self.packages.items()}
        object.__setattr__(self, "trees", trees)  # as the class is frozen for all others
        object.__setattr__(self, "packages", named)
        object.__setattr__(
            self, "include_root", None if root is None else _path("include_root", root)
        )

    def lookup(self) -> Lookup:
        """Read the trees of the folders, and return where to look for what files do not hold."""
        files = [file for folder in self.trees for file in files_in(_folder(folder))]
        root = None if self.include_root is None else _folder(self.include_root)
        packages = {name: _folder(path) for name, path in self.packages.items()}
        return Lookup(Library(files), root, packages)

    def absolute(self) -> TreeFolders:
        """Return the same folders, found from any folder."""
        return TreeFolders(**self._each(lambda folder: Path(folder).absolute()))

    def to_json(self) -> dict[str, Any]:
        """Return the fields as plain JSON values, from which the class is made again."""
        return self._each(str)

    def _each(self, change: Callable[[str | Path], str | Path]) -> dict[str, Any]:
        return {
            "trees": [change(folder) for folder in self.trees],
            "include_root": None if self.include_root is None else change(self.include_root),
            "packages": {name: change(folder) for name, folder in self.packages.items()},
        }


def _path(name: str, value: object) -> Path:
    if not isinstance(value, str | Path) or not str(value):
        raise InputError(f"{name}: expected a folder, as str or Path, got {value!r:.80}")
    return Path(value)


def _folder(path: str | Path) -> Path:
    if not Path(path).is_dir():
        raise FileError(path, "no such folder to look for tree files in")
    return Path(path)
