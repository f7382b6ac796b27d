"""Report of campaigns: a self-contained page, with its figures and tables as files beside it."""

from __future__ import annotations

import datetime as dt
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from sim_bridge.twin.scene_file import load_scene
from uav_bt import __version__
from uav_bt.app.film import map_of_scene
from uav_bt.campaign.report.coverage_figure import coverage_over_time
from uav_bt.campaign.report.figures import Form, densities, drawn, outcomes
from uav_bt.campaign.report.html import Image, Section, page
from uav_bt.campaign.report.lab_figures import scene_figure
from uav_bt.campaign.report.map_table import map_table
from uav_bt.campaign.report.origin import origin_table
from uav_bt.campaign.report.paired import paired_table, pairs_of
from uav_bt.campaign.report.paper import paper_success
from uav_bt.campaign.report.sources import Sources, read_sources
from uav_bt.campaign.report.table import Table
from uav_bt.campaign.report.tables import tables_of
from uav_bt.campaign.store import FLIGHTS_FILE
from uav_bt.display.lab_map import LabMap
from uav_bt.errors import InputError
from uav_bt.files import write_whole, writing
from uav_bt.mission.covered_ground import PASSED_M, SEEN_M
from uav_bt.mission.flight_report import EXPLORE_S

_ABOUT_SCENES: Final = (
    "Left: the true path of every flight. A dot is its start, a cross its failure. Right: the "
    "share of the flights that covered each place. Axes are those of the scene file. The number "
    "in a box is its height in metres, the arrow the take-off heading, a dotted line the path of "
    "a mover."
)

_ABOUT_COVERAGE: Final = (
    f"Covered: the free ground within {PASSED_M:g} m of the flown path. Seen: the ground in view, "
    f"not hidden, within {SEEN_M:g} m of the lens. A thin line is a flight, from its first sample "
    "to its end, which has a dot. A thick line is the mean of a tree's flights, as long as half of "
    f"them last. The dotted line marks {EXPLORE_S:.0f} s."
)


@dataclass(frozen=True, kw_only=True)
class WrittenReport:
    """The files of a report.

    Attributes:
        page: The HTML page.
        images: Its figures, in the folder `STEM-figures` beside it.
        tables: Its tables as CSV, beside it.
    """

    page: Path
    images: tuple[Path, ...]
    tables: tuple[Path, ...]


def write_report(
    paths: Sequence[Path],
    out: Path | None = None,
    *,
    figures: Form | None = "png",
    all_pairs: bool = False,
    today: dt.date | None = None,
    on_note: Callable[[str], None] = lambda _: None,
) -> WrittenReport:
    """Write the report of campaigns.

    Args:
        paths: Folders of campaigns, or files with one flight per line.
        out: The page. None: `default_page`.
        figures: Form of the files of figures. None: no files. The page has PNGs in any case.
        all_pairs: Compare all trees with each other, not only the first with each other one.
        today: Date of the report. None: today, UTC.
        on_note: Called with each note on the flights.

    Raises:
        FileError: There are no flights, or a file cannot be read or written.
    """
    sources = read_sources(paths)
    for note in sources.notes:
        on_note(note)
    return write_campaign_report(
        sources,
        out or default_page(paths),
        maps=_maps(sources, on_note),
        figures=figures,
        all_pairs=all_pairs,
        today=today or dt.datetime.now(dt.UTC).date(),
    )


def default_page(paths: Sequence[Path]) -> Path:
    """Return where a report goes by default: into the first folder or beside the first file."""
    first = paths[0]
    in_folder = first.is_dir() or first.name == FLIGHTS_FILE
    folder = first if first.is_dir() else first.parent
    return folder / ("report.html" if in_folder else f"{first.stem}.html")


def _maps(sources: Sources, on_note: Callable[[str], None]) -> dict[str, LabMap]:
    """Return the maps of the scenes that can still be read."""
    maps: dict[str, LabMap] = {}
    for one in sources.sets:
        for scene in sources.scenes:
            if scene in maps or not any(f["scene"] == scene for f in one.flights):
                continue
            try:
                maps[scene] = map_of_scene(load_scene(one.scene_path(scene)))
            except InputError as error:
                on_note(f"no map of scene '{scene}': {error}")
    return maps


def write_campaign_report(
    sources: Sources,
    out: Path,
    *,
    maps: Mapping[str, LabMap],
    figures: Form | None = "png",
    all_pairs: bool = False,
    today: dt.date,
) -> WrittenReport:
    """Write a report: the page, and beside it its figures and its tables (CSV).

    Args:
        sources: The flights.
        out: The page. The names of the other files begin with its stem.
        maps: The map of each scene, by the scene's name. A scene without a map gets no figure.
        figures: Form of the files of figures. None: no files.
        all_pairs: Compare all trees with each other, not only the first with each other one.
        today: Date of the report.

    Raises:
        FileError: A file cannot be written.
    """
    tables = {
        **tables_of(sources, out),
        "map": map_table(sources.sets),
        "pairs": paired_table(pairs_of(sources.sets, all_pairs=all_pairs)),
    }
    images = _images(sources)
    scenes = _scene_images(sources, maps)
    text = page(
        _title(sources),
        f"{_extent(sources)}, {today.isoformat()}, uav-bt {__version__}",
        _sections(sources, tables, images, scenes),
    )
    _write(out, text.encode("utf-8"))
    return WrittenReport(
        page=out,
        images=_written_figures(out, (*images.values(), *scenes), figures),
        tables=tuple(
            _write(out.with_name(f"{out.stem}-{one.name}.csv"), one.to_csv().encode("utf-8"))
            for one in tables.values()
        ),
    )


def _written_figures(
    page_file: Path, images: Sequence[Image], form: Form | None
) -> tuple[Path, ...]:
    if form is None:
        return ()
    folder = page_file.with_name(f"{page_file.stem}-figures")
    with writing(folder):
        folder.mkdir(exist_ok=True)
    names = [re.sub(r"[^\w.-]+", "_", one.name) for one in images]  # a scene may have any name
    return tuple(
        _write(folder / f"{name}.{form}", drawn(one.figure, form))
        for name, one in zip(names, images, strict=True)
    )


def _title(sources: Sources) -> str:
    return "Flights of " + ", ".join(one.label for one in sources.sets)


def _extent(sources: Sources) -> str:
    count = sum(len(one.flights) for one in sources.sets)
    flights = "1 flight" if count == 1 else f"{count} flights"
    return f"{flights} in {', '.join(sources.scenes)}" if sources.scenes else flights


def _sections(
    sources: Sources,
    tables: Mapping[str, Table],
    images: Mapping[str, Image],
    scenes: tuple[Image, ...],
) -> list[Section]:
    sections = []
    if sources.notes:
        sections.append(Section(title="Please note", paragraphs=sources.notes, warning=True))
    published = paper_success(one.tree for one in sources.sets)
    sections += [
        Section(
            title="Outcomes",
            paragraphs=() if published is None else (published,),
            images=(images["outcomes"],),
            tables=(tables["outcomes"], tables["scenes"]),
        ),
    ]
    if tables["pairs"].rows:
        sections.append(Section(title=tables["pairs"].title, tables=(tables["pairs"],)))
    if tables["metrics"].rows:
        numbers = (images["densities"],) if "densities" in images else ()
        sections.append(
            Section(title="Times and distances", images=numbers, tables=(tables["metrics"],))
        )
    if tables["rates"].rows:
        sections.append(Section(title=tables["rates"].title, tables=(tables["rates"],)))
    if "coverage" in images:
        sections.append(
            Section(
                title="Coverage over time",
                paragraphs=(_ABOUT_COVERAGE,),
                images=(images["coverage"],),
            )
        )
    if tables["map"].rows:
        sections.append(Section(title="The mission's map", tables=(tables["map"],)))
    if scenes:
        sections.append(
            Section(
                title="Paths and coverage",
                paragraphs=(_ABOUT_SCENES,),
                images=scenes,
            )
        )
    failures = tables["failures"]
    if failures.rows:
        sections.append(Section(title="Every failure", tables=(failures,)))
    else:
        sections.append(Section(title="Every failure", paragraphs=("No flight failed.",)))
    if tables["timings"].rows:
        sections.append(Section(title="Computing", tables=(tables["timings"],)))
    sections.append(
        Section(
            title="Where this comes from",
            tables=tuple(origin_table(one) for one in sources.provenance),
        )
    )
    return sections


def _images(sources: Sources) -> dict[str, Image]:
    """Return the figures of all flights by name, without those that would be empty."""
    figures = (
        (
            "outcomes",
            outcomes(sources.sets),
            "share of successful flights of each tree with its 95 % interval",
        ),
        (
            "densities",
            densities(sources.sets),
            "distributions of times and distances of the flights",
        ),
        (
            "coverage",
            coverage_over_time(sources.sets),
            "shares of the free ground that flights have covered and seen, over time",
        ),
    )
    return {
        name: Image(name=name, figure=figure, alt=alt)
        for name, figure, alt in figures
        if figure is not None
    }


def _scene_images(sources: Sources, maps: Mapping[str, LabMap]) -> tuple[Image, ...]:
    images = []
    for scene in sources.scenes:
        figure = scene_figure(sources.sets, scene, maps[scene]) if scene in maps else None
        if figure is not None:
            alt = f"flown paths and coverage of the ground in the scene {scene}"
            images.append(
                Image(name=f"scene-{scene}", figure=figure, alt=alt, title=f"Scene {scene}")
            )
    return tuple(images)


def _write(path: Path, content: bytes) -> Path:
    write_whole(path, content)
    return path
