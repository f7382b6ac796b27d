"""Video of a flight: camera, class map, map from above, readings and time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import suppress
from fractions import Fraction
from pathlib import Path
from textwrap import wrap
from typing import Final

from uav_bt.board.blackboard import Blackboard
from uav_bt.display import canvas
from uav_bt.display.canvas import ACCENT, ALARM, BACKDROP, DIM, PANEL, Size
from uav_bt.display.map_pane import MapPane
from uav_bt.display.shown import FlightFacts, FlownPath, Shown, phase_colours
from uav_bt.display.video import panes
from uav_bt.display.video.video_file import FILM, VideoFile
from uav_bt.errors import FileError, ValueRangeError
from uav_bt.mission.judge import Outcome
from uav_bt.mission.tick import TickRecord
from uav_bt.types.arrays import Image
from uav_bt.types.flight_results import shown_events

_SIZE_PX: Final[Size] = (1280, 720)
_LARGE: Final[Size] = (639, 359)  # of the camera's image, and of the class map alone
_SMALL: Final[Size] = (318, 178)  # of each of four panes in place of the class map
_MAP: Final[Size] = (639, 404)
_READINGS: Final[Size] = (639, 258)
_TIME: Final[Size] = (639, 56)
_IMAGES_PER_S: Final = 10  # of mission time: one per tick in simulation
_HOLD_S: Final = 2.0  # video time of the outcome at the end
_MOST_PHASES: Final = 6  # of which the last ones have room
_FIRST_SPAN_S: Final = 30.0  # of the time bar, whose scale doubles with the flight
_MARGIN_PX: Final = 18  # beside the time bar
_EVENT_S: Final = 5.0  # mission time for which an event stays in the image
_EVENT_WIDTH, _EVENT_ROWS = 76, 4  # characters of a line, and lines at most


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
        self._starts: list[tuple[float, str]] = []  # of the phases, with their names
        self._first_s: float | None = None
        self._events: list[tuple[float, str]] = []  # times and lines of the newest ones
        self._slot = -1
        self._last: Image | None = None

    def on_tick(self, record: TickRecord) -> None:
        """Draw and write a tick; ticks between two images only extend the path."""
        self._flown.add(record)
        for words in shown_events(record.events):
            self._events += ((record.time_s, line) for line in wrap(words, _EVENT_WIDTH))
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
        placed = [  # with their left upper corners
            (0, 0, panes.draw_camera(shown, self._facts.camera, _LARGE)),
            (641, 0, self._map.draw(shown)),
            (641, 406, panes.draw_readings(shown, _READINGS)),
            (641, 664, self._draw_time(shown.elapsed_s, record.phase)),
        ]
        self._shows_depth = self._shows_depth or shown.depth.known
        if self._shows_depth:
            inside = shown.intruding_pixels(self._facts)
            rows = canvas.blank(_SMALL, PANEL)
            panes.draw_rows(rows, panes.corridor_rows(shown), (10, 28))
            placed += [
                (0, 361, panes.draw_class_map(shown.class_map, _SMALL)),
                (321, 361, panes.draw_depth(shown.depth.value, _SMALL)),
                (0, 542, panes.draw_corridor(shown.frame, shown.corridor, inside, _SMALL)),
                (321, 542, rows),
            ]
        else:
            placed.append((0, 361, panes.draw_class_map(shown.class_map, _LARGE)))
        image = canvas.blank(_SIZE_PX, BACKDROP)
        for left, top, pane in placed:
            image[top : top + pane.shape[0], left : left + pane.shape[1]] = pane
        self._events = [one for one in self._events if record.time_s - one[0] < _EVENT_S]
        for row, (_, line) in enumerate(reversed(self._events[-_EVENT_ROWS:])):
            camera = image[: _LARGE[1], : _LARGE[0]]
            canvas.tag(camera, line, (10, _LARGE[1] - 66 - 21 * row))
        return image

    def _draw_time(self, now_s: float, phase: str) -> Image:
        """Return the phases in their colours over the time since the take-off command."""
        if not self._starts or self._starts[-1][1] != phase:
            self._starts.append((now_s, phase))
        span_s, limit_s = _FIRST_SPAN_S, self._facts.limit_s
        while span_s < now_s:
            span_s *= 2.0
        # A flight is judged one tick late.
        span_s = max(min(span_s, limit_s), now_s)
        scale_px_per_s = (_TIME[0] - 2 * _MARGIN_PX) / span_s
        image, colours = canvas.blank(_TIME, PANEL), phase_colours(self._flown.phases)
        canvas.draw_legend(image, [*colours.items()][1:][-_MOST_PHASES:], (_MARGIN_PX, 15), 0.42)
        image[24:34, _MARGIN_PX:-_MARGIN_PX] = BACKDROP
        for start_s, name in self._starts:  # the next phase is drawn over the end of this one
            left, right = (_MARGIN_PX + round(t * scale_px_per_s) for t in (start_s, now_s))
            image[24:34, left:right] = colours[name]
        words = f"{'limit ' if span_s == limit_s else ''}{span_s:.0f} s"
        canvas.put(image, "0", (_MARGIN_PX, 50), colour=DIM, scale=0.36)
        last = _TIME[0] - _MARGIN_PX - canvas.text_width_px(words, 0.36)
        canvas.put(image, words, (last, 50), colour=DIM, scale=0.36)
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
