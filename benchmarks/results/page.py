"""The page `docs/results.md`: the words of its template, with figures in them."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from jinja2 import Environment, StrictUndefined

from benchmarks.results.figures import Figures
from uav_bt.files import parse_json

PAGE: Final = Path("docs/results.md")


def page_of(figures: Figures) -> str:
    """Return the page; afterwards `figures` has all that it states."""
    environment = Environment(undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)  # noqa: S701 - Markdown of our own
    environment.filters.update(
        share="{0.value:.0f} of {0.n} ({0.low:.0f} to {0.high:.0f} %)".format,
        value="{0.value:,.{1}f}".format,
        interval="{0.value:.{1}f} ({0.low:.{1}f} to {0.high:.{1}f})".format,
        loads=parse_json,
    )
    words = Path(__file__).with_name("page.md.j2").read_text(encoding="utf-8")
    return environment.from_string(words).render(of=figures, about=figures.results.origin) + "\n"
