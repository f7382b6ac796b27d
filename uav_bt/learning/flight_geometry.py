"""Geometry of a lab in records of its flights: heights, camera and mark against the depth network.

The picks of a lab do not show a wrong height, camera or size of the mark. Here the ground is
measured by the depth network and by height and pitch, and the range of the mark in three ways: by
its size, by height and pitch, and by the depth network.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.camera.camera_file import Undistorter
from perception.camera.ground_plane import ground_depth, view_of
from perception.depth.metric import MetricDepthMaker
from perception.depth.scale import sample_ground
from uav_bt.errors import FileError
from uav_bt.lab.lab import Lab
from uav_bt.lab.shipped import DEFAULT_LAB
from uav_bt.landing_marks import MarkFinder, MarkView
from uav_bt.learning.geometry import Geometry
from uav_bt.learning.mark_ranges import mark_ranges
from uav_bt.plugins import make_mark_finder
from uav_bt.progress import Advance, silent
from uav_bt.protocols import DepthEstimator, Segmenter
from uav_bt.record.footage import flight_record, footage
from uav_bt.record.moment import StoredFrame
from uav_bt.record.reader import RecordReader
from uav_bt.types import CameraModel, ClassMap, Frame, LandingMark
from uav_bt.types.arrays import Floats

_MOST_FRAMES: Final = 60  # of all frames of a record, one a second or fewer
_GROUND_M: Final = 4.0  # largest depth of the ground that is compared


def open_flight(path: Path, lab: Lab) -> RecordReader:
    """Open the record of a flight in a lab.

    Args:
        path: MCAP file of `uav-bt fly --record`.
        lab: The lab.

    Raises:
        FileError: The record cannot be read, or is of another lab or other classes.
    """
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
    """Compare lengths that height, camera and lab file state with those of the depth network.

    Args:
        flights: Records of `open_flight`.
        lab: The lab.
        segmenter: Segmentation with the lab's classes.
        network: Frame in, relative depth out.
        advance: Called after each frame.

    Raises:
        FileError: A record is damaged, or has no frame with an image and finite telemetry.
    """
    finder = None if lab.mark is None else make_mark_finder(lab.mark)
    # The area of a mask is less exact than the corners of a tag.
    found = Geometry(tolerance=0.15 if finder is None or not finder.uses_images else 0.1)
    for reader in flights:
        frames = _spread_frames(reader)
        meter = _Meter(reader.camera, segmenter, network, lab.mark, finder)
        for done, stored in enumerate(frames, start=1):
            meter.add(stored.frame(), found)
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


class _Meter:
    """Measures frames of one flight."""

    def __init__(
        self,
        camera: CameraModel,
        segmenter: Segmenter,
        network: DepthEstimator,
        mark: LandingMark | None,
        finder: MarkFinder | None,
    ) -> None:
        self._undistorter = Undistorter(camera)
        self._camera = self._undistorter.camera
        self._mark, self._finder = mark, finder
        self._segmenter, self._network = segmenter, network
        self._generator = np.random.default_rng(0)

    def add(self, frame: Frame, found: Geometry) -> None:
        """Add a frame."""
        frame = replace(frame, image=self._undistorter.undistort(frame.image))
        class_map = self._segmenter.segment(frame)
        # A new maker for each frame: the scale of an earlier frame would hide a lack of ground.
        # The check looks for wrong scales, so all of them count.
        maker = MetricDepthMaker(
            self._network, source="network", generator=self._generator, least_confidence=0.0
        )
        metric = maker.make(frame, class_map, self._camera)
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
        ground = sample_ground(depth, class_map.is_ground, plane_m, self._generator, _GROUND_M)
        return [] if ground is None else [np.asarray(ground.predicted / ground.known_m - 1.0)]
