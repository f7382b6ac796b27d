"""What is wrong or odd in a tree file: each finding with its place, all in one report."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final, Protocol

from uav_bt.errors import TreeError
from uav_bt.tree.loading.rules import Rule

MAX_FINDINGS: Final = 500  # more are not read, and each costs the search for a suggestion
ERROR: Final = "error"
WARNING: Final = "warning"


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


class Placed(Protocol):
    """An element of a file, as far as findings need it."""

    path: Path

    @property
    def label(self) -> str:
        """How messages name the element."""

    def at(self, attribute: str) -> Position:
        """Return where an attribute stands, or where the element does when it has none such."""


@dataclass(frozen=True, order=True)
class Finding:
    """One thing that is wrong, or odd."""

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
    """Collects findings; the same one twice counts once."""

    def __init__(self) -> None:
        self._errors: dict[Finding, None] = {}
        self._warnings: dict[Finding, None] = {}  # the first of them; more say no more

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
        """Note a finding.

        Args:
            path: of the file.
            position: in the file.
            message: what is wrong.
            node: the node concerned, as `Tag 'name'`.
            severity: ERROR, or WARNING for what the file is taken with.
            rule: what it is about.

        Raises:
            TreeError: there are too many.
        """
        self._add(Finding(str(path), position, message, node, severity, rule))

    def _add(self, finding: Finding) -> None:
        if finding.severity == WARNING:
            if len(self._warnings) < MAX_FINDINGS:
                self._warnings[finding] = None
            return
        self._errors[finding] = None
        if len(self._errors) >= MAX_FINDINGS:
            more = f"{MAX_FINDINGS} errors are enough: the rest of the file was not checked"
            last = Finding(finding.path, WHOLE_FILE, more)
            raise TreeError(finding.path, [*sorted(self._errors), last])

    def note(
        self, element: Placed, message: str, attribute: str = "", *, rule: Rule = Rule.OTHER
    ) -> None:
        """Note what is wrong with an element.

        Args:
            element: of a tree file.
            message: what is wrong.
            attribute: the attribute concerned; default: the whole element.
            rule: what it is about.

        Raises:
            TreeError: there are too many findings.
        """
        self.add(element.path, element.at(attribute), message, element.label, rule=rule)

    def warn(
        self, element: Placed, message: str, attribute: str = "", *, rule: Rule = Rule.NO_MEANING
    ) -> None:
        """Note what is odd about an element, but no reason to refuse the file.

        Args:
            element: of a tree file.
            message: what is odd.
            attribute: the attribute concerned; default: the whole element.
            rule: what it is about.
        """
        where = element.at(attribute)
        self.add(element.path, where, message, element.label, severity=WARNING, rule=rule)

    def take_as_warnings(self, other: Findings) -> None:
        """Note what was found elsewhere, all of it as warnings."""
        for finding in other:
            self._add(replace(finding, severity=WARNING))

    def __iter__(self) -> Iterator[Finding]:
        """Iterate in the order of the file."""
        return iter(sorted((*self._errors, *self._warnings)))

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self._errors) + len(self._warnings)

    def raise_any(self, path: Path | str) -> None:
        """Raise the errors that were found, all at once.

        Raises:
            TreeError: there were some.
        """
        if self._errors:
            raise TreeError(path, sorted(self._errors))
