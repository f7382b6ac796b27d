"""What the paper says of its missions, for comparison with flights of the same missions.

M. Mocanu, E. Slusanschi, M. Leordeanu, arXiv 2510.16624, section on vision-based autonomous flying.
The paper describes its density plots in words and gives no more exact numbers.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Final

_SEGMENTATION: Final = "explore_and_land_segmentation"
_DEPTH: Final = "explore_and_land_depth"
# Field of a flight's line, name of the mission's file here, and statement with its range.
_FIGURES: Final = (
    ("time_to_find_mark_s", _DEPTH, ("depth: most at 10-15 s", 10.0, 15.0)),
    ("time_to_land_s", _DEPTH, ("depth: peak at about 20 s", 19.0, 21.0)),
    ("search_distance_m", _SEGMENTATION, ("segmentation: about 5 m", 4.5, 5.5)),
    ("search_distance_m", _DEPTH, ("depth: up to 25 m", 24.6, 25.0)),
)


def paper_figures(metric: str, trees: Iterable[str]) -> list[tuple[str, float, float]]:
    """Return the paper's statements about a metric of missions, with the range of each."""
    flown = {Path(tree).stem for tree in trees}
    return [told for name, mission, told in _FIGURES if name == metric and mission in flown]


def paper_success(trees: Iterable[str]) -> str:
    """Return the paper's statement about the success of missions; empty if it flew none of them."""
    flown = {Path(tree).stem for tree in trees}
    known = [mission for mission in (_SEGMENTATION, _DEPTH) if mission in flown]
    each = " each" if len(known) > 1 else ""
    success = f"success in all of 100 simulated and of 30 real flights{each} of"
    return f"The paper reports {success} {' and '.join(known)}." if known else ""
