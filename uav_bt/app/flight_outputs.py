"""The files that a flight writes: where they lie, that they overwrite no input, and the objects."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping
from dataclasses import asdict, fields
from itertools import combinations
from pathlib import Path
from typing import Final

from uav_bt.app.options import FlightOptions
from uav_bt.board import SITE_MAP
from uav_bt.board.blackboard import Blackboard
from uav_bt.board.context import FlightFolder
from uav_bt.errors import FileError
from uav_bt.files import check_output, write_whole
from uav_bt.inputs import refuse_inputs, same_file
from uav_bt.lab.lab import Lab
from uav_bt.mission.flight_report import FlightReport
from uav_bt.tree import MissionTree
from uav_bt.tree.loading.lookup import shipped_trees
from uav_bt.types import SiteMap
from uav_bt.types.flight_results import FRAME_OF_RESULTS, FoundObject, found_object

REPORT_FILE: Final = "report.json"
OBJECTS_FILES: Final = ("objects.json", "objects.csv")

_FILES_OF_OPTIONS: Final = (
    "scene",
    "camera",
    "site",
    "drone",
    "policies",
    "leaves",
    "params",
)  # that are read


def flight_folder(out: Path | None, outputs: Mapping[str, Path | None]) -> FlightFolder | None:
    """Return the output folder of a flight. None: it has none.

    Args:
        out: The folder, new or empty.
        outputs: Files of the flight by kind: report, record, video. Leaves cannot write these.

    Raises:
        FileError: The folder has files already, or it cannot be written to.
    """
    if out is None:
        return None
    given = [file for file in outputs.values() if file is not None]
    inside = [file.name for file in given if same_file(file.parent, out)]
    return FlightFolder(out, reserved=(REPORT_FILE, *OBJECTS_FILES, *inside))


def check_outputs(
    mission: MissionTree,
    options: FlightOptions,
    outputs: Mapping[str, Path | None],
    folder: FlightFolder | None,
) -> None:
    """Refuse outputs that cannot be written, or that are inputs.

    Args:
        mission: Mission that is flown; its files are inputs.
        options: Options of the flight; the files that they name are inputs.
        outputs: Files of the flight by kind: report, record, video.
        folder: Output folder; it is made when something is written.

    Raises:
        FileError: An output cannot be written.
    """
    read = [getattr(options, name) for name in _FILES_OF_OPTIONS]
    if isinstance(options.lab, Lab):
        scenes = options.lab.scenes.values() if options.scene is None else ()
        scene = options.lab.scenes.get(str(options.scene))
        read += [options.lab.file, options.lab.network, *scenes, scene]
    files = [(name, file) for name, file in outputs.items() if file is not None]
    for (first, file), (second, other) in combinations(files, 2):
        if same_file(file, other):
            raise FileError(
                file, f"is named for the {first} and for the {second}; choose another name"
            )
    for _, file in files:
        check_output(file, new_folders=folder is not None and file.parent == folder.folder)
        refuse_inputs(file, [*mission.sources, *read], shipped_trees())


def last_map(board: Blackboard) -> SiteMap | None:
    """Return the newest site map of any age. None: the mission made none."""
    known = board.snapshot().get(SITE_MAP.name)
    return None if known is None else known[0]


def objects_of(site_map: SiteMap | None) -> list[FoundObject] | None:
    """Return the objects of a map as results state them. None without a map."""
    if site_map is None:
        return None
    names = site_map.classes.names
    return [found_object(seen, names[seen.class_id], site_map.start) for seen in site_map.objects]


def write_objects(report: FlightReport, folder: FlightFolder) -> None:
    """Write the objects of a report as JSON and as CSV; nothing without a map.

    Raises:
        FileError: A file cannot be written.
    """
    if report.objects is None:
        return
    folder.make()
    rows = [asdict(each) for each in report.objects]
    content = {"frame": FRAME_OF_RESULTS, "objects": rows}
    table = io.StringIO()
    writer = csv.DictWriter(table, [each.name for each in fields(FoundObject)], lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    texts = (json.dumps(content, indent=2) + "\n", table.getvalue())
    for name, text in zip(OBJECTS_FILES, texts, strict=True):
        write_whole(folder.folder / name, text)
