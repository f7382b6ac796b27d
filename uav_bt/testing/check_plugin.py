"""The part of the pytest plug-in that collects tree files as tests that check them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest

from uav_bt.tree import NodeRegistry
from uav_bt.tree.loading.findings import errors_of
from uav_bt.tree.loading.loader import FilesTogether
from uav_bt.tree.loading.lookup import Library, Lookup

_HEAD_BYTES: Final = 20_000  # a long comment may come before the root element; chosen


class CheckPlugin:
    """Collects tree files. The collected files use each other's trees."""

    def __init__(self) -> None:
        self._files: list[Path] = []

    def pytest_collect_file(
        self, file_path: Path, parent: pytest.Collector
    ) -> pytest.Collector | None:
        """Collect an XML file that is marked as a tree file, also a damaged one."""
        if file_path.suffix != ".xml":
            return None
        with file_path.open("rb") as file:
            if b"BTCPP_format" not in file.read(_HEAD_BYTES):
                return None
        self._files.append(file_path)
        return _TreeFile.from_parent(parent, path=file_path)

    def pytest_collection_finish(self, session: pytest.Session) -> None:
        """Read all collected files."""
        if self._files:
            lookup = Lookup(Library(self._files))
            files, registry = map(_short, self._files), NodeRegistry.installed()
            session.config.stash[_TOGETHER] = FilesTogether(files, registry, lookup=lookup)


_TOGETHER: Final[pytest.StashKey[FilesTogether]] = pytest.StashKey()


def _short(path: Path) -> Path:
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path


class _TreeFile(pytest.File):
    def collect(self) -> Iterator[pytest.Item]:
        yield _TreeCheck.from_parent(self, name="check")


class _TreeCheck(pytest.Item):
    def runtest(self) -> None:
        findings = self.config.stash[_TOGETHER].findings(_short(self.path))
        if errors_of(findings):
            pytest.fail("\n".join(map(str, findings)), pytrace=False)

    def reportinfo(self) -> tuple[Path, int, str]:
        return self.path, 0, f"tree file {self.path.name}"
