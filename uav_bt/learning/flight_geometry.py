"""Geometry of a lab in records of its flights: heights, camera and mark against the depth network.

The picks of a lab do not show a wrong height, camera or size of the mark. Here the ground is
measured by the depth network and by height and pitch, and the range of the mark in three ways: by
its size, by height and pitch, and by the depth network.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from perception.camera.camera_file import Undistorter
from perception.camera.ground_plane import ground_depth, view_of
from perception.depth.metric import MetricDepthMaker
from perception.depth.scale import ScaleConfig, sample_ground
from perception.depth.stage import DepthStage
from uav_bt.errors import FileError
from uav_bt.lab.lab import Lab
from uav_bt.lab.shipped import DEFAULT_LAB
from uav_bt.landing_marks import MarkView
from uav_bt.learning.mark_ranges import MarkRanges, mark_ranges
from uav_bt.plugins import make_mark_finder
from uav_bt.progress import Advance, silent
from uav_bt.protocols import DepthEstimator, Segmenter
from uav_bt.record.footage import flight_record, footage
from uav_bt.record.moment import StoredFrame
from uav_bt.record.reader import RecordReader
from uav_bt.types import CameraModel, ClassMap, Frame, LandingMark
from uav_bt.types.arrays import Floats

_MOST_FRAMES: Final = 60  # of all frames of a record, one a second or fewer
_GROUND: Final = ScaleConfig(max_range_m=4.0)


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
    found = Geometry()
    for reader in readers:
        frames = _spread_frames(reader)
        meter = _Meter(reader.camera, lab.mark, segmenter, network)
        for done, stored in enumerate(frames, start=1):
            meter.add(stored.frame(), found)
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
            "has no frame with an image, height and gimbal pitch: record a flight with a camera",
        )
    return found


class _Meter:
    """Measures frames of one flight."""

    def __init__(
        self,
        camera: CameraModel,
        mark: LandingMark | None,
        segmenter: Segmenter,
        network: DepthEstimator,
    ) -> None:
        self._undistorter, self._mark = Undistorter(camera), mark
        self._camera = self._undistorter.camera
        self._finder = None if mark is None else make_mark_finder(mark)
        self._segmenter, self._network = segmenter, network
        self._generator = np.random.default_rng(0)

    def add(self, frame: Frame, found: Geometry) -> None:
        """Add what a frame shows."""
        frame = replace(frame, image=self._undistorter.undistort(frame.image))
        class_map = self._segmenter.segment(frame)
        # A new maker for each frame: the scale of an earlier frame would hide a lack of ground.
        maker = MetricDepthMaker(source="network", generator=self._generator)
        metric = DepthStage(self._network, maker).perceive(frame, class_map, self._camera)
        found.frames += 1
        depth = None if metric.depth is None else metric.depth.depth
        if depth is None:
            found.refusals[metric.refusal] += 1
        else:
            found.ground_errors += self._ground_errors(frame, class_map, depth)
        if self._mark is not None and self._finder is not None:
            view = MarkView(frame=frame, camera=self._camera, class_map=class_map)
            marked = mark_ranges(view, self._mark, self._finder, depth)
            found.marks += [] if marked is None else [marked]

    def _ground_errors(
        self, frame: Frame, class_map: ClassMap, depth: NDArray[np.float32]
    ) -> list[Floats]:
        height_px, width_px = depth.shape
        plane_m = ground_depth(view_of(frame, self._camera, (width_px, height_px)))
        ground = sample_ground(depth, class_map.is_ground, plane_m, self._generator, _GROUND)
        return [] if ground is None else [np.asarray(ground.predicted / ground.known_m - 1.0)]
