"""What is wrong with a tree file: each finding with its place, all in one report."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from uav_bt.errors import TreeError

if TYPE_CHECKING:
    from uav_bt.tree.loading.source import Element

MAX_FINDINGS: Final = 500  # more are not read, and each costs the search for a suggestion


@dataclass(frozen=True, order=True)
class Position:
    """A place in a file, both counted from 1."""

    line: int
    column: int

    def __str__(self) -> str:
        """Return `line:column`."""
        return f"{self.line}:{self.column}"


WHOLE_FILE: Final = Position(0, 0)
"""The position of what is wrong with a file, but nowhere in it."""


@dataclass(frozen=True, order=True)
class Finding:
    """One thing wrong."""

    path: str
    position: Position
    message: str
    node: str = ""  # the node concerned, as `Tag 'name'`

    def __str__(self) -> str:
        """Return the finding as compilers write theirs."""
        where = self.path if self.position == WHOLE_FILE else f"{self.path}:{self.position}"
        return f"{where}: {self.node}: {self.message}" if self.node else f"{where}: {self.message}"


class Findings:
    """Collects findings; the same one twice counts once."""

    def __init__(self) -> None:
        self._found: dict[Finding, None] = {}

    def add(self, path: Path | str, position: Position, message: str, node: str = "") -> None:
        """Note a finding.

        Args:
            path: of the file.
            position: in the file.
            message: what is wrong.
            node: the node concerned, as `Tag 'name'`.

        Raises:
            TreeError: there are too many.
        """
        self._found[Finding(str(path), position, message, node)] = None
        if len(self._found) >= MAX_FINDINGS:
            more = f"{MAX_FINDINGS} errors are enough: the rest of the file was not checked"
            raise TreeError(path, [*self, Finding(str(path), WHOLE_FILE, more)])

    def note(self, element: Element, message: str, attribute: str = "") -> None:
        """Note what is wrong with an element.

        Args:
            element: of a tree file.
            message: what is wrong.
            attribute: the attribute concerned; default: the whole element.

        Raises:
            TreeError: there are too many findings.
        """
        self.add(element.path, element.at(attribute), message, element.label)

    def __iter__(self) -> Iterator[Finding]:
        """Iterate in the order of the file."""
        return iter(sorted(self._found))

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self._found)

    def raise_any(self, path: Path | str) -> None:
        """Raise what was found, all at once.

        Raises:
            TreeError: something was.
        """
        if self._found:
            raise TreeError(path, list(self))
