"""Collects tree files as tests: each is checked as `uav-bt check` does."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import pytest

from uav_bt.tree.loading.loader import check_file

# The root element with its format stands at the beginning; a long comment may come before.
_HEAD_BYTES: Final = 20_000
_MARK: Final = b"BTCPP_format"


def is_tree_file(path: Path) -> bool:
    """Return whether an XML file is marked as a tree file, be it damaged."""
    with path.open("rb") as file:
        return _MARK in file.read(_HEAD_BYTES)


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
            _RefusedError: there are findings.
        """
        here = Path.cwd()
        path = self.path
        findings = check_file(path.relative_to(here) if path.is_relative_to(here) else path)
        if findings:
            raise _RefusedError("\n".join(map(str, findings)))

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: Any = None) -> Any:
        """Show the findings alone, without a traceback."""
        if isinstance(excinfo.value, _RefusedError):
            return str(excinfo.value)
        return super().repr_failure(excinfo, style)

    def reportinfo(self) -> tuple[Path, int, str]:
        """Return how reports name the test."""
        return self.path, 0, f"tree file {self.path.name}"
