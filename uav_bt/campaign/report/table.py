"""A table of a report: plain values, shown in the page and written as CSV."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass, replace


@dataclass(frozen=True, kw_only=True)
class Link:
    """A cell with a link to a file.

    Attributes:
        text: Text on the page; the CSV file has the target.
        target: Path of the file relative to the page.
    """

    text: str
    target: str


@dataclass(frozen=True, kw_only=True)
class Term:
    """A cell with different texts for readers and for programs.

    Attributes:
        text: Text on the page.
        key: Text in the CSV file.
    """

    text: str
    key: str


Cell = str | int | float | Link | Term | None


@dataclass(frozen=True, kw_only=True)
class Table:
    """A table of the report.

    Attributes:
        name: Name of its CSV file, without the report's stem and the suffix.
        title: Heading.
        columns: Headings of the columns.
        rows: Cells by row.
        note: Text above the table.
        code: Headings of the columns that are set as code.
    """

    name: str
    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]
    note: str = ""
    code: frozenset[str] = frozenset()

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
