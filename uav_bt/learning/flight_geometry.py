"""Geometry of a lab in records of its flights.

Picks do not show a wrong height, camera or size of the mark. Here the range of the mark is measured
by its size, and by height and pitch of the camera.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from perception.camera.camera_file import Undistorter
from perception.camera.ground_plane import view_of
from perception.marks.helipad import H_AREA_SHARE
from perception.marks.region import region_on_plane
from uav_bt.errors import FileError
from uav_bt.lab.lab import Lab
from uav_bt.lab.shipped import DEFAULT_LAB
from uav_bt.landing_marks import MarkFinder, MarkView
from uav_bt.plugins import make_mark_finder
from uav_bt.protocols import Advance, Segmenter, silent
from uav_bt.record.moment import StoredFrame
from uav_bt.record.reader import RecordReader, flight_record, footage
from uav_bt.types import LandingMark

_MOST_FRAMES: Final = 60  # of all frames of a record, one a second or fewer
_LEAST_MARKS: Final = 3  # frames with the mark, below which no cause is named. Chosen.
# Least pixels of the mark's top. A mask is up to a pixel too large on each side: with fewer pixels
# its area is more than 15 % too large.
_MIN_PX: Final = 60
_MIN_MEASURED_PX: Final = 400
_LEAST_RANGE_M: Final = 0.5  # nearer the horizontal range is too short for a ratio. Chosen.


@dataclass(kw_only=True)
class Geometry:
    """Comparison of the ranges of the mark in flights."""

    tolerance: float = 0.1  # relative difference of the two ranges that needs no cause
    frames: int = 0  # that were compared
    ratios: list[float] = field(default_factory=list)  # of the ranges, by frame

    @property
    def ratio(self) -> float:
        """Median ratio of the range by size to that by height and pitch; or NaN."""
        return float(np.median(self.ratios)) if self.ratios else math.nan

    def to_json(self) -> dict[str, Any]:
        """Return the figures as JSON values; None where nothing was measured."""
        ratio = round(self.ratio, 4) if self.ratios else None
        return {"frames": self.frames, "marks": len(self.ratios), "size_to_height": ratio}

    def lines(self, lab_file: Path) -> Iterator[str]:
        """Yield lines about the figures, and about the likely cause of a difference."""
        yield f"geometry in {self.frames} frames of flights"
        if not self.ratios:
            yield "  mark: in no frame found whole and large enough, as a class of the role mark"
            return
        off = f"{100 * abs(self.ratio - 1.0):.1f} % {'above' if self.ratio > 1.0 else 'below'}"
        yield (
            f"  mark in {len(self.ratios)} frames: the range by its size is {off} that by height "
            "and pitch"
        )
        if len(self.ratios) >= _LEAST_MARKS and abs(self.ratio - 1.0) > self.tolerance:
            large, small = ("large", "small") if self.ratio > 1.0 else ("small", "large")
            yield (
                f"likely wrong: size or height_m of the mark in {lab_file} (too {large}), the "
                f"height of the drone (too {small}), or focal length or pitch of the camera"
            )


def open_flight(path: Path, lab: Lab) -> RecordReader:
    """Open the record of a flight in a lab; FileError if it is of another lab."""
    reader = flight_record(path)
    text = reader.metadata.get("lab", "null")
    flown = DEFAULT_LAB if text == "null" else text
    if flown != lab.name:
        raise FileError(path, f"was flown in the lab '{flown}', not in '{lab.name}'")
    return reader


def compare_ranges(
    flights: Sequence[RecordReader], lab: Lab, segmenter: Segmenter, *, advance: Advance = silent
) -> Geometry:
    """Compare the ranges of a lab's mark in flights of `open_flight`."""
    mark, found = lab.mark, Geometry()
    finder = None if mark is None else make_mark_finder(mark)
    if finder is not None and not finder.uses_images:
        found.tolerance = 0.15  # the area of a mask is less exact than the corners of a tag
    for reader in flights:
        undistorter = Undistorter(reader.camera)
        frames = _spread_frames(reader)
        for done, stored in enumerate(frames, start=1):
            frame = stored.frame()
            frame = replace(frame, image=undistorter.undistort(frame.image))
            class_map = segmenter.segment(frame)
            view = MarkView(frame=frame, camera=undistorter.camera, class_map=class_map)
            found.frames += 1
            if mark is not None and finder is not None:
                by_size_m, by_height_m = mark_ranges(view, mark, finder) or (0.0, 0.0)
                found.ratios += [by_size_m / by_height_m] if by_height_m else []
            advance(f"frames of {reader.path.name}", done, len(frames))
    return found


def _spread_frames(reader: RecordReader) -> list[StoredFrame]:
    """Return at most 60 frames with image and telemetry, a second or more apart."""
    found: list[StoredFrame] = []
    apart_s = 1.0
    for item in footage(reader):
        if not isinstance(item, StoredFrame) or item.image is None:
            continue
        note = item.note
        early = found and note.captured_s - found[-1].note.captured_s < apart_s - 1e-9
        if early or not math.isfinite(note.height_above_ground_m + note.gimbal_pitch_rad):
            continue
        found.append(item)
        if len(found) > _MOST_FRAMES:
            found, apart_s = found[::2], 2.0 * apart_s
    if not found:
        raise FileError(
            reader.path,
            "has no frame with an image, height and gimbal pitch: record a flight with a camera",
        )
    return found


def mark_ranges(
    view: MarkView, mark: LandingMark, finder: MarkFinder
) -> tuple[float, float] | None:
    """Return horizontal ranges from the lens to the mark in an undistorted view, metres.

    Returns:
        By the mark's size, that of the tags or of its top in the class map; and by the lens'
        height above the mark's top and the place in the class map. None if the view does not show
        the mark's top whole and large enough.
    """
    class_map, camera, sighting = view.class_map, view.camera, finder.find(view)
    if class_map is None or sighting is None:
        return None
    name = mark.options.get("class") if mark.kind == "region" else None
    top = class_map.classes.mark_top if name is None else class_map.classes.id_of(name)
    height_px, width_px = class_map.ids.shape
    lens = view_of(view.frame, camera, (width_px, height_px))
    if top is None or not lens.height_m > mark.height_m:
        return None
    region = region_on_plane(class_map, top, view, mark.height_m)
    min_px = _MIN_PX if finder.uses_images else _MIN_MEASURED_PX
    if region is None or region.cut or region.rows.size < min_px:
        return None
    by_height = math.hypot(region.forward_m, region.right_m)
    if by_height < _LEAST_RANGE_M:
        return None
    if finder.uses_images:
        by_size = math.hypot(sighting.forward_m - camera.forward_offset_m, sighting.right_m)
    else:
        # Such finders have the range from height and pitch; the area shows the size.
        whole_m2 = mark.area_m2 * (H_AREA_SHARE if mark.kind == "helipad" else 1.0)
        by_size = by_height * math.sqrt(whole_m2 / region.area_m2)
    return by_size, by_height
