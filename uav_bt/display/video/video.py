"""Video of a flight: camera, class map, map from above, and readings.

If the mission makes metric depth, the class map shares its quarter with depth and corridor.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Final, Self

import numpy as np

from uav_bt.board import CLASS_MAP, CORRIDOR, ELAPSED, MARK, METRIC_DEPTH, SITE_MAP
from uav_bt.board.blackboard import Blackboard
from uav_bt.display.canvas import ACCENT, ALARM, BACKDROP, INK, PANEL, Colour, put, text_width_px
from uav_bt.display.flown_path import FlownPath
from uav_bt.display.lab_map import LabMap
from uav_bt.display.live_map import LiveMap
from uav_bt.display.video.class_pane import draw_class_map
from uav_bt.display.video.depth_panes import (
    Intruding,
    corridor_rows,
    draw_corridor,
    draw_depth,
    intruding_pixels,
)
from uav_bt.display.video.panes import (
    Readings,
    draw_camera,
    draw_readings,
    draw_rows,
)
from uav_bt.display.video.timeline import Timeline
from uav_bt.display.video.video_file import FILM, VideoFile
from uav_bt.errors import FileError, ValueRangeError
from uav_bt.mission.tick import TickRecord
from uav_bt.types import CameraModel
from uav_bt.types.arrays import Image

_WIDTH: Final = 1280
_HEIGHT: Final = 720
_HALF: Final = _WIDTH // 2
_READINGS_HEIGHT: Final = 258
_TIMELINE_HEIGHT: Final = 56
_GAP: Final = 2  # pixels between the panes


@dataclass(frozen=True, kw_only=True)
class FlightVideoConfig:
    """Rate and speed of a video."""

    images_per_s: int = 10  # images per second of mission time: one per tick in simulation
    speed: float = 1.0  # mission time / video time
    hold_s: float = 2.0  # video time of the outcome at the end

    def __post_init__(self) -> None:
        if not 1 <= self.images_per_s <= 60:
            raise ValueRangeError(f"images a second must be 1 to 60, got {self.images_per_s}")
        if not 0.1 <= self.speed <= 100.0:
            raise ValueRangeError(f"a video's speed must be 0.1 to 100 times, got {self.speed}")

    @property
    def frames_per_s(self) -> Fraction:
        """The frame rate of the file."""
        return self.images_per_s * Fraction(self.speed).limit_denominator(100)


class Panes:
    """Composes the panes into one image of 1280x720.

    The panes of depth and corridor appear with the first metric depth, or after `show_depth`.

    Args:
        board: board of the mission, source of class map, fix and time.
        camera: intrinsics at the size of the frames.
        lab_map: content of the lab; None if unknown.
        title: line above the map: mission, scene and seed.
        limit_s: time limit of the flight from the take-off command; None: no limit.
    """

    def __init__(
        self,
        board: Blackboard,
        camera: CameraModel,
        *,
        lab_map: LabMap | None,
        title: str = "",
        limit_s: float | None = None,
    ) -> None:
        self._board = board
        self._camera = camera
        self._shows_depth = False
        self._intruding: Intruding | None = None
        self._timeline = Timeline(limit_s)
        high = _HEIGHT - _READINGS_HEIGHT - _TIMELINE_HEIGHT - _GAP
        self._map = LiveMap(lab_map, camera, (_HALF - _GAP // 2, high), title)
        self._image: Image = np.full((_HEIGHT, _WIDTH, 3), BACKDROP, dtype=np.uint8)

    def show_depth(self, intruding: Intruding | None = None) -> None:
        """Show the panes of depth and corridor from now on.

        Args:
            intruding: returns the pixels to mark in the corridor's pane; None marks no pixels.
        """
        self._shows_depth = True
        self._intruding = intruding

    def draw(self, record: TickRecord, flown: FlownPath) -> Image:
        """Return the image of a tick; the next call overwrites it."""
        readings = Readings(
            record=record,
            fix=self._board.read(MARK),
            class_map=self._board.read(CLASS_MAP),
            elapsed_s=self._board.read(ELAPSED).value or 0.0,
            distance_m=flown.distance_m,
        )
        pane_px = (_HALF - _GAP // 2, _HEIGHT // 2 - _GAP // 2)
        image = self._image
        image[: pane_px[1], : pane_px[0]] = draw_camera(readings, self._camera, pane_px)
        image[-pane_px[1] :, : pane_px[0]] = self._draw_perception(readings, pane_px)
        self._timeline.add(readings.elapsed_s, record.phase)
        image[: self._map.size_px[1], -pane_px[0] :] = self._draw_map(readings, flown)
        below = image[self._map.size_px[1] + _GAP :, -pane_px[0] :]
        below[:_READINGS_HEIGHT] = draw_readings(readings, (pane_px[0], _READINGS_HEIGHT))
        below[_READINGS_HEIGHT:] = self._timeline.draw((pane_px[0], _TIMELINE_HEIGHT))
        return image

    def _draw_perception(self, readings: Readings, size_px: tuple[int, int]) -> Image:
        depth, class_map = self._board.read(METRIC_DEPTH), readings.class_map.value
        self._shows_depth = self._shows_depth or depth.known
        if not self._shows_depth:
            return draw_class_map(class_map, size_px)
        corridor, frame = self._board.read(CORRIDOR).value, readings.record.observation.frame
        quarter_px = ((size_px[0] - _GAP) // 2, (size_px[1] - _GAP) // 2)
        wide, high = quarter_px
        image: Image = np.full((size_px[1], size_px[0], 3), BACKDROP, dtype=np.uint8)
        image[:high, :wide] = draw_class_map(class_map, quarter_px)
        image[:high, -wide:] = draw_depth(depth.value, quarter_px)
        image[-high:, :wide] = draw_corridor(
            None if frame is None else frame.image,
            corridor,
            intruding_pixels(self._intruding, frame, class_map, depth.value),
            quarter_px,
        )
        image[-high:, -wide:] = PANEL
        draw_rows(
            image[-high:, -wide:], corridor_rows(depth.value, corridor, depth.age_s), (10, 28)
        )
        return image

    def _draw_map(self, readings: Readings, flown: FlownPath) -> Image:
        record = readings.record
        state = record.observation.state
        yaw_rad, site_map = state.attitude.yaw_rad, self._board.read(SITE_MAP).value
        self._map.believe(record.time_s, flown, yaw_rad, site_map)
        return self._map.draw(
            flown,
            pitch_rad=state.gimbal_pitch_rad,
            height_m=state.height_above_ground_m,
            fix=readings.fix.value,
        )


class FlightVideo:
    """A tick listener that writes a video. Use it as a context manager, or close it.

    A video must not affect the flight: after a write error (a full disk) the flight continues
    without it, and closing raises the error.

    Args:
        path: the mp4 file, which appears when the video is closed.
        panes: draws the images; may be set later by `begin`.
        config: rate and speed.

    Raises:
        FileError: the file cannot be written.
    """

    def __init__(
        self, path: Path, panes: Panes | None = None, config: FlightVideoConfig | None = None
    ) -> None:
        self._config = config or FlightVideoConfig()
        self._panes = panes
        self._flown = FlownPath()
        self._first_s: float | None = None
        self._slot = -1
        self._last: Image | None = None
        self._failure: FileError | None = None
        self._file = VideoFile(
            path,
            size_px=(_WIDTH, _HEIGHT),
            frames_per_s=self._config.frames_per_s,
            comment=FILM,
        )

    @property
    def path(self) -> Path:
        """The path of the file."""
        return self._file.path

    def begin(self, panes: Panes) -> None:
        """Set the panes after the drone is connected."""
        self._panes = panes

    def on_tick(self, record: TickRecord) -> None:
        """Draw and write a tick; ticks between two images only extend the path."""
        self._flown.add(record)
        if self._panes is None or self._failure is not None:
            return
        if self._first_s is None:
            self._first_s = record.time_s
        # With a tolerance: times are sums of ticks.
        slot = math.floor((record.time_s - self._first_s) * self._config.images_per_s + 1e-6)
        if slot > self._slot:
            self._last = self._panes.draw(record, self._flown)
            self._write(self._last, slot)

    def conclude(self, headline: str, lines: Sequence[str] = (), *, good: bool = True) -> None:
        """Draw the outcome on the last image and hold it for `hold_s`."""
        if self._last is None or self._failure is not None:
            return
        image = _with_outcome(self._last, headline, lines, ACCENT if good else ALARM)
        held = max(1, round(self._config.hold_s * self._config.frames_per_s))
        for _ in range(held):
            self._write(image, self._slot + 1)

    def _write(self, image: Image, slot: int) -> None:
        self._slot = slot
        if self._failure is None:
            try:
                self._file.write(image, slot)
            except FileError as error:
                self._failure = error

    def discard(self) -> None:
        """Discard the video; an earlier file is kept."""
        self._file.discard()

    def close(self) -> None:
        """Finish the file; safe to call twice.

        Raises:
            FileError: the file could not be written completely; it is removed.
        """
        failure, self._failure = self._failure, None
        try:
            self._file.close()
        except FileError as error:
            failure = failure or error  # the first one is the cause
        if failure is not None:
            raise failure

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        try:
            self.close()
        except FileError as failure:
            if error is None:
                raise
            error.add_note(f"and the video: {failure}")  # the error of the flight has priority


def _with_outcome(last: Image, headline: str, lines: Sequence[str], colour: Colour) -> Image:
    image = last.copy()
    high = 68 + 26 * len(lines)
    top = (_HEIGHT - high) // 2
    # On the camera and the class map, so that the map stays visible.
    image[top : top + high, : _HALF - _GAP // 2] //= 6
    left = (_HALF - text_width_px(headline, 1.0, bold=True)) // 2
    put(image, headline, (left, top + 42), scale=1.0, bold=True, colour=colour)
    for index, words in enumerate(lines):
        left = (_HALF - text_width_px(words, 0.55)) // 2
        put(image, words, (left, top + 72 + 26 * index), scale=0.55, colour=INK)
    return image
