"""Findings of a tree file: errors and warnings with their places, all in one report."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Final, Protocol

from uav_bt.errors import TreeError

MAX_FINDINGS: Final = 500  # more are not read, and each costs the search for a suggestion
ERROR: Final = "error"
WARNING: Final = "warning"


class Rule(Enum):
    """Subject of a finding: a name that does not change between versions."""

    FILE = "file"  # A file cannot be read, is not XML, or is larger than a tree file may be.
    ROOT = "root"  # The root element, its format and the tree to be flown.
    INCLUDE = "include"  # Included files are found, and lie where they may.
    TREE_ID = "tree-id"  # Trees have IDs that the engine takes, each its own.
    UNKNOWN_TREE = "unknown-tree"  # A SubTree names one tree that exists and does not contain it.
    UNKNOWN_NODE = "unknown-node"  # A node is of the format, installed, or of a palette.
    CHILDREN = "children"  # A node has as many children, and of the kinds, that it can have.
    ATTRIBUTE = "attribute"  # A node has the attributes that its ports need, with values that fit.
    SCRIPT = "script"  # Scripts and conditions can be parsed and have an effect.
    BOARD_KEY = "board-key"  # Keys of the mission board exist and hold what the port takes.
    VARIABLE = "variable"  # Variables are written before they are read, with types that fit.
    NODE_MODEL = "node-model"  # A TreeNodesModel describes nodes as they are.
    NO_MEANING = "no-meaning"  # Something in the file means nothing to the engine.
    NOT_INSTALLED = "not-installed"  # Policies, networks and files that leaves name are there.
    UNIT = "unit"  # A value is in the unit of its port.
    LIMIT = "limit"  # A value lies beyond what a mission is allowed unless its site says so.
    MISSION = "mission"  # A mission takes off and lands.
    LAB = "lab"  # A mission fits its lab.
    PLACES = "places"  # Files of places are found, and each of their lines is a place.
    OTHER = "tree-file"  # A tree file loads.


@dataclass(frozen=True, order=True)
class Position:
    """A place in a file, both counted from 1."""

    line: int
    column: int

    def __str__(self) -> str:
        """Return `line:column`."""
        return f"{self.line}:{self.column}"


WHOLE_FILE: Final = Position(0, 0)
"""The position of a finding about the file as a whole."""


class Placed(Protocol):
    """An element of a file, as far as findings need it."""

    path: Path

    @property
    def label(self) -> str:
        """How messages name the element."""

    def at(self, attribute: str) -> Position:
        """Return the position of an attribute; without that attribute, of the element."""


@dataclass(frozen=True, order=True)
class Finding:
    """An error or a warning."""

    path: str
    position: Position
    message: str
    node: str = ""  # the node concerned, as `Tag 'name'`
    severity: str = ERROR  # or WARNING: the file is taken all the same
    rule: Rule = field(default=Rule.OTHER, compare=False)

    def __str__(self) -> str:
        """Return the finding as compilers write theirs."""
        where = self.path if self.position == WHOLE_FILE else f"{self.path}:{self.position}"
        parts = [where, "warning" if self.severity == WARNING else "", self.node, self.message]
        return ": ".join(part for part in parts if part)


def errors_of(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return the findings for which a file is refused."""
    return tuple(finding for finding in findings if finding.severity == ERROR)


class Findings:
    """Collects findings; the same one twice counts once. Too many errors raise a TreeError."""

    def __init__(self) -> None:
        # By severity. Warnings are at most MAX_FINDINGS; later ones are dropped.
        self._found: dict[str, dict[Finding, None]] = {ERROR: {}, WARNING: {}}

    def add(
        self,
        path: Path | str,
        position: Position,
        message: str,
        node: str = "",
        *,
        severity: str = ERROR,
        rule: Rule = Rule.OTHER,
    ) -> None:
        """Note a fault at a place of a file."""
        finding = Finding(str(path), position, message, node, severity, rule)
        same = self._found[severity]
        if severity == ERROR or len(same) < MAX_FINDINGS:
            same[finding] = None
        if severity == ERROR and len(same) >= MAX_FINDINGS:
            more = f"{MAX_FINDINGS} errors are enough: the rest of the file was not checked"
            last = Finding(finding.path, WHOLE_FILE, more)
            raise TreeError(finding.path, [*sorted(same), last])

    def note(
        self,
        element: Placed,
        message: str,
        attribute: str = "",
        *,
        rule: Rule = Rule.OTHER,
        label: str | None = None,
        severity: str = ERROR,
    ) -> None:
        """Note a fault of an element, at one of its attributes if it is named."""
        node = element.label if label is None else label
        self.add(element.path, element.at(attribute), message, node, severity=severity, rule=rule)

    def warn(
        self,
        element: Placed,
        message: str,
        attribute: str = "",
        *,
        rule: Rule = Rule.NO_MEANING,
        label: str | None = None,
    ) -> None:
        """Note a fault of an element for which the file is not refused."""
        self.note(element, message, attribute, rule=rule, label=label, severity=WARNING)

    def take_as_warnings(self, other: Findings) -> None:
        """Add the findings of another collection as warnings, but for errors that are noted."""
        for one in (finding for finding in other if finding not in self._found[ERROR]):
            self.add(one.path, one.position, one.message, one.node, severity=WARNING, rule=one.rule)

    def __iter__(self) -> Iterator[Finding]:
        """Iterate in the order of the file."""
        return iter(sorted((*self._found[ERROR], *self._found[WARNING])))

    def raise_any(self, path: Path | str) -> None:
        """Raise the errors, all at once, as a TreeError."""
        if errors := self._found[ERROR]:
            raise TreeError(path, sorted(errors))
