"""Geometry of a lab in records of its flights: heights, camera and mark against the depth network.

The picks of a lab do not show a wrong height, camera or size of the mark. Here the ground is
measured by the depth network and by height and pitch, and the range of the mark in three ways: by
its size, by height and pitch, and by the depth network.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from perception.camera.ground_plane import ground_depth, view_of
from perception.depth.scale import ScaleConfig, sample_ground
from perception.marks.helipad_detector import H_SHARE
from perception.marks.region import region_on_plane
from uav_bt.app.perceive.pipeline import Perceived, Pipeline, PipelineConfig
from uav_bt.errors import FileError
from uav_bt.lab.lab import Lab
from uav_bt.lab.shipped import DEFAULT_LAB
from uav_bt.landing_marks import MarkView
from uav_bt.plugins import make_mark_finder
from uav_bt.progress import Advance, silent
from uav_bt.protocols import DepthEstimator, Segmenter
from uav_bt.record.footage import flight_record, footage
from uav_bt.record.moment import StoredFrame
from uav_bt.record.reader import RecordReader
from uav_bt.types import CameraModel, LandingMark
from uav_bt.types.arrays import Floats

_MOST_FRAMES: Final = 60  # of all frames of a record, one a second or fewer
_GROUND: Final = ScaleConfig(max_range_m=4.0)
_LEAST_PX: Final = 60  # of the mark's top: the error of its size is then a few percent. Chosen.
_LEAST_RANGE_M: Final = 0.5  # nearer the horizontal range is too short for a ratio. Chosen.
LEAST_MARKS: Final = 3  # frames with the mark, below which no cause is named. Chosen.
SYSTEMATIC: Final = 0.1  # median relative difference of ranges that has a cause. Chosen.


@dataclass(frozen=True, kw_only=True)
class MarkRanges:
    """Horizontal range from the lens to the mark in one frame, metres.

    Attributes:
        by_size: From the mark's size: that of the tags, or of its top in the class map.
        by_height: From the lens' height above the mark's top and the place in the class map.
        by_depth: From the depth network, scaled by the ground; NaN without a scale.
    """

    by_size: float
    by_height: float
    by_depth: float


@dataclass(kw_only=True)
class Geometry:
    """Comparison of lengths in flights.

    Attributes:
        frames: Number of frames that were compared.
        ground_errors: Relative errors of the scaled depth on ground nearer than 4 m, by frame.
        refusals: Frames without scaled depth, by reason.
        marks: Ranges of the mark, one for each frame that shows it.
    """

    frames: int = 0
    ground_errors: list[Floats] = field(default_factory=list)
    refusals: Counter[str] = field(default_factory=Counter)
    marks: list[MarkRanges] = field(default_factory=list)

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


def compare_lengths(
    records: Sequence[Path],
    lab: Lab,
    segmenter: Segmenter,
    network: DepthEstimator,
    *,
    advance: Advance = silent,
) -> Geometry:
    """Compare lengths that height, camera and lab file state with those of the depth network.

    Args:
        records: Records of flights in the lab.
        lab: The lab.
        segmenter: Segmentation with the lab's classes.
        network: Frame in, relative depth out.
        advance: Called after each frame.

    Raises:
        FileError: A record cannot be read, is of another lab or of other classes, or has no frame
            with an image and finite telemetry.
    """
    readers = [_checked(flight_record(path), lab) for path in records]
    found, mark = Geometry(), lab.mark
    by_image = mark is not None and make_mark_finder(mark).uses_images
    for reader in readers:
        generator = np.random.default_rng(0)
        config = PipelineConfig(source="network")
        pipeline = Pipeline(
            segmenter, network, reader.camera, generator=generator, config=config, mark=mark
        )
        frames = _spread_frames(reader)
        for done, stored in enumerate(frames, start=1):
            seen = pipeline.perceive(stored.frame())
            errors = _ground_errors(seen, pipeline.camera, generator)
            marked = mark and _mark_ranges(seen, pipeline.camera, mark, by_image=by_image)
            found.frames += 1
            found.refusals += Counter([seen.refusal] if seen.depth is None else [])
            found.ground_errors += [] if errors is None else [errors]
            found.marks += [marked] if marked else []
            advance(f"frames of {reader.path.name}", done, len(frames))
    return found


def _checked(reader: RecordReader, lab: Lab) -> RecordReader:
    text = reader.metadata.get("lab", "null")
    flown = DEFAULT_LAB if text == "null" else text
    if flown != lab.name:
        raise FileError(reader.path, f"was flown in the lab '{flown}', not in '{lab.name}'")
    if reader.classes.names != lab.classes.names:
        raise FileError(
            reader.path,
            f"was flown with other classes ({', '.join(reader.classes.names)}) than "
            f"{lab.file} has: fly again",
        )
    return reader


def _spread_frames(reader: RecordReader) -> list[StoredFrame]:
    """Return at most 60 frames with image and telemetry, a second or more apart."""
    found: list[StoredFrame] = []
    apart_s = 1.0
    for item in footage(reader):
        if not isinstance(item, StoredFrame) or item.image is None:
            continue
        note = item.note
        if not math.isfinite(note.height_above_carpet_m + note.gimbal_pitch_rad):
            continue
        if found and note.captured_s - found[-1].note.captured_s < apart_s - 1e-9:
            continue
        found.append(item)
        if len(found) > _MOST_FRAMES:
            found, apart_s = found[::2], 2.0 * apart_s
    if not found:
        raise FileError(
            reader.path,
            "has no frame with an image and its telemetry: record a flight of a drone with a camera",
        )
    return found


def _ground_errors(
    seen: Perceived, camera: CameraModel, generator: np.random.Generator
) -> Floats | None:
    """Return relative errors of scaled depth on ground, (N,); None with too little ground."""
    if seen.depth is None:
        return None
    height_px, width_px = seen.depth.depth.shape
    plane_m = ground_depth(view_of(seen.frame, camera, (width_px, height_px)))
    is_ground = seen.class_map.is_ground
    ground = sample_ground(seen.depth.depth, is_ground, plane_m, generator, _GROUND)
    return None if ground is None else np.asarray(ground.predicted / ground.known_m - 1.0)


def _mark_ranges(
    seen: Perceived, camera: CameraModel, mark: LandingMark, *, by_image: bool
) -> MarkRanges | None:
    """Return the ranges of the mark; None if the frame does not show it whole and large enough."""
    sighting, class_map = seen.sighting, seen.class_map
    name = mark.options.get("class") if mark.kind == "region" else None
    top = class_map.classes.mark_top if name is None else class_map.classes.id_of(name)
    if sighting is None or top is None:
        return None
    height_px, width_px = class_map.ids.shape
    view = view_of(seen.frame, camera, (width_px, height_px))
    if not view.height_m > mark.height_m:
        return None
    region = region_on_plane(
        class_map, top, MarkView(frame=seen.frame, camera=camera), mark.height_m
    )
    if region is None or region.cut or region.rows.size < _LEAST_PX:
        return None
    by_height = math.hypot(region.forward_m, region.right_m)
    if by_height < _LEAST_RANGE_M:
        return None
    if by_image:
        by_size = math.hypot(sighting.forward_m - camera.forward_offset_m, sighting.right_m)
    else:
        whole_m2 = mark.area_m2 * (H_SHARE if mark.kind == "helipad" else 1.0)
        by_size = by_height * math.sqrt(whole_m2 / region.area_m2)
    by_depth = math.nan
    if seen.depth is not None:
        plane_m = ground_depth(view, plane_m=mark.height_m)
        places = region.rows, region.columns
        by_depth = by_height * float(np.median(seen.depth.depth[places] / plane_m[places]))
    return MarkRanges(by_size=by_size, by_height=by_height, by_depth=by_depth)
