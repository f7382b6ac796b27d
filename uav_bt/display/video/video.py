"""Video of a flight: camera, class map, map from above, readings and timeline."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Final

from uav_bt.board.blackboard import Blackboard
from uav_bt.display import canvas
from uav_bt.display.canvas import ACCENT, ALARM, BACKDROP, DIM, INK, PANEL, Colour, Size
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
    empty_pane,
)
from uav_bt.display.video.video_file import FILM, VideoFile
from uav_bt.errors import ValueRangeError
from uav_bt.mission.judge import Outcome
from uav_bt.mission.tick import TickRecord
from uav_bt.types.arrays import Image

_SIZE_PX: Final[Size] = (1280, 720)
_LEFT_PX: Final = 639  # width of the panes on the left
_IMAGES_PER_S: Final = 10  # of mission time: one per tick in simulation
_HOLD_S: Final = 2.0  # video time of the outcome at the end

_LARGE: Final[Size] = (639, 359)  # of the camera's image, and of the class map alone
_SMALL: Final[Size] = (318, 178)  # of each of four panes in place of the class map
_MAP: Final[Size] = (639, 404)
_READINGS: Final[Size] = (639, 258)
_TIMELINE: Final[Size] = (639, 56)

_FIRST_SPAN_S: Final = 30.0  # of the timeline
_STEPS_S: Final = (5.0, 10.0, 20.0, 30.0, 60.0, 120.0, 300.0, 600.0)  # steps of its scale
_MARKS: Final = 8  # largest number of marks
_TEXT: Final = 0.36  # scale of the marks
_LEGEND_TEXT: Final = 0.42
_MARGIN_PX: Final = 18
_TOP_PX: Final = 24  # of the bar
_BOTTOM_PX: Final = 34
_TRACK: Final[Colour] = (52, 56, 66)


class Timeline:
    """Draws the phases of a flight in their colours, with a time scale; None is no time limit.

    The duration of a flight is unknown while it is filmed. So the scale starts with 30 s, doubles
    when the flight exceeds it, and ends at the time limit of the flight.
    """

    def __init__(self, limit_s: float | None = None) -> None:
        self._limit_s = limit_s
        self._starts: list[tuple[float, str]] = []  # start time and name of each phase
        self._now_s = 0.0

    def add(self, elapsed_s: float, phase: str) -> None:
        """Add the phase at a time since the take-off command."""
        self._now_s = elapsed_s
        if not self._starts or self._starts[-1][1] != phase:
            self._starts.append((elapsed_s, phase))

    @property
    def span_s(self) -> float:
        """The time span of the scale, s."""
        doubled = max(0, math.ceil(math.log2(max(self._now_s, 1e-9) / _FIRST_SPAN_S)))
        span_s = _FIRST_SPAN_S * 2.0**doubled
        # A flight is judged one tick late, so it may exceed its limit by a tick.
        return span_s if self._limit_s is None else max(min(span_s, self._limit_s), self._now_s)

    def draw(self, size_px: Size) -> Image:
        """Return the present timeline; a height of 60 pixels is sufficient."""
        image = canvas.blank(size_px, PANEL)
        colours = phase_colours([phase for _, phase in self._starts])
        draw_legend(image, colours)
        image[_TOP_PX:_BOTTOM_PX, _MARGIN_PX:-_MARGIN_PX] = _TRACK
        ends_s = [start_s for start_s, _ in self._starts[1:]] + [self._now_s]
        for (start_s, phase), end_s in zip(self._starts, ends_s, strict=True):
            left, right = (round(self._column(s, size_px[0])) for s in (start_s, end_s))
            image[_TOP_PX:_BOTTOM_PX, left:right] = colours[phase]
        self._draw_scale(image, size_px[0])
        cursor = self._column(self._now_s, size_px[0])
        canvas.line(image, [(cursor, _TOP_PX - 4), (cursor, _BOTTOM_PX + 3)], ACCENT, 2)
        return image

    def _column(self, time_s: float, width_px: int) -> float:
        return _MARGIN_PX + (width_px - 2 * _MARGIN_PX) * time_s / self.span_s

    def _draw_scale(self, image: Image, width_px: int) -> None:
        base, span_s = _BOTTOM_PX + 16, self.span_s
        limited = span_s == self._limit_s
        words = f"limit {span_s:.0f} s" if limited else f"{span_s:.0f} s"
        last = width_px - _MARGIN_PX - canvas.text_width_px(words, _TEXT)
        canvas.put(image, words, (last, base), colour=INK if limited else DIM, scale=_TEXT)
        step_s = next((step for step in _STEPS_S if span_s / step <= _MARKS), span_s)
        for index in range(math.ceil(span_s / step_s)):
            column = self._column(index * step_s, width_px)
            canvas.line(image, [(column, _BOTTOM_PX), (column, _BOTTOM_PX + 3)], DIM)
            text = f"{index * step_s:.0f}"
            if column + canvas.text_width_px(text, _TEXT) / 2 + 8 < last:
                canvas.put_centred(image, text, (column, base), colour=DIM, scale=_TEXT)


def draw_legend(image: Image, colours: Mapping[str, Colour]) -> None:
    """Write phases in their colours in the first row; if not all fit, only the last ones."""
    entries = [
        (phase, colour, 20 + canvas.text_width_px(phase, _LEGEND_TEXT) + 16)
        for phase, colour in colours.items()
        if phase
    ]
    while len(entries) > 1 and sum(wide for *_, wide in entries) > image.shape[1] - 2 * _MARGIN_PX:
        entries.pop(0)
    left = _MARGIN_PX
    for phase, colour, wide_px in entries:
        canvas.line(image, [(left, 11), (left + 14, 11)], colour, 3)
        canvas.put(image, phase, (left + 20, 15), scale=_LEGEND_TEXT)
        left += wide_px


class Panes:
    """Composes the panes into one image of 1280x720, from the board after each tick.

    The panes of depth and corridor are there if the mission makes metric depth, or from the first
    one on. A new pane is a function of `Shown` and a line in `draw`.
    """

    def __init__(self, board: Blackboard, facts: FlightFacts) -> None:
        self._board = board
        self._facts = facts
        self._shows_depth = facts.makes_depth
        self._timeline = Timeline(facts.limit_s)
        self._map = MapPane(facts, _MAP)

    def draw(self, record: TickRecord, flown: FlownPath) -> Image:
        """Return the image of a tick."""
        shown = Shown(record, flown, self._board)
        self._timeline.add(shown.elapsed_s, record.phase)
        panes = [  # with their left upper corners
            (0, 0, draw_camera(shown, self._facts.camera, _LARGE)),
            (641, 0, self._map.draw(shown)),
            (641, 406, draw_readings(shown, _READINGS)),
            (641, 664, self._timeline.draw(_TIMELINE)),
        ]
        self._shows_depth = self._shows_depth or shown.depth.known
        if self._shows_depth:
            inside = shown.intruding_pixels(self._facts)
            rows = empty_pane("", _SMALL)
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


class FlightVideo:
    """A tick listener that writes a video; `begin` it before the first tick, close its file."""

    def __init__(self, path: Path, *, speed: float = 1.0) -> None:
        if not 0.1 <= speed <= 100.0:
            raise ValueRangeError(f"a video's speed must be 0.1 to 100 times, got {speed}")
        self._rate = _IMAGES_PER_S * Fraction(speed).limit_denominator(100)
        self._panes: Panes | None = None
        self._flown = FlownPath()
        self._first_s: float | None = None
        self._slot = -1
        self._last: Image | None = None
        self.file = VideoFile(path, size_px=_SIZE_PX, frames_per_s=self._rate, comment=FILM)

    def begin(self, board: Blackboard, facts: FlightFacts) -> None:
        """Begin the video of a flight."""
        self._panes = Panes(board, facts)

    def on_tick(self, record: TickRecord) -> None:
        """Draw and write a tick; ticks between two images only extend the path."""
        self._flown.add(record)
        if self._panes is None:
            return
        if self._first_s is None:
            self._first_s = record.time_s
        # With a tolerance: times are sums of ticks.
        slot = math.floor((record.time_s - self._first_s) * _IMAGES_PER_S + 1e-6)
        if slot > self._slot:
            self._slot = slot
            self._last = self._panes.draw(record, self._flown)
            self.file.write(self._last, slot)

    def conclude(self, outcome: str, lines: Sequence[str]) -> None:
        """Draw the outcome on the last image and hold it."""
        if self._last is not None:
            image = _with_outcome(self._last, outcome, lines)
            for _ in range(max(1, round(_HOLD_S * self._rate))):
                self.file.write(image)


def _with_outcome(last: Image, outcome: str, lines: Sequence[str]) -> Image:
    image, headline = last.copy(), outcome.replace("_", " ")
    colour = ACCENT if outcome == Outcome.SUCCESS.value else ALARM
    high, middle = 68 + 26 * len(lines), _SIZE_PX[0] / 4
    top = (_SIZE_PX[1] - high) // 2
    # On the camera and the class map, so that the map stays visible.
    image[top : top + high, :_LEFT_PX] //= 6
    left = (_SIZE_PX[0] // 2 - canvas.text_width_px(headline, 1.0, bold=True)) // 2
    canvas.put(image, headline, (left, top + 42), scale=1.0, bold=True, colour=colour)
    for index, words in enumerate(lines):
        canvas.put_centred(image, words, (middle, top + 72 + 26 * index), scale=0.55)
    return image
