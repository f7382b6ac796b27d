"""The part of the pytest plug-in that collects tree files as tests that check them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import pytest

from uav_bt.errors import InputError
from uav_bt.testing.tree_files import is_tree_file
from uav_bt.tree import NodeRegistry
from uav_bt.tree.loading.findings import errors_of
from uav_bt.tree.loading.folders import TreeFolders
from uav_bt.tree.loading.palette import read_palette, with_palette
from uav_bt.tree.loading.together import FilesTogether

_TOGETHER: Final[pytest.StashKey[FilesTogether]] = pytest.StashKey()


class CheckPlugin:
    """Collects tree files. The collected files use each other's trees.

    Args:
        given: paths by option: `folder`, `include_root` and `palette`.
    """

    def __init__(self, given: Mapping[str, Sequence[Path]]) -> None:
        self._given = given
        self._files: list[Path] = []

    def pytest_collect_file(
        self, file_path: Path, parent: pytest.Collector
    ) -> pytest.Collector | None:
        """Collect a tree file as a test."""
        if file_path.suffix != ".xml" or not is_tree_file(file_path):
            return None
        self._files.append(file_path)
        return TreeFile.from_parent(parent, path=file_path)

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        """Let the collected tree files use each other's trees."""
        if not self._files:
            return
        given = self._given
        root = given["include_root"][-1] if given["include_root"] else None
        try:
            registry = NodeRegistry.installed()
            for palette in given["palette"]:
                registry = with_palette(registry, read_palette(palette))
            lookup = TreeFolders(trees=tuple(given["folder"]), include_root=root).lookup()
        except InputError as error:
            raise pytest.UsageError(f"--check-trees: {error}") from error
        lookup = replace(lookup, library=lookup.library.joined_by(self._files))
        together = FilesTogether(map(_short, self._files), registry, lookup=lookup)
        session.config.stash[_TOGETHER] = together


def _short(path: Path) -> Path:
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path


class _RefusedError(Exception):
    """A tree file has findings."""


class TreeFile(pytest.File):
    """A tree file among the test files."""

    def collect(self) -> Iterator[pytest.Item]:
        """Return its only test."""
        yield TreeCheck.from_parent(self, name="check")


class TreeCheck(pytest.Item):
    """The strict check of a tree file."""

    def runtest(self) -> None:
        """Check the file.

        Raises:
            _RefusedError: there are errors.
        """
        findings = self.config.stash[_TOGETHER].findings(_short(self.path))
        if errors_of(findings):
            raise _RefusedError("\n".join(map(str, findings)))

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """Show the findings alone, without a traceback."""
        if isinstance(excinfo.value, _RefusedError):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int, str]:
        """Return how reports name the test."""
        return self.path, 0, f"tree file {self.path.name}"
