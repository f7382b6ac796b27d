"""Timeline of a film: the mission's phases in their colours, with a time scale.

The duration of a flight is unknown while it is filmed. So the scale starts with 30 s, doubles
when the flight exceeds it, and ends at the time limit of the flight.
"""

from __future__ import annotations

import math
from typing import Final

from uav_bt.display import canvas
from uav_bt.display.canvas import ACCENT, DIM, INK, PANEL, Colour, Size
from uav_bt.display.lab_drawing import draw_legend
from uav_bt.display.lab_map import phase_colours
from uav_bt.types.arrays import Image

_FIRST_SPAN_S: Final = 30.0
_STEPS_S: Final = (5.0, 10.0, 20.0, 30.0, 60.0, 120.0, 300.0, 600.0)  # steps of the scale
_MARKS: Final = 8  # largest number of marks
_SCALE: Final = 0.36
_MARGIN_PX: Final = 18
_TOP_PX: Final = 24  # of the bar
_BOTTOM_PX: Final = 34
_TRACK: Final[Colour] = (52, 56, 66)


class Timeline:
    """Tracks the phases of a flight and draws them; None is no time limit."""

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
        draw_legend(image, colours, base_px=15)
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
        last = width_px - _MARGIN_PX - canvas.text_width_px(words, _SCALE)
        canvas.put(image, words, (last, base), colour=INK if limited else DIM, scale=_SCALE)
        step_s = next((step for step in _STEPS_S if span_s / step <= _MARKS), span_s)
        for index in range(math.ceil(span_s / step_s)):
            column = self._column(index * step_s, width_px)
            canvas.line(image, [(column, _BOTTOM_PX), (column, _BOTTOM_PX + 3)], DIM)
            text = f"{index * step_s:.0f}"
            if column + canvas.text_width_px(text, _SCALE) / 2 + 8 < last:
                canvas.put_centred(image, text, (column, base), colour=DIM, scale=_SCALE)
