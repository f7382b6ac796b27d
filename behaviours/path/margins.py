"""Margins of routes: distances from obstacles and edges, and speeds.

Distances are from the body's centre to the nearest point. Half of the body's diagonal is 0.2 m. The
numbers were chosen in flights on the training scenes unless their line states otherwise.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, replace

import numpy as np

from uav_bt.errors import ValueRangeError
from uav_bt.lab.shipped import default_mark
from uav_bt.types import NARROWER_M, Clearances, LandingMark
from uav_bt.types.arrays import Floats


class Passage(enum.Enum):
    """Width of a passage that a route may use, from the widest.

    `OUT` is for a drone that is shut in by the tightest passage.
    """

    ORDINARY = "ordinary"
    TIGHT = "tight"
    TIGHTEST = "tightest"
    OUT = "out"


@dataclass(frozen=True, kw_only=True)
class Margins:
    """The smallest distances that a route keeps, and its speeds.

    Attributes:
        touch_m: Distance from obstacles: 0.2 m of hull, the map's drift and the drone's sway.
        wide_m: Distance from which the drone flies at full speed.
        tight_m: `touch_m` of a tight passage.
        tightest_m: `touch_m` of the tightest passage.
        sure_m: Residual of the views when place and height are known (measured in the lab profile).
        unsure_times: Extra distance per metre of residual above `sure_m`.
        unsure_m: Largest extra distance for the residual.
        doubt_m: Distance from assumed obstacles.
        past_assumed: Whether a route may cross open, seen ground with an assumed obstacle.
        unknown_m: Distance from cells that were never seen: they may be the hidden side of a box.
        lane_m: Distance from lanes of movers that may come back unseen.
        edge_m: Distance from the edge of the ground.
        slow_mps: Speed at `touch_m`.
        fast_mps: Speed from `wide_m` on.
        away_mps: Speed at `min_start_m`; it makes a route that begins there take the shortest exit.
        start_m: Within this distance of the drone a route may keep the drone's present clearance.
        start_slack_m: Clearance that it may lose there, for the rounding of a cell.
        min_start_m: A drone with less clearance than this must not reduce it further.
        enough_reached: Share of the flyable cells below which the drone counts as shut in.
        yaw_rate_radps: Rate of a route's first turn (measured in the twin).
        turn_m: Length of the route over which the time of that turn is spread.
        saved_s: Least time that a tight passage must save. The tightest passage is used only
            without another route.
        direct: A route up to this multiple of the straight line is not compared with narrower
            passages.
        cross_unknown: Whether a route may cross assumed obstacles, and unseen cells near the mark.
        cross_m: Distance from the mark up to which a route may cross unseen cells.
        unknown_times: Factor on the flight time of such cells.
        pad_m: `touch_m` of the last metres before the pad.
        pad_edge_m: `edge_m` of the last metres before the pad.
        over_m: Radius around the landing mark that counts as seen, free ground when routes may lead
            over it. None: half of the diagonal of the default lab's mark, and a cell.
    """

    touch_m: float = Clearances.obstacle_m
    wide_m: float = 0.75
    tight_m: float = 0.34
    tightest_m: float = Clearances.obstacle_m - NARROWER_M
    sure_m: float = 0.016
    unsure_times: float = 8.0
    unsure_m: float = 0.12
    doubt_m: float = 0.38
    past_assumed: bool = False
    unknown_m: float = Clearances.unknown_m
    lane_m: float = Clearances.lane_m
    edge_m: float = Clearances.edge_m
    slow_mps: float = 0.3
    fast_mps: float = 0.6
    away_mps: float = 0.1
    start_m: float = 0.7
    start_slack_m: float = 0.03
    min_start_m: float = 0.3
    enough_reached: float = 0.5
    yaw_rate_radps: float = 0.8
    turn_m: float = 0.5
    saved_s: float = 6.0
    direct: float = 1.3
    cross_unknown: bool = False
    cross_m: float = 1.2
    unknown_times: float = 3.0
    pad_m: float = 0.38
    pad_edge_m: float = 0.2
    over_m: float | None = None

    def __post_init__(self) -> None:
        speeds_mps = (self.away_mps, self.slow_mps, self.fast_mps)
        in_order = tuple(sorted(speeds_mps)) == speeds_mps
        apart = self.min_start_m <= self.touch_m < self.wide_m
        if self.away_mps <= 0.0 or not in_order or not apart:
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
            tight_m=self.tight_m + wider_m,
            tightest_m=self.tightest_m + wider_m,
            doubt_m=self.doubt_m + wider_m,
            min_start_m=self.min_start_m + min(wider_m, 0.0),
            pad_m=self.pad_m + wider_m,
            pad_edge_m=self.pad_edge_m + max(place.edge_m - Clearances.edge_m, 0.0),
            unknown_m=self.unknown_m + (place.unknown_m - Clearances.unknown_m),
            lane_m=self.lane_m + (place.lane_m - Clearances.lane_m),
            edge_m=self.edge_m + (place.edge_m - Clearances.edge_m),
            over_m=self.over_m if mark is None else _over_m(mark),
        )

    @property
    def over_mark_m(self) -> float:
        """The radius `over_m`, also where it is the default one."""
        return _over_m(default_mark()) if self.over_m is None else self.over_m

    def by(self, residual_m: float) -> Margins:
        """Return the margins widened for a map that the views do not fit exactly.

        Args:
            residual_m: Mean distance of the views' points from the map's.
        """
        more_m = min(self.unsure_times * max(residual_m - self.sure_m, 0.0), self.unsure_m)
        if more_m == 0.0:
            return self
        return replace(
            self,
            touch_m=self.touch_m + more_m,
            wide_m=self.wide_m + more_m,
            doubt_m=self.doubt_m + more_m,
            edge_m=self.edge_m + more_m,
        )

    def tight(self) -> Margins:
        """Return the margins of a tight passage."""
        return replace(self, touch_m=self.tight_m)

    def tightest(self) -> Margins:
        """Return the margins of the tightest passage, independent of the map's residual."""
        return replace(self, touch_m=self.tightest_m, unsure_m=0.0)

    def at_pad(self) -> Margins:
        """Return the margins of the last metres, where boxes may be beside the pad.

        The camera sees those metres from nearby before the drone flies them, so assumed obstacles
        and unseen cells there cost time but do not block the route.
        """
        return replace(self, touch_m=self.pad_m, edge_m=self.pad_edge_m, cross_unknown=True)

    def sure(self) -> Margins:
        """Return the tightest margins of the last metres, independent of the map's residual.

        With less than `tight_m` the drone could touch unseen sides of boxes: their place is
        assumed, and rounded to the grid.
        """
        return replace(self, touch_m=self.tight_m, unsure_m=0.0)

    def out(self) -> Margins:
        """Return the margins of the way out, for a drone that the tightest passage shuts in.

        A route may begin with little clearance, so a drone that swayed comes through gaps that
        other margins close behind it. The way out is also narrower beside edges, by as much as the
        tightest passage is beside obstacles, but not narrower than the last metres before the pad.
        It is flown as slowly as a route that begins with little clearance.
        """
        edge_m = max(self.edge_m - NARROWER_M, min(self.edge_m, self.pad_edge_m))
        return replace(self.tightest(), edge_m=edge_m, slow_mps=self.away_mps)

    def speed_mps(self, clear_m: Floats) -> Floats:
        """Return the speed at each clearance, metres."""
        at_m = min(self.min_start_m, self.touch_m - self.start_slack_m), self.touch_m, self.wide_m
        return np.interp(clear_m, at_m, (self.away_mps, self.slow_mps, self.fast_mps))


def _over_m(mark: LandingMark) -> float:
    """Return half of the diagonal of a mark, and a cell of the map."""
    return mark.radius_m + 0.1
