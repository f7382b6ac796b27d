"""Figures that the paper reports of its missions, for comparison with flights of the same missions.

M. Mocanu, E. Slusanschi, M. Leordeanu, arXiv 2510.16624, section on vision-based autonomous flying.
The paper describes its density plots in words and gives no more exact numbers.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

_SEGMENTATION: Final = "explore_and_land_segmentation"
_DEPTH: Final = "explore_and_land_depth"

PAPER_MISSIONS: Final = (_SEGMENTATION, _DEPTH)
"""Missions that the paper flew, by the names of their files here."""


@dataclass(frozen=True, kw_only=True)
class PaperFigure:
    """A statement of the paper about a distribution.

    Attributes:
        mission: Name of the mission's file here.
        text: The statement.
        span: Range of values that the statement names, in the metric's unit.
    """

    mission: str
    text: str
    span: tuple[float, float]


_FIGURES: Final = {
    "time_to_find_mark_s": (
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
    """Return the paper's statements about a metric of some missions.

    Args:
        metric: Field of the flight's report.
        trees: Names of the missions' files.
    """
    flown = {Path(tree).stem for tree in trees}
    return tuple(figure for figure in _FIGURES.get(metric, ()) if figure.mission in flown)


def paper_success(trees: Iterable[str]) -> str | None:
    """Return the paper's statement about the success of missions; None if it flew none of them.

    Args:
        trees: Names of the missions' files.
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
