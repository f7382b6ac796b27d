"""What the paper reports of its flights, to hold ours against; of its missions, and no others.

M. Mocanu, E. Slusanschi, M. Leordeanu, arXiv 2510.16624, section on vision-based autonomous flying.
Its density plots are read off in words there; no more exact numbers are given.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

_SEGMENTATION: Final = "explore_and_land_segmentation"
_DEPTH: Final = "explore_and_land_depth"

PAPER_MISSIONS: Final = (_SEGMENTATION, _DEPTH)
"""The missions of ours that the paper flew, by the names of their files."""


@dataclass(frozen=True, kw_only=True)
class PaperFigure:
    """A statement of the paper about a distribution."""

    mission: str
    text: str
    span: tuple[float, float]  # what it speaks of, in the metric's unit


_FIGURES: Final = {
    "time_to_find_helipad_s": (
        PaperFigure(mission=_DEPTH, text="depth: most at 10-15 s", span=(10.0, 15.0)),
    ),
    "time_to_land_s": (
        PaperFigure(mission=_DEPTH, text="depth: peak at about 20 s", span=(19.0, 21.0)),
    ),
    "search_distance_m": (
        PaperFigure(mission=_SEGMENTATION, text="segmentation: about 5 m", span=(4.5, 5.5)),
        PaperFigure(mission=_DEPTH, text="depth: up to 25 m", span=(24.6, 25.0)),
    ),
}


def paper_figures(metric: str, trees: Iterable[str]) -> tuple[PaperFigure, ...]:
    """Return what the paper says of a metric of some missions.

    Args:
        metric: a field of the flight's report.
        trees: names of the missions' files.
    """
    flown = {Path(tree).stem for tree in trees}
    return tuple(figure for figure in _FIGURES.get(metric, ()) if figure.mission in flown)


def paper_success(trees: Iterable[str]) -> str | None:
    """Return what the paper says of the success of some missions; None where it flew none of them.

    Args:
        trees: names of the missions' files.
    """
    flown = {Path(tree).stem for tree in trees}
    known = [mission for mission in PAPER_MISSIONS if mission in flown]
    if not known:
        return None
    each = " each" if len(known) > 1 else ""
    return (
        f"The paper reports success in all of 100 simulated and of 30 real flights{each} of "
        f"{' and '.join(known)}."
    )
