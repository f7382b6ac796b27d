"""A table of a report: plain values, shown in the page and written as CSV."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass, replace


@dataclass(frozen=True, kw_only=True)
class Link:
    """A cell that leads to a file."""

    text: str
    target: str  # relative to the page


@dataclass(frozen=True, kw_only=True)
class Term:
    """A cell that programs know by another name."""

    text: str  # on the page
    key: str  # in the CSV file


Cell = str | int | float | Link | Term | None


@dataclass(frozen=True, kw_only=True)
class Table:
    """A table of the report."""

    name: str  # of its CSV file
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""  # a sentence above it
    code: frozenset[str] = frozenset()  # columns that hold something to type

    def to_csv(self) -> str:
        """Return the table as CSV (RFC 4180, a header line)."""
        out = io.StringIO()
        writer = csv.writer(out)
        writer.writerow(self.columns)
        for row in self.rows:
            writer.writerow([_plain(cell) for cell in row])
        return out.getvalue()

    def filled(self) -> Table:
        """Return the table without the columns in which no row has a value."""
        kept = [
            index
            for index in range(len(self.columns))
            if any(row[index] not in (None, "") for row in self.rows)
        ]
        return replace(
            self,
            columns=tuple(self.columns[index] for index in kept),
            rows=tuple(tuple(row[index] for index in kept) for row in self.rows),
        )


def _plain(cell: Cell) -> str | int | float | None:
    match cell:
        case Link():
            return cell.target
        case Term():
            return cell.key
        case _:
            return cell
