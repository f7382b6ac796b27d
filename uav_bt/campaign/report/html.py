"""Self-contained HTML page: style and images are inside, and every text is escaped."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from jinja2 import Environment, StrictUndefined
from matplotlib.figure import Figure

from uav_bt.campaign.report.figures import drawn
from uav_bt.campaign.report.table import Cell, Link, Table, Term

_PAGE: Final = """\
<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{{ title }}</title>
<style>
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
</style>
</head>
<body>
<h1>{{ title }}</h1>
<p class="lead">{{ lead }}</p>
{% for section in sections %}
<section{{ ' class="warning"'|safe if section.warning }}>
<h2>{{ section.title }}</h2>
{% for text in section.paragraphs %}
<p>{{ text }}</p>
{% endfor %}
{% for image in section.images %}
{% if image.title %}
<h3>{{ image.title }}</h3>
{% endif %}
<figure><img src="data:image/png;base64,{{ image.figure|png }}" alt="{{ image.alt }}"></figure>
{% endfor %}
{% for table in section.tables|map("filled") if table.rows %}
{% if table.title != section.title %}
<h3>{{ table.title }}</h3>
{% endif %}
{% if table.note %}
<p class="note">{{ table.note }}</p>
{% endif %}
{% set numeric = table|numeric %}
<div class="wide"><table>
<tr>
{%- for column in table.columns -%}
<th{{ ' class="number"'|safe if numeric[loop.index0] }}>{{ column }}</th>
{%- endfor -%}
</tr>
{% for row in table.rows %}
<tr>
{%- for cell in row -%}
<td{{ ' class="number"'|safe if numeric[loop.index0] }}>
{%- if cell is link -%}
<a href="{{ cell.target|urlencode }}">{{ cell.text }}</a>
{%- elif cell is not none and table.columns[loop.index0] in table.code -%}
<code>{{ cell|text }}</code>
{%- else -%}
{{ cell|text }}
{%- endif -%}
</td>
{%- endfor -%}
</tr>
{% endfor %}
</table></div>
{% endfor %}
</section>
{% endfor %}
</body>
</html>
"""


@dataclass(frozen=True, kw_only=True)
class Image:
    """A figure of the report.

    Attributes:
        name: Name of its file, without the suffix.
        figure: The figure.
        alt: Description for readers who do not see it.
        title: Heading above it.
    """

    name: str
    figure: Figure
    alt: str
    title: str = ""


@dataclass(frozen=True, kw_only=True)
class Section:
    """A part of the page: paragraphs, then images, then tables.

    Attributes:
        title: Heading.
        paragraphs: Texts.
        images: Figures.
        tables: Tables. Empty tables are left out.
        warning: Whether the section is marked as a warning.
    """

    title: str
    paragraphs: tuple[str, ...] = ()
    images: tuple[Image, ...] = ()
    tables: tuple[Table, ...] = ()
    warning: bool = False


def page(title: str, lead: str, sections: Sequence[Section]) -> str:
    """Return a whole HTML page.

    Args:
        title: Title of the page.
        lead: Line below the title.
        sections: Sections in their order.
    """
    environment = Environment(
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {
        "png": _png,
        "numeric": _numeric,
        "text": _text,
        "filled": Table.filled,
    }
    environment.tests["link"] = lambda cell: isinstance(cell, Link)
    return environment.from_string(_PAGE).render(title=title, lead=lead, sections=sections)


def _png(figure: Figure) -> str:
    """Return a figure as PNG in base 64."""
    return base64.b64encode(drawn(figure, "png")).decode("ascii")


def _numeric(table: Table) -> list[bool]:
    """Return which columns hold numbers only."""
    return [
        bool(table.rows) and all(isinstance(row[i], (int, float, type(None))) for row in table.rows)
        for i in range(len(table.columns))
    ]


def _text(cell: Cell) -> str:
    if cell is None:
        return ""
    if isinstance(cell, Term):
        return cell.text
    return f"{cell:g}" if isinstance(cell, float) and abs(cell) < 1e5 else str(cell)
