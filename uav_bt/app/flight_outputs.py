"""Results of a flight: path and map as arrays, and the files that it writes."""

from __future__ import annotations

import csv
import io
import json
import time
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, fields
from itertools import combinations
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.app.options import FlightOptions
from uav_bt.app.provenance import files_of
from uav_bt.board.context import FlightFolder
from uav_bt.display.shown import FlownPath
from uav_bt.errors import DroneError, FileError
from uav_bt.files import check_output, write_whole
from uav_bt.inputs import refuse_inputs, same_file
from uav_bt.lab.lab import Lab
from uav_bt.mission.flight_report import FlightReport
from uav_bt.mission.tick import TickRecord
from uav_bt.protocols import StillCamera
from uav_bt.tree import MissionTree
from uav_bt.tree.loading.lookup import shipped_trees
from uav_bt.types import SiteMap
from uav_bt.types.flight_results import FRAME_OF_RESULTS, FoundObject, found_object

REPORT_FILE: Final = "report.json"
OBJECTS_FILES: Final = ("objects.json", "objects.csv")
_NO_INPUTS: Final = {"lab", "profile", "record", "tree_folders"}  # options
# Chosen: an ANAFI sends some megabytes a second, and a photograph has about eight.
_FIRST_PHOTO_S: Final = 15.0
_EACH_PHOTO_S: Final = 10.0


@dataclass(frozen=True, kw_only=True, eq=False)
class FlownMission(FlightReport):
    """The report of a flight, with its path and its map.

        flown = app.fly("land_only")
        plt.plot(flown.path[:, 1], flown.path[:, 2])

    Attributes:
        path: (N, 5) float64, a row for each tick: time in mission seconds, x, y, z in metres and
            yaw in radians. In a simulated drone it is the true pose in the lab frame of
            `docs/frames.md`. Otherwise it is dead-reckoned from the telemetry, with the first
            pose as the origin.
        site_map: The map at the end of the flight. None if the tree has no leaf that makes one.
    """

    path: NDArray[np.float64] = field(repr=False)
    site_map: SiteMap | None = field(repr=False)

    def to_json(self) -> dict[str, Any]:
        """Return the report as plain JSON values, without the arrays."""
        report = {each.name: getattr(self, each.name) for each in fields(FlightReport)}
        return FlightReport(**report).to_json()


class PathLog:
    """Listens to the runner and keeps the drone's pose at each tick."""

    def __init__(self, ticks: Iterable[TickRecord] = ()) -> None:
        self._flown = FlownPath()
        self._rows: list[tuple[float, ...]] = []
        for tick in ticks:
            self.on_tick(tick)

    def on_tick(self, record: TickRecord) -> None:
        """Add the pose of a tick."""
        pose = self._flown.add(record)
        self._rows.append((record.time_s, pose.x_m, pose.y_m, pose.z_m, pose.yaw_rad))

    def array(self) -> NDArray[np.float64]:
        """Return the path until now, (N, 5); see `FlownMission.path`."""
        return np.array(self._rows, dtype=np.float64).reshape(-1, 5)


def flight_folder(out: Path | None, outputs: Mapping[str, Path | None]) -> FlightFolder | None:
    """Return the output folder of a flight; leaves cannot write its other outputs."""
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
    """Refuse outputs that cannot be written, that are one file, or that the flight reads."""
    read: list[object] = [*mission.sources, *files_of(mission)]
    read += [getattr(options, one.name) for one in fields(options) if one.name not in _NO_INPUTS]
    if isinstance(lab := options.lab, Lab):
        read += [lab.file, lab.network, lab.flight.camera, *lab.scenes.values()]
    files = [(name, file) for name, file in outputs.items() if file is not None]
    for (first, file), (second, other) in combinations(files, 2):
        if same_file(file, other):
            raise FileError(file, f"is named for the {first} and for the {second}")
    for _, file in files:
        check_output(file, new_folders=folder is not None and file.parent == folder.folder)
        refuse_inputs(file, read, shipped_trees())


def objects_of(site_map: SiteMap | None) -> list[FoundObject] | None:
    """Return the objects of a map as results state them. None without a map."""
    if site_map is None:
        return None
    names = site_map.classes.names
    return [found_object(seen, names[seen.class_id], site_map.start) for seen in site_map.objects]


def write_objects(report: FlightReport, folder: FlightFolder) -> None:
    """Write the objects of a report as JSON and as CSV; nothing without a map."""
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


def fetch_photos(report: FlightReport, camera: StillCamera, folder: FlightFolder) -> None:
    """Write the photographs that are on the memory card of the drone's camera."""
    photos = [(photo.camera_file, photo.camera_media) for photo in report.photos]
    taken = {file: media for file, media in photos if file is not None and media is not None}
    until_s = time.monotonic() + _FIRST_PHOTO_S + _EACH_PHOTO_S * len(taken)
    missing: list[str] = []
    reason = "the drone is still in the air" if report.airborne_at_end else ""
    for name, media in taken.items():
        try:
            if not report.airborne_at_end:
                limit_s = max(0.0, until_s - time.monotonic())
                folder.write(name, camera.fetch_still(media, limit_s))
                continue
        except (DroneError, FileError) as error:
            reason = reason or str(error)
        missing.append(f"{name}: media {media}")
    if missing:
        raise FileError(
            folder.folder,
            f"{len(missing)} of {len(taken)} photographs stay on the drone's memory card "
            f"({', '.join(missing)}): {reason}",
        )
