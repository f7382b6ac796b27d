"""A report, composed: it knows our scenes' maps."""

from __future__ import annotations

import datetime as dt
from collections.abc import Callable, Sequence
from pathlib import Path

from sim_bridge.twin.scene_file import load_scene
from uav_bt.app.film import map_of_scene
from uav_bt.campaign.report.campaign_report import WrittenReport, write_campaign_report
from uav_bt.campaign.report.sources import Sources, read_sources
from uav_bt.campaign.store import FLIGHTS_FILE
from uav_bt.display.lab_map import LabMap
from uav_bt.errors import InputError

__all__ = ["default_page", "write_report"]


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
        on_note: told what a person should know of the flights.

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
    """Return where a report goes if nobody says: into the first folder or beside the first file."""
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
