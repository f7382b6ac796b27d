"""Margins of routes: distances from obstacles and edges, and speeds.

| passage  | obstacles | edges                                 | lowest speed |
|----------|-----------|---------------------------------------|--------------|
| ordinary | 0.40 + r  | 0.30 + r                              | 0.3 m/s      |
| tight    | 0.34      | 0.30; 0.20 before the pad             | 0.3 m/s      |
| out      | 0.30      | 0.30; 0.20 before the pad, or shut in | 0.1 m/s      |
| gap      | 0.24      | 0.20: the way out before the pad      | 0.25 m/s     |

Metres from the body's centre, whose hull has a radius of 0.2 m; r is 8 times the residual of the
views above 0.016 m, at most 0.12 m. `Margins.within` shifts all distances for a place.

- Survey, GoTo, the way to the mark and view points take the ordinary passage, and the tight one
  where the ordinary one has no route, or a much longer one (in a survey: little new ground). The
  last is the way out; a survey takes it only if the tight one shuts it in or is nowhere.
- The last step of GoTo keeps the tight margins, MoveBy these and r, CanReturn the ordinary ones.
  A drone that gives way to a mover keeps 0.38 m from obstacles and 0.40 m from edges.
- Assumed obstacles block within 0.38 m, unseen cells within 0.35 m. In the narrow passages before
  the pad they only cost time. The way out of a drone that is shut in crosses an assumed obstacle on
  open, seen ground.

A drone that is shut in may begin with little clearance, and so comes through gaps beside an edge
that other margins close behind it. Nobody flies in by them.

The numbers were chosen in flights on the training scenes unless their line states otherwise.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from uav_bt.errors import ValueRangeError
from uav_bt.lab.shipped import default_mark
from uav_bt.types import NARROWER_M, Clearances, LandingMark
from uav_bt.types.arrays import Floats

YAW_RATE_RADPS: Final = 0.8  # rad/s; of a route's first turn (measured in the twin)
START_SLACK_M: Final = 0.03  # m; clearance that a route may lose near the drone: rounding of a cell
_SURE_M: Final = 0.016  # m; residual of views when place and height are known (profile lab)
_UNSURE_TIMES: Final = 8.0  # extra distance per metre of residual above that
_PAD_EDGE_M: Final = 0.2  # m; distance of the last metres before the pad from the edge
# m; a tight passage, and a gap, is narrower by this: with less room, faster than the way out, the
# drone could touch unseen sides of boxes, whose place is assumed and rounded to cells
_TIGHTER_M: Final = 0.06
_SWAY_M: Final = 0.04  # m; least room beside the hull in a gap
_GAP_WIDE_M: Final = 0.35  # m; a gap wider by this is flown at full speed, along its middle
_GAP_MPS: Final = 0.25  # m/s; in the narrowest gap: slower, more gusts meet the drone there
_AWAY_MPS: Final = 0.1  # m/s; at `min_start_m`: a route that begins there takes the shortest exit


class Passage(enum.Enum):
    """Width of a passage that a route may use, from the widest; `OUT` is the last resort."""

    ORDINARY = "ordinary"
    TIGHT = "tight"
    OUT = "out"


@dataclass(frozen=True, kw_only=True)
class Margins:
    """The smallest distances that a route keeps, and its speeds."""

    touch_m: float = Clearances.obstacle_m  # from obstacles: hull, the map's drift, sway
    wide_m: float = 0.75  # from here on the drone flies at full speed
    edge_m: float = Clearances.edge_m  # from the edge of the ground
    pad_edge_m: float = _PAD_EDGE_M  # the same in the last metres before the pad
    doubt_m: float = 0.38  # from assumed obstacles
    unknown_m: float = Clearances.unknown_m  # from unseen cells: the hidden side of a box
    lane_m: float = Clearances.lane_m  # from lanes of movers that may come back unseen
    min_start_m: float = 0.3  # a drone with less clearance must not reduce it further
    unsure_m: float = 0.12  # largest extra distance where views do not fit the map
    slow_mps: float = 0.3  # at `touch_m`
    fast_mps: float = 0.6  # from `wide_m` on
    past_assumed: bool = False  # may cross open, seen ground with an assumed obstacle
    cross_unknown: bool = False  # may cross assumed obstacles, and unseen cells near the mark
    hull_m: float = 0.2  # radius of the hull
    over_m: float | None = None  # radius of the mark, flown over; None: of the default lab's mark

    def __post_init__(self) -> None:
        apart = self.min_start_m - 1e-6 <= self.touch_m < self.wide_m
        if not (_AWAY_MPS <= self.slow_mps <= self.fast_mps and apart):
            raise ValueRangeError(f"speeds and distances must be positive and in order, got {self}")

    def within(self, place: Clearances, mark: LandingMark | None = None) -> Margins:
        """Return the margins of a place: each distance is shifted by the place's difference.

        Args:
            place: Distances that the place requires.
            mark: Landing mark of the place; default: that of the default lab.
        """
        if place == Clearances() and mark is None:
            return self
        wider_m = place.obstacle_m - Clearances.obstacle_m
        return replace(
            self,
            touch_m=self.touch_m + wider_m,
            wide_m=self.wide_m + wider_m,
            doubt_m=self.doubt_m + wider_m,
            min_start_m=self.min_start_m + min(wider_m, 0.0),
            pad_edge_m=self.pad_edge_m + max(place.edge_m - Clearances.edge_m, 0.0),
            unknown_m=self.unknown_m + (place.unknown_m - Clearances.unknown_m),
            lane_m=self.lane_m + (place.lane_m - Clearances.lane_m),
            edge_m=self.edge_m + (place.edge_m - Clearances.edge_m),
            over_m=self.over_m if mark is None else _over_m(mark),
        )

    def by(self, residual_m: float) -> Margins:
        """Return the margins widened for views that are off the map by a mean distance."""
        more_m = min(_UNSURE_TIMES * max(residual_m - _SURE_M, 0.0), self.unsure_m)
        if more_m == 0.0:
            return self
        return replace(
            self,
            touch_m=self.touch_m + more_m,
            wide_m=self.wide_m + more_m,
            doubt_m=self.doubt_m + more_m,
            edge_m=self.edge_m + more_m,
        )

    def through(self, passage: Passage, *, at_pad: bool = False, shut_in: bool = False) -> Margins:
        """Return the margins of a passage, from the ordinary ones; the module has their table."""
        if passage is Passage.ORDINARY:
            return self
        is_out = passage is Passage.OUT
        edge_m = self.pad_edge_m if at_pad else self.edge_m
        if is_out and shut_in:
            edge_m = max(edge_m - NARROWER_M, min(edge_m, self.pad_edge_m))
        return replace(
            self,
            touch_m=self.touch_m - (NARROWER_M if is_out else _TIGHTER_M),
            edge_m=edge_m,
            unsure_m=0.0,
            slow_mps=_AWAY_MPS if is_out else self.slow_mps,
            past_assumed=is_out and shut_in,
            cross_unknown=at_pad,
        )

    def in_gap(self) -> Margins:
        """Return the margins of a gap before the pad, a few centimetres more than the hull."""
        out = self.through(Passage.OUT, at_pad=True)
        touch_m = min(out.touch_m, max(out.touch_m - _TIGHTER_M, self.hull_m + _SWAY_M))
        return replace(
            out,
            touch_m=touch_m,
            wide_m=touch_m + _GAP_WIDE_M,
            slow_mps=_GAP_MPS,
            min_start_m=self.hull_m / 2,  # where gusts push the drone aside it goes on
            unknown_m=touch_m,
        )

    def tight(self) -> Margins:
        """Return those of a tight passage for a straight movement, which no later view corrects."""
        return replace(self.through(Passage.TIGHT), unsure_m=self.unsure_m)

    def at_pad(self) -> Margins:
        """Return the margins of the last metres before the pad.

        The camera sees those metres before the drone flies them, so assumed obstacles and unseen
        cells cost time but do not block the route.
        """
        return self.through(Passage.TIGHT, at_pad=True)

    def speed_mps(self, clear_m: Floats) -> Floats:
        """Return the speed at each clearance, metres."""
        at_m = min(self.min_start_m, self.touch_m - START_SLACK_M), self.touch_m, self.wide_m
        return np.interp(clear_m, at_m, (_AWAY_MPS, self.slow_mps, self.fast_mps))

    @property
    def over_mark_m(self) -> float:
        """The radius `over_m`, also where it is the default one."""
        return _over_m(default_mark()) if self.over_m is None else self.over_m


def _over_m(mark: LandingMark) -> float:
    """Return half of the diagonal of a mark, and a cell of the map."""
    return mark.radius_m + 0.1
