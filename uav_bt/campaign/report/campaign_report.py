"""From flights to a report: one page that stands alone, and its images and tables beside it."""

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
from uav_bt.campaign.report.figures import densities, outcomes
from uav_bt.campaign.report.html import Image, Section, page
from uav_bt.campaign.report.lab_figures import scene_figure
from uav_bt.campaign.report.map_table import map_table
from uav_bt.campaign.report.paper import paper_success
from uav_bt.campaign.report.sources import Provenance, Sources, read_sources
from uav_bt.campaign.report.statistics import PERCENTILE_FLIGHTS
from uav_bt.campaign.report.table import Table
from uav_bt.campaign.report.tables import tables_of
from uav_bt.campaign.store import FLIGHTS_FILE
from uav_bt.display.lab_map import LabMap
from uav_bt.errors import InputError
from uav_bt.files import write_whole
from uav_bt.mission.covered_ground import PASSED_M, SEEN_M

_ABOUT_SCENES: Final = (
    "Left: the true path of every flight. A dot is its start, a cross its failure. Right: the "
    "share of the flights that covered each place. Axes are those of the scene file. The number "
    "in a box is its height in metres, the arrow the take-off heading, a dotted line the path of "
    "a mover."
)

_ABOUT_COVERAGE: Final = (
    f"Passed is the free ground within {PASSED_M:g} m of the flown path, seen is what was in view, "
    f"not hidden, within {SEEN_M:g} m of the lens. The line is the mean of a tree's flights, the "
    f"band their 5th to 95th percentile, from {PERCENTILE_FLIGHTS} flights on. At each time both "
    "count the flights that have not ended."
)


@dataclass(frozen=True, kw_only=True)
class WrittenReport:
    """The files of a report."""

    page: Path
    images: tuple[Path, ...]
    tables: tuple[Path, ...]


def write_report(
    paths: Sequence[Path],
    out: Path | None = None,
    *,
    today: dt.date | None = None,
    on_note: Callable[[str], None] = lambda _: None,
) -> WrittenReport:
    """Write the report of campaigns.

    Args:
        paths: campaigns' folders, or files with a flight a line.
        out: the page; `default_page` when None.
        today: the date that stands in it.
        on_note: called with what a person should know of the flights.

    Raises:
        FileError: there are no flights, or a file cannot be read or written.
    """
    sources = read_sources(paths)
    for note in sources.notes:
        on_note(note)
    return write_campaign_report(
        sources,
        out or default_page(paths),
        maps=_maps(sources, on_note),
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
    sources: Sources, out: Path, *, maps: Mapping[str, LabMap], today: dt.date
) -> WrittenReport:
    """Write a report: the page, and beside it its images (PNG) and tables (CSV).

    Args:
        sources: what it is about.
        out: the page; the other files' names begin with its stem.
        maps: what stands in each scene, by its name; scenes without a map get no image.
        today: the date that stands in it.

    Raises:
        FileError: a file cannot be written.
    """
    tables = {**tables_of(sources, out), "map": map_table(sources.sets)}
    overview, numbers = _outcomes_image(sources), _densities_images(sources)
    covered, scenes = _coverage_image(sources), _scene_images(sources, maps)
    text = page(
        _title(sources),
        f"{_extent(sources)}, {today.isoformat()}, uav-bt {__version__}",
        _sections(sources, tables, (overview, *numbers), covered, scenes),
    )
    images = [overview, *numbers, *([covered] if covered else []), *scenes]
    _write(out, text.encode("utf-8"))
    return WrittenReport(
        page=out,
        images=tuple(_write(_beside(out, one.name, "png"), one.png) for one in images),
        tables=tuple(
            _write(_beside(out, one.name, "csv"), one.to_csv().encode("utf-8"))
            for one in tables.values()
        ),
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
    overview: tuple[Image, ...],
    covered: Image | None,
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
            images=overview[:1],
            tables=(tables["outcomes"], tables["scenes"]),
        ),
    ]
    if tables["metrics"].rows:
        sections.append(
            Section(title="Times and distances", images=overview[1:], tables=(tables["metrics"],))
        )
    if covered is not None:
        sections.append(
            Section(title="Coverage over time", paragraphs=(_ABOUT_COVERAGE,), images=(covered,))
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
        sections.append(Section(title="Every failure", paragraphs=("There was none.",)))
    if tables["timings"].rows:
        sections.append(Section(title="Computing", tables=(tables["timings"],)))
    sections.append(
        Section(
            title="Where this comes from",
            tables=tuple(_origin(one) for one in sources.provenance),
        )
    )
    return sections


def _origin(source: Provenance) -> Table:
    rows: list[tuple[str, str]] = []
    plan = source.plan
    if plan is not None:
        width, height = plan.options.image_size_px
        last = plan.seed_from + plan.flights - 1
        rows += [(f"tree {file.name}", f"SHA-256 {file.sha256}") for file in plan.trees]
        rows += [(f"scene {file.name}", f"SHA-256 {file.sha256}") for file in plan.scenes]
        rows += [(f"weights {name}", f"SHA-256 {digest}") for name, digest in plan.weights.items()]
        rows += [
            ("seeds", f"{plan.seed_from} to {last}"),
            ("profile", plan.options.profile),
            ("images", f"{width}x{height}"),
            *((("movers", str(plan.options.movers)),) if plan.options.movers else ()),
            ("masks", "exact, from the referee" if plan.options.exact_masks else "the network's"),
            *(("policy", f"{node}={name}") for node, name in plan.options.policy_names.items()),
            ("versions", ", ".join(f"{name} {version}" for name, version in plan.versions.items())),
        ]
    rows += [
        (f"run {run.get('began', '')}", f"{run.get('backend', '')}, code {run.get('code', '')}")
        for run in source.runs
    ]
    rows += [
        ("machine", name) for name in dict.fromkeys(r.get("hardware") for r in source.runs) if name
    ]
    if not rows:
        rows.append(("file", "a plain file of flights: nothing more is known"))
    return Table(name="origin", title=str(source.path), columns=("what", "which"), rows=tuple(rows))


def _outcomes_image(sources: Sources) -> Image:
    return Image(
        name="outcomes",
        png=outcomes(sources.sets),
        alt="share of successful flights of each tree with its 95 % interval",
    )


def _densities_images(sources: Sources) -> tuple[Image, ...]:
    png = densities(sources.sets)
    alt = "how times and distances of the flights are distributed"
    return () if png is None else (Image(name="densities", png=png, alt=alt),)


def _coverage_image(sources: Sources) -> Image | None:
    png = coverage_over_time(sources.sets)
    alt = "shares of the free ground that flights have passed and seen, over time"
    return None if png is None else Image(name="coverage", png=png, alt=alt)


def _scene_images(sources: Sources, maps: Mapping[str, LabMap]) -> tuple[Image, ...]:
    images = []
    for scene in sources.scenes:
        png = scene_figure(sources.sets, scene, maps[scene]) if scene in maps else None
        if png is not None:
            alt = f"flown paths and coverage of the carpet in the scene {scene}"
            images.append(Image(name=f"scene-{scene}", png=png, alt=alt, title=f"Scene {scene}"))
    return tuple(images)


def _beside(page_file: Path, name: str, suffix: str) -> Path:
    safe = re.sub(r"[^\w.-]+", "_", name)  # a scene's name may be anything
    return page_file.with_name(f"{page_file.stem}-{safe}.{suffix}")


def _write(path: Path, content: bytes) -> Path:
    write_whole(path, content)
    return path
