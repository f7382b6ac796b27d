"""A page of its own: style and pictures inside, nothing from elsewhere, every text escaped."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import Final
from urllib.parse import quote

from uav_bt.campaign.report.tables import Cell, Link, Table

__all__ = ["Picture", "Section", "page"]

_STYLE: Final = """
:root { color: #212529; background: #f4f5f7; font: 15px/1.5 system-ui, sans-serif; }
body { margin: 0 auto; padding: 2rem 1.5rem 4rem; max-width: 76rem; }
h1 { font-size: 1.7rem; margin: 0 0 .3rem; }
h2 { font-size: 1.2rem; margin: 0 0 .8rem; }
h3 { font-size: 1rem; margin: 1.4rem 0 .4rem; }
section { background: #fff; border: 1px solid #dee2e6; border-radius: 8px;
  margin: 1.2rem 0; padding: 1.2rem 1.4rem; }
p { margin: .3rem 0 .8rem; max-width: 60rem; }
.lead, .note, figcaption { color: #5c636a; }
figure { margin: .6rem 0; }
img { max-width: 100%; height: auto; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .88rem; }
th { text-align: left; border-bottom: 2px solid #ced4da; white-space: nowrap; }
th, td { padding: .28rem .8rem .28rem 0; vertical-align: top; }
td { border-bottom: 1px solid #e9ecef; }
td.number, th.number { text-align: right; }
code { font: .82rem/1.4 ui-monospace, monospace; background: #f1f3f5; border-radius: 3px;
  padding: .05rem .3rem; white-space: pre-wrap; overflow-wrap: anywhere; }
.warning { border-left: 4px solid #e67700; }
"""


@dataclass(frozen=True, kw_only=True)
class Picture:
    """A PNG of the report."""

    name: str  # of its file
    png: bytes
    alt: str  # what it shows, for those who do not see it


@dataclass(frozen=True, kw_only=True)
class Section:
    """A part of the page: paragraphs, then pictures, then tables, as far as there are any."""

    title: str
    paragraphs: tuple[str, ...] = ()
    pictures: tuple[Picture, ...] = ()
    tables: tuple[Table, ...] = ()
    warning: bool = False  # something to look at before all else


def page(title: str, lead: str, sections: Sequence[Section]) -> str:
    """Return a whole HTML page."""
    body = "\n".join(_section(section) for section in sections)
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n<body>\n"
        f'<h1>{escape(title)}</h1>\n<p class="lead">{escape(lead)}</p>\n{body}\n</body>\n</html>\n'
    )


def _section(section: Section) -> str:
    parts = [f"<h2>{escape(section.title)}</h2>"]
    parts += [f"<p>{escape(text)}</p>" for text in section.paragraphs]
    parts += [_picture(picture) for picture in section.pictures]
    for table in section.tables:
        if table.title != section.title:
            parts.append(f"<h3>{escape(table.title)}</h3>")
        parts.append(_table(table))
    kind = ' class="warning"' if section.warning else ""
    return f"<section{kind}>\n" + "\n".join(parts) + "\n</section>"


def _picture(picture: Picture) -> str:
    data = base64.b64encode(picture.png).decode("ascii")
    return f'<figure><img src="data:image/png;base64,{data}" alt="{escape(picture.alt)}"></figure>'


def _table(table: Table) -> str:
    numeric = [
        bool(table.rows) and all(isinstance(row[i], (int, float, type(None))) for row in table.rows)
        for i in range(len(table.columns))
    ]
    head = "".join(
        f"<th{_kind(number)}>{escape(column)}</th>"
        for column, number in zip(table.columns, numeric, strict=True)
    )
    rows = "\n".join(
        "<tr>"
        + "".join(
            f"<td{_kind(number)}>{_cell(cell, code=column in table.code)}</td>"
            for column, cell, number in zip(table.columns, row, numeric, strict=True)
        )
        + "</tr>"
        for row in table.rows
    )
    note = f'<p class="note">{escape(table.note)}</p>\n' if table.note else ""
    return f'{note}<div class="wide"><table>\n<tr>{head}</tr>\n{rows}\n</table></div>'


def _kind(number: bool) -> str:  # noqa: FBT001 - private
    return ' class="number"' if number else ""


def _cell(cell: Cell, *, code: bool) -> str:
    if cell is None:
        return ""
    if isinstance(cell, Link):
        return f'<a href="{escape(quote(cell.target))}">{escape(cell.text)}</a>'
    text = f"{cell:g}" if isinstance(cell, float) and abs(cell) < 1e5 else str(cell)
    return f"<code>{escape(text)}</code>" if code else escape(text)
