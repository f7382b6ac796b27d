"""Report of campaigns: a self-contained page, with figures and tables beside it."""

from __future__ import annotations

import base64
import datetime as dt
import re
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, Final, NamedTuple

import matplotlib as mpl
from jinja2 import Environment, StrictUndefined
from matplotlib.figure import Figure

from sim_bridge.twin.scene_file import load_scene
from uav_bt import __version__
from uav_bt.campaign.report import figures as plots
from uav_bt.campaign.report.paired import paired_table, pairs_of
from uav_bt.campaign.report.sources import FlightSet, read_sources
from uav_bt.campaign.report.tables import Table, origin_table, tables_of
from uav_bt.campaign.store import METRICS
from uav_bt.errors import InputError
from uav_bt.files import write_whole, writing
from uav_bt.mission.covered_ground import PASSED_M, SEEN_M
from uav_bt.mission.flight_report import EXPLORE_S

_ABOUT_DISTRIBUTIONS: Final = "The share of a tree's flights with at most a value."
_ABOUT_COVERAGE: Final = (
    f"Covered: the free ground within {PASSED_M:g} m of the path. Seen: in view, not hidden, "
    f"within {SEEN_M:g} m of the lens. A thin line is a flight, its end a dot. A thick line is "
    f"the mean while half of them last. The dotted line marks {EXPLORE_S:.0f} s."
)
_ABOUT_SCENES: Final = (
    "Left: true paths. A dot is a start, a cross a failure. Right: the share of the flights "
    "that covered each place. Axes are those of the scene file. In a box stands its height, m. "
    "The arrow is the take-off heading, a dotted line a mover's path."
)

_PAGE: Final = """\
<!DOCTYPE html>
<html lang="en">
<meta charset="utf-8">
<title>{{ title }}</title>
<style>
body { color: #212529; font: 15px/1.5 system-ui, sans-serif; margin: 2rem auto; max-width: 76rem; }
div { overflow-x: auto; }
img { max-width: 100%; }
table { border-collapse: collapse; font-size: .88rem; font-variant-numeric: tabular-nums; }
th, td { border-bottom: 1px solid #dee2e6; padding: .28rem .8rem .28rem 0; text-align: left; }
code { white-space: pre-wrap; }
</style>
<h1>{{ title }}</h1>
<p>{{ lead }}</p>
{% for part in parts %}
<h2>{{ part.title }}</h2>
<p>{{ part.note }}</p>
{% if part.png is defined %}
<img src="data:image/png;base64,{{ part.png }}" alt="{{ part.title }}: {{ part.note }}">
{% else %}
<div><table>
<tr>{% for column in part.columns %}<th>{{ column }}</th>{% endfor %}</tr>
{% for row in part.rows %}
<tr>{% for column, cell in zip(part.columns, row) %}<td>
{%- if column == "record" and cell %}<a href="{{ cell|urlencode }}">record</a>
{% elif column == "command to repeat" %}<code>{{ cell }}</code>
{% elif column in ("metric", "measure") and cell in metrics %}{{ metrics[cell].words }}
{% else %}{{ cell }}{% endif %}</td>{% endfor %}</tr>
{% endfor %}
</table></div>
{% endif %}
{% endfor %}
</html>
"""


class Drawing(NamedTuple):
    """A figure of the report."""

    name: str  # of its file, without the suffix
    title: str
    note: str
    png: str  # for the page, in base 64
    image: bytes  # content of its file


class WrittenReport(NamedTuple):
    """The files of a report."""

    page: Path
    images: list[Path]  # in the folder `STEM-figures` beside the page
    tables: list[Path]  # CSV, beside the page


def write_report(
    paths: Sequence[Path],
    out: Path | None = None,
    *,
    figures: plots.Form | None = "png",
    all_pairs: bool = False,
    on_note: Callable[[str], None] = lambda _: None,
) -> WrittenReport:
    """Write the report of campaigns.

    Args:
        paths: Folders of campaigns, or files with one flight per line.
        out: The page. None: `report.html` in the first folder, or beside the first file, with its
            name.
        figures: Form of the figures' files. None: no files. The page has PNGs in any case.
        all_pairs: Compare all trees with each other, not only with the first.
        on_note: Called with each note on the flights.

    Raises:
        FileError: There are no flights, or a file cannot be read or written.
    """
    sets = read_sources(paths)
    first = paths[0]
    out = out or (first / "report.html" if first.is_dir() else first.with_suffix(".html"))
    tables = tables_of(sets, out)
    tables["pairs"] = paired_table(pairs_of(sets, all_pairs=all_pairs))
    notes = list(dict.fromkeys(one.note for one in sets if one.note))
    scenes = {flight["scene"] or "" for one in sets for flight in one.flights}
    families, boxes = plots.fonts_for("".join((*(one.label for one in sets), *scenes)))
    if boxes:
        notes.append(
            f"figures show boxes for {' '.join(boxes)}: no installed font has them; install one, "
            "such as Debian's fonts-noto-cjk or fonts-noto-core"
        )
    with mpl.rc_context({**plots.STYLE, "font.family": families}):
        drawings = list(_drawings(sets, notes, figures or "png"))
    for note in notes:
        on_note(note)
    write_whole(out, _page(sets, tables, drawings, notes))
    written = WrittenReport(out, [], [])
    for name, table in tables.items():
        written.tables.append(out.with_name(f"{out.stem}-{name}.csv"))
        write_whole(written.tables[-1], table.to_csv())
    if figures is None:
        return written
    folder = out.with_name(f"{out.stem}-figures")
    with writing(folder):
        folder.mkdir(exist_ok=True)
    for each in drawings:
        stem = re.sub(r"[^\w.-]+", "_", each.name)  # a scene may have any name
        written.images.append(folder / f"{stem}.{figures}")
        write_whole(written.images[-1], each.image)
    return written


def _drawings(sets: Sequence[FlightSet], notes: list[str], form: plots.Form) -> Iterator[Drawing]:
    """Yield the figures that are not empty, and note the scenes that cannot be read any more."""
    found: list[tuple[str, str, str, Figure | None]] = [
        ("distributions", "Distributions", _ABOUT_DISTRIBUTIONS, plots.distributions(sets)),
        ("coverage", "Coverage over time", _ABOUT_COVERAGE, plots.coverage_over_time(sets)),
    ]
    files = {
        flight["scene"]: one.scene_path(flight["scene"])
        for one in reversed(sets)
        for flight in one.flights
        if flight["scene"] is not None
    }
    for name, file in sorted(files.items()):
        try:
            figure = plots.scene_figure(sets, name, load_scene(file))
        except InputError as error:
            notes.append(f"no map of scene '{name}': {error}")
        else:
            found.append((f"scene-{name}", f"Scene {name}", _ABOUT_SCENES, figure))
    for name, title, note, drawn in found:
        if drawn is not None:
            png = plots.drawn(drawn, "png")
            image = png if form == "png" else plots.drawn(drawn, form)
            yield Drawing(name, title, note, base64.b64encode(png).decode(), image)


def _page(
    sets: Sequence[FlightSet],
    tables: dict[str, Table],
    drawings: Sequence[Drawing],
    notes: Sequence[str],
) -> str:
    """Return the page: notes first, each figure before the tables of its values."""
    drawn_as = {each.name: each for each in drawings}
    scenes = [each for each in drawings if each.name.startswith("scene-")]
    parts: list[Any] = [
        Table("notes", "Please note", ("note",), [(note,) for note in notes]),
        *(tables["outcomes"], tables["scenes"], tables["pairs"]),
        *(drawn_as.get("distributions"), tables["metrics"], tables["rates"]),
        *(drawn_as.get("coverage"), tables["map"], *scenes, tables["failures"], tables["timings"]),
        *map(origin_table, {one.path: one for one in sets}.values()),
    ]
    names = sorted({flight["scene"] for one in sets for flight in one.flights} - {None})
    count = sum(len(one.flights) for one in sets)
    lead = f"{count} flight{'' if count == 1 else 's'}{' in ' if names else ''}{', '.join(names)}"
    environment = Environment(
        autoescape=True, undefined=StrictUndefined, trim_blocks=True, finalize=_finalize
    )
    return environment.from_string(_PAGE).render(
        title="Flights of " + ", ".join(one.label for one in sets),
        lead=f"{lead}, {dt.datetime.now(dt.UTC):%F}, uav-bt {__version__}",
        metrics=METRICS,
        zip=zip,
        parts=[part for part in parts if part and (not isinstance(part, Table) or part.rows)],
    )


def _finalize(value: object) -> object:
    is_short = isinstance(value, float) and abs(value) < 1e5
    return "" if value is None else f"{value:g}" if is_short else value
