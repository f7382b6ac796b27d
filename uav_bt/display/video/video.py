"""Video of a flight: camera, class map, map from above, readings and phases."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from typing import Final

from uav_bt.board.blackboard import Blackboard
from uav_bt.display import canvas
from uav_bt.display.canvas import ACCENT, ALARM, BACKDROP, PANEL, Size
from uav_bt.display.map_pane import MapPane
from uav_bt.display.shown import FlightFacts, FlownPath, Shown, phase_colours
from uav_bt.display.video.panes import (
    corridor_rows,
    draw_camera,
    draw_class_map,
    draw_corridor,
    draw_depth,
    draw_readings,
    draw_rows,
)
from uav_bt.display.video.video_file import FILM, VideoFile
from uav_bt.errors import FileError, ValueRangeError
from uav_bt.mission.judge import Outcome
from uav_bt.mission.tick import TickRecord
from uav_bt.types.arrays import Image

_SIZE_PX: Final[Size] = (1280, 720)
_LARGE: Final[Size] = (639, 359)  # of the camera's image, and of the class map alone
_SMALL: Final[Size] = (318, 178)  # of each of four panes in place of the class map
_MAP: Final[Size] = (639, 404)
_READINGS: Final[Size] = (639, 258)
_PHASES: Final[Size] = (639, 56)
_IMAGES_PER_S: Final = 10  # of mission time: one per tick in simulation
_HOLD_S: Final = 2.0  # video time of the outcome at the end
_MOST_PHASES: Final = 6  # of which the last ones have room


def open_film(path: Path, speed: float = 1.0) -> VideoFile:
    """Open the file of a film, whose speed is relative to the mission's time."""
    if not 0.1 <= speed <= 100.0:
        raise ValueRangeError(f"a video's speed must be 0.1 to 100 times, got {speed}")
    rate = _IMAGES_PER_S * Fraction(speed).limit_denominator(100)
    return VideoFile(path, size_px=_SIZE_PX, frames_per_s=rate, comment=FILM)


class FlightVideo:
    """A tick listener that films a flight into an open file.

    The panes of depth are there if the mission makes metric depth, or from the first one on.
    A new pane is a function of `Shown` and a line in `draw`.
    """

    def __init__(self, file: VideoFile, board: Blackboard, facts: FlightFacts) -> None:
        self._file = file
        self._board = board
        self._facts = facts
        self._shows_depth = facts.makes_depth
        self._map = MapPane(facts, _MAP)
        self._flown = FlownPath()
        self._first_s: float | None = None
        self._slot = -1
        self._last: Image | None = None

    def on_tick(self, record: TickRecord) -> None:
        """Draw and write a tick; ticks between two images only extend the path."""
        self._flown.add(record)
        if self._first_s is None:
            self._first_s = record.time_s
        # With a tolerance: times are sums of ticks.
        slot = math.floor((record.time_s - self._first_s) * _IMAGES_PER_S + 1e-6)
        if slot > self._slot:
            self._slot = slot
            self._last = self.draw(record)
            with suppress(FileError):  # closing the file raises it, and the flight goes on
                self._file.write(self._last, slot)

    def draw(self, record: TickRecord) -> Image:
        """Return the image of a tick, (720, 1280, 3) RGB."""
        shown = Shown(record, self._flown, self._board)
        phases = canvas.blank(_PHASES, PANEL)
        colours = [*phase_colours(self._flown.phases).items()][1:]  # without that of no phase
        canvas.draw_legend(phases, colours[-_MOST_PHASES:], (18, 33), 0.42)
        panes = [  # with their left upper corners
            (0, 0, draw_camera(shown, self._facts.camera, _LARGE)),
            (641, 0, self._map.draw(shown)),
            (641, 406, draw_readings(shown, _READINGS)),
            (641, 664, phases),
        ]
        self._shows_depth = self._shows_depth or shown.depth.known
        if self._shows_depth:
            inside = shown.intruding_pixels(self._facts)
            rows = canvas.blank(_SMALL, PANEL)
            draw_rows(rows, corridor_rows(shown), (10, 28))
            panes += [
                (0, 361, draw_class_map(shown.class_map, _SMALL)),
                (321, 361, draw_depth(shown.depth.value, _SMALL)),
                (0, 542, draw_corridor(shown.frame, shown.corridor, inside, _SMALL)),
                (321, 542, rows),
            ]
        else:
            panes.append((0, 361, draw_class_map(shown.class_map, _LARGE)))
        image = canvas.blank(_SIZE_PX, BACKDROP)
        for left, top, pane in panes:
            image[top : top + pane.shape[0], left : left + pane.shape[1]] = pane
        return image

    def conclude(self, outcome: str, lines: Sequence[str]) -> None:
        """Draw the outcome on the last image and hold it."""
        if self._last is not None:
            image = _with_outcome(self._last, outcome, lines)
            with suppress(FileError):
                for _ in range(max(1, round(_HOLD_S * self._file.frames_per_s))):
                    self._file.write(image)


def _with_outcome(last: Image, outcome: str, lines: Sequence[str]) -> Image:
    colour = ACCENT if outcome == Outcome.SUCCESS.value else ALARM
    image, headline = last.copy(), outcome.replace("_", " ")
    high, middle = 68 + 26 * len(lines), _SIZE_PX[0] / 4
    top = (_SIZE_PX[1] - high) // 2
    # On the camera and the class map, so that the map stays visible.
    image[top : top + high, : _LARGE[0]] //= 6
    left = (_SIZE_PX[0] // 2 - canvas.text_width_px(headline, 1.0, bold=True)) // 2
    canvas.put(image, headline, (left, top + 42), scale=1.0, bold=True, colour=colour)
    for index, words in enumerate(lines):
        canvas.put_centred(image, words, (middle, top + 72 + 26 * index), scale=0.55)
    return image
