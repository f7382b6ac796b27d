"""Video of a flight: camera, class map, map from above, readings and timeline.

If the mission makes metric depth, the class map shares its quarter with depth and corridor. A new
pane is a function of `Shown` and a row in the table of `Panes`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from types import TracebackType
from typing import Final, Self

from uav_bt.board.blackboard import Blackboard
from uav_bt.display import canvas
from uav_bt.display.canvas import ACCENT, ALARM, BACKDROP, Colour, Size
from uav_bt.display.flown_path import FlownPath, Shown
from uav_bt.display.lab_map import LabMap
from uav_bt.display.map_pane import MapPane
from uav_bt.display.video.panes import draw_camera, draw_readings, draw_rows
from uav_bt.display.video.perception_panes import (
    Intruding,
    corridor_rows,
    draw_class_map,
    draw_corridor,
    draw_depth,
    empty_pane,
    intruding_pixels,
)
from uav_bt.display.video.timeline import Timeline
from uav_bt.display.video.video_file import FILM, VideoFile
from uav_bt.errors import FileError, ValueRangeError
from uav_bt.mission.tick import TickRecord
from uav_bt.types import CameraModel
from uav_bt.types.arrays import Image

_SIZE_PX: Final[Size] = (1280, 720)
_LEFT_PX: Final = 639  # width of the panes on the left
_IMAGES_PER_S: Final = 10  # of mission time: one per tick in simulation
_HOLD_S: Final = 2.0  # video time of the outcome at the end

_MAP: Final = (641, 0, 639, 404)
_Rectangle = tuple[int, int, int, int]  # left, top, width, height, pixels


class Panes:
    """Composes the panes into one image of 1280x720, from the board after each tick.

    The panes of depth and corridor are there if the mission makes metric depth, or from the first
    one on. `intruding` finds the pixels that are marked in the corridor's.
    """

    def __init__(
        self,
        board: Blackboard,
        camera: CameraModel,
        *,
        lab_map: LabMap | None,
        title: str = "",
        limit_s: float | None = None,
        makes_depth: bool = False,
        intruding: Intruding | None = None,
    ) -> None:
        self._board = board
        self._camera = camera
        self._makes_depth = makes_depth
        self._intruding = intruding
        self._timeline = Timeline(limit_s)
        self._map = MapPane(lab_map, camera, _MAP[2:], title)

    def _table(self) -> Sequence[tuple[_Rectangle, Callable[[Shown, Size], Image]]]:
        """Return the place and the function of each pane."""
        whole, part = (0, 361, 639, 359), (0, 361, 318, 178)
        depth = (
            ((321, 361, 318, 178), lambda shown, size: draw_depth(shown.depth.value, size)),
            ((0, 542, 318, 178), self._draw_corridor),
            ((321, 542, 318, 178), _draw_corridor_rows),
        )
        return (
            ((0, 0, 639, 359), lambda shown, size: draw_camera(shown, self._camera, size)),
            (
                part if self._makes_depth else whole,
                lambda shown, size: draw_class_map(shown.class_map, size),
            ),
            *(depth if self._makes_depth else ()),
            (_MAP, lambda shown, _: self._map.draw(shown)),
            ((641, 406, 639, 258), draw_readings),
            ((641, 664, 639, 56), lambda _, size: self._timeline.draw(size)),
        )

    def draw(self, record: TickRecord, flown: FlownPath) -> Image:
        """Return the image of a tick."""
        shown = Shown.of(record, flown, self._board)
        self._makes_depth = self._makes_depth or shown.depth.known
        self._timeline.add(shown.elapsed_s, record.phase)
        image = canvas.blank(_SIZE_PX, BACKDROP)
        for (left, top, wide, high), draw in self._table():
            image[top : top + high, left : left + wide] = draw(shown, (wide, high))
        return image

    def _draw_corridor(self, shown: Shown, size_px: Size) -> Image:
        image = None if shown.frame is None else shown.frame.image
        return draw_corridor(
            image, shown.corridor, intruding_pixels(self._intruding, shown), size_px
        )


def _draw_corridor_rows(shown: Shown, size_px: Size) -> Image:
    image = empty_pane("", size_px)
    draw_rows(image, corridor_rows(shown.depth, shown.corridor), (10, 28))
    return image


class FlightVideo:
    """A tick listener that writes a video. Use it as a context manager, or close its file.

    A video must not affect the flight: after a write error (a full disk) the flight continues
    without it, and closing raises the error. The panes may be set later, before the first tick.
    """

    def __init__(self, path: Path, panes: Panes | None = None, *, speed: float = 1.0) -> None:
        if not 0.1 <= speed <= 100.0:
            raise ValueRangeError(f"a video's speed must be 0.1 to 100 times, got {speed}")
        self.panes = panes
        self._rate = _IMAGES_PER_S * Fraction(speed).limit_denominator(100)
        self._flown = FlownPath()
        self._first_s: float | None = None
        self._slot = -1
        self._last: Image | None = None
        self.file = VideoFile(path, size_px=_SIZE_PX, frames_per_s=self._rate, comment=FILM)

    def on_tick(self, record: TickRecord) -> None:
        """Draw and write a tick; ticks between two images only extend the path."""
        self._flown.add(record)
        if self.panes is None:
            return
        if self._first_s is None:
            self._first_s = record.time_s
        # With a tolerance: times are sums of ticks.
        slot = math.floor((record.time_s - self._first_s) * _IMAGES_PER_S + 1e-6)
        if slot > self._slot:
            self._slot, self._last = slot, self.panes.draw(record, self._flown)
            with suppress(FileError):
                self.file.write(self._last, slot)

    def conclude(self, headline: str, lines: Sequence[str] = (), *, good: bool = True) -> None:
        """Draw the outcome on the last image and hold it."""
        if self._last is not None:
            image = _with_outcome(self._last, headline, lines, ACCENT if good else ALARM)
            with suppress(FileError):
                for _ in range(max(1, round(_HOLD_S * self._rate))):
                    self.file.write(image)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None
    ) -> None:
        try:
            self.file.close()
        except FileError as failure:
            if error is None:
                raise
            error.add_note(f"and the video: {failure}")  # the error of the flight has priority


def _with_outcome(last: Image, headline: str, lines: Sequence[str], colour: Colour) -> Image:
    image = last.copy()
    high, middle = 68 + 26 * len(lines), _SIZE_PX[0] / 4
    top = (_SIZE_PX[1] - high) // 2
    # On the camera and the class map, so that the map stays visible.
    image[top : top + high, :_LEFT_PX] //= 6
    left = (_SIZE_PX[0] // 2 - canvas.text_width_px(headline, 1.0, bold=True)) // 2
    canvas.put(image, headline, (left, top + 42), scale=1.0, bold=True, colour=colour)
    for index, words in enumerate(lines):
        canvas.put_centred(image, words, (middle, top + 72 + 26 * index), scale=0.55)
    return image
