"""What the paper reports of its flights, to hold ours against.

M. Mocanu, E. Slusanschi, M. Leordeanu, arXiv 2510.16624, section on vision-based autonomous flying.
Its density plots are read off in words there; no more exact numbers are given.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True, kw_only=True)
class PaperFigure:
    """A statement of the paper about a distribution."""

    text: str
    span: tuple[float, float]  # what it speaks of, in the metric's unit


PAPER: Final = {
    "time_to_find_helipad_s": (PaperFigure(text="depth: most at 10-15 s", span=(10.0, 15.0)),),
    "time_to_land_s": (PaperFigure(text="depth: peak at about 20 s", span=(19.0, 21.0)),),
    "search_distance_m": (
        PaperFigure(text="segmentation: about 5 m", span=(4.5, 5.5)),
        PaperFigure(text="depth: up to 25 m", span=(24.6, 25.0)),
    ),
}
"""By field of the flight's report."""

PAPER_SUCCESS: Final = "100 % of 100 simulated and of 30 real flights, each rule"
