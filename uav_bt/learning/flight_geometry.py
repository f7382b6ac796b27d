"""Geometry of a lab in records of its flights: heights, camera and mark against the depth network.

The picks of a lab do not show a wrong height, camera or size of the mark. Here the ground is
measured by the depth network and by height and pitch, and the range of the mark in three ways: by
its size, by height and pitch, and by the depth network.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from perception.camera.camera_file import Undistorter
from perception.camera.ground_plane import ground_depth, view_of
from perception.depth.metric import MetricDepthMaker
from perception.depth.scale import sample_ground
from perception.marks.helipad import H_SHARE
from perception.marks.region import region_on_plane
from uav_bt.errors import FileError
from uav_bt.lab.lab import Lab
from uav_bt.lab.shipped import DEFAULT_LAB
from uav_bt.landing_marks import MarkFinder, MarkView
from uav_bt.plugins import make_mark_finder
from uav_bt.progress import Advance, silent
from uav_bt.protocols import DepthEstimator, Segmenter
from uav_bt.record.footage import flight_record, footage
from uav_bt.record.moment import StoredFrame
from uav_bt.record.reader import RecordReader
from uav_bt.types import LandingMark
from uav_bt.types.arrays import Floats

_MOST_FRAMES: Final = 60  # of all frames of a record, one a second or fewer
_GROUND_M: Final = 4.0  # largest depth of the ground that is compared
_LEAST_MARKS: Final = 3  # frames with the mark, below which no cause is named. Chosen.
_GROUND_ERROR: Final = 0.1  # median on the ground, above which the depth network is wrong. Chosen.
# Least pixels of the mark's top. A mask is up to a pixel too large on each side: with fewer pixels
# its area is more than 15 % too large.
_MIN_PX: Final = 60
_MIN_MEASURED_PX: Final = 400
_LEAST_RANGE_M: Final = 0.5  # nearer the horizontal range is too short for a ratio. Chosen.


class MarkRanges(NamedTuple):
    """Horizontal range from the lens to the mark in one frame, metres."""

    by_size: float  # from the mark's size: that of the tags, or of its top in the class map
    by_height: float  # from the lens' height above the mark's top and the place in the class map
    by_depth: float  # from the depth network, scaled by the ground; NaN without a scale


@dataclass(kw_only=True)
class Geometry:
    """Comparison of lengths in flights."""

    tolerance: float = 0.1  # relative difference of two ranges of the mark that needs no cause
    frames: int = 0  # that were compared
    # Relative errors of the scaled depth on ground nearer than 4 m, by frame.
    ground_errors: list[Floats] = field(default_factory=list)
    refusals: Counter[str] = field(default_factory=Counter)  # frames without depth, by reason
    marks: list[MarkRanges] = field(default_factory=list)  # of each frame that shows the mark

    def ground_error(self, percentile: float) -> float:
        """Return a percentile of the absolute relative error on the ground; NaN without ground."""
        if not self.ground_errors:
            return math.nan
        return float(np.percentile(np.abs(np.concatenate(self.ground_errors)), percentile))

    def ratio(self, of: str, to: str) -> float:
        """Return the median ratio of two ranges of the mark, named as in `MarkRanges`."""
        ratios = [getattr(each, of) / getattr(each, to) for each in self.marks]
        known = [each for each in ratios if math.isfinite(each)]
        return float(np.median(known)) if known else math.nan

    def to_json(self) -> dict[str, Any]:
        """Return the figures as JSON values; None where nothing was measured."""
        figures = {
            "ground_error": self.ground_error(50),
            "ground_error_90": self.ground_error(90),
            "size_to_height": self.ratio("by_size", "by_height"),
            "size_to_depth": self.ratio("by_size", "by_depth"),
            "height_to_depth": self.ratio("by_height", "by_depth"),
        }
        known = {
            name: round(each, 4) if math.isfinite(each) else None for name, each in figures.items()
        }
        refusals = dict(self.refusals.most_common())
        return {"frames": self.frames, "refusals": refusals, "marks": len(self.marks), **known}

    def lines(self) -> Iterator[str]:
        """Yield the lines that describe the figures."""
        yield f"geometry in {self.frames} frames of flights"
        if self.ground_errors:
            yield (
                "  ground nearer than 4 m: depth network and ground plane differ by "
                f"{_percent(self.ground_error(50))} (median), "
                f"{_percent(self.ground_error(90))} (90th percentile)"
            )
        if self.refusals:
            reasons = ", ".join(f"{why}: {count}" for why, count in self.refusals.most_common())
            share = self.refusals.total() / self.frames
            yield f"  without metric depth: {_percent(share)} of the frames ({reasons})"
        if not self.marks:
            yield "  mark: in no frame found whole and large enough, as a class of the role mark"
            return
        yield (
            f"  mark in {len(self.marks)} frames: the range by its size is "
            f"{_difference(self.ratio('by_size', 'by_height'))} that by height and pitch, and "
            f"{_difference(self.ratio('by_size', 'by_depth'))} that by the depth network"
        )

    def likely_wrong(self, lab_file: Path) -> str:
        """Return the likely cause of a systematic difference; empty without one."""
        if len(self.marks) < _LEAST_MARKS:
            return ""
        to_height, to_depth = self.ratio("by_size", "by_height"), self.ratio("by_size", "by_depth")
        height_to_depth = self.ratio("by_height", "by_depth")
        if abs(to_height - 1.0) <= self.tolerance:
            if math.isnan(height_to_depth) or abs(height_to_depth - 1.0) <= self.tolerance:
                return ""
            return (
                "likely wrong: the depth network, which does not know this place; size and height "
                "of the mark agree (`uav-bt net train depth` trains it from records)"
            )
        large, small = ("large", "small") if to_height > 1.0 else ("small", "large")
        others = f", the height of the drone (too {small}), or focal length or pitch of the camera"
        if not self.ground_error(50) < _GROUND_ERROR or math.isnan(to_depth):
            keys = "size or height_m"
        elif abs(math.log(to_depth)) < abs(math.log(height_to_depth)):
            # With a wrong height of the mark, its size and the depth network still agree.
            keys, others = "height_m", ""
        else:
            keys = "size"
        return f"likely wrong: {keys} of the mark in {lab_file} (too {large}){others}"


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"


def _difference(ratio: float) -> str:
    """Return a ratio of lengths in words, before 'that by ...'."""
    if math.isnan(ratio):
        return "not comparable with"
    return f"{_percent(abs(ratio - 1.0))} {'above' if ratio > 1.0 else 'below'}"


def open_flight(path: Path, lab: Lab) -> RecordReader:
    """Open the record of a flight in a lab; FileError if it is of another lab or other classes."""
    reader = flight_record(path)
    text = reader.metadata.get("lab", "null")
    flown = DEFAULT_LAB if text == "null" else text
    if flown != lab.name:
        raise FileError(path, f"was flown in the lab '{flown}', not in '{lab.name}'")
    if reader.classes.names != lab.classes.names:
        stated, recorded = ", ".join(lab.classes.names), ", ".join(reader.classes.names)
        raise FileError(
            path, f"expected the classes of {lab.file} ({stated}), got {recorded}: fly again"
        )
    return reader


def compare_lengths(
    flights: Sequence[RecordReader],
    lab: Lab,
    segmenter: Segmenter,
    network: DepthEstimator,
    *,
    advance: Advance = silent,
) -> Geometry:
    """Compare lengths that height, camera and lab file state with those of the depth network."""
    mark, generator = lab.mark, np.random.default_rng(0)
    finder = None if mark is None else make_mark_finder(mark)
    # The area of a mask is less exact than the corners of a tag.
    found = Geometry(tolerance=0.15 if finder is None or not finder.uses_images else 0.1)
    for reader in flights:
        undistorter = Undistorter(reader.camera)
        frames = _spread_frames(reader)
        for done, stored in enumerate(frames, start=1):
            frame = stored.frame()
            frame = replace(frame, image=undistorter.undistort(frame.image))
            class_map = segmenter.segment(frame)
            # A new maker for each frame: the scale of an earlier frame would hide a lack of ground.
            # The check looks for wrong scales, so all of them count.
            maker = MetricDepthMaker(
                network, source="network", generator=generator, least_confidence=0.0
            )
            metric = maker.make(frame, class_map, undistorter.camera)
            depth = None if metric.depth is None else metric.depth.depth
            view = MarkView(frame=frame, camera=undistorter.camera, class_map=class_map)
            found.frames += 1
            if depth is None:
                found.refusals[metric.refusal] += 1
            else:
                plane_m = ground_depth(view_of(frame, undistorter.camera, depth.shape[::-1]))
                ground = sample_ground(depth, class_map.is_ground, plane_m, generator, _GROUND_M)
                if ground is not None:
                    found.ground_errors.append(np.asarray(ground.predicted / ground.known_m - 1.0))
            if mark is not None and finder is not None:
                marked = mark_ranges(view, mark, finder, depth)
                found.marks += [] if marked is None else [marked]
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
        if not math.isfinite(note.height_above_ground_m + note.gimbal_pitch_rad):
            continue
        if found and note.captured_s - found[-1].note.captured_s < apart_s - 1e-9:
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
    view: MarkView, mark: LandingMark, finder: MarkFinder, depth: NDArray[np.float32] | None
) -> MarkRanges | None:
    """Return the ranges of the mark in an undistorted view.

    Args:
        view: An undistorted frame with its class map.
        mark: Size and height of the mark.
        finder: Finder of that mark.
        depth: (h, w) metres along the optical axis at the class map's size; None if unknown.

    Returns:
        The ranges; None if the view does not show the mark's top whole and large enough.
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
        whole_m2 = mark.area_m2 * (H_SHARE if mark.kind == "helipad" else 1.0)
        by_size = by_height * math.sqrt(whole_m2 / region.area_m2)
    by_depth = math.nan
    if depth is not None:
        plane_m = ground_depth(lens, plane_m=mark.height_m)
        places = region.rows, region.columns
        by_depth = by_height * float(np.median(depth[places] / plane_m[places]))
    return MarkRanges(by_size=by_size, by_height=by_height, by_depth=by_depth)
