"""The clearance maps of wide and narrow passages, and the route through the best of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from behaviours.path.clearance import ClearanceMap, Place, Route
from behaviours.path.distances import Distances
from behaviours.path.margins import Margins, Passage
from behaviours.path.nearby import RecentObstacles
from uav_bt.types.site_map import SiteMap


class ClearanceMaps:
    """The clearance maps of each passage, made on first use.

    Attributes:
        map: The site map.

    Args:
        site_map: The newest map.
        recent: Obstacles that are not on the map.
        margins: Margins of the ordinary passage.
        crossing: Whether narrower passages may cross the lanes of movers.
        past_assumed: Whether the tightest passage may cross open ground with assumed obstacles.
        over: Landing mark that routes may lead over. With it, narrower passages use the margins of
            the last metres before the mark.
    """

    def __init__(
        self,
        site_map: SiteMap,
        recent: RecentObstacles,
        margins: Margins,
        *,
        crossing: bool = False,
        past_assumed: bool = False,
        over: Place | None = None,
    ) -> None:
        self.map, self._recent, self._margins = site_map, recent, margins
        self._crossing, self._past_assumed, self._over = crossing, past_assumed, over
        self._distances = Distances(site_map, recent)
        self._made: dict[Passage, ClearanceMap] = {}

    def __getitem__(self, passage: Passage) -> ClearanceMap:
        if passage not in self._made:
            found, margins = self.map, self._margins_of(passage)
            if self._crossing and passage is not Passage.ORDINARY:
                found = replace(found, lanes_m=np.empty((0, 2)))
            self._made[passage] = ClearanceMap(
                found, self._recent, margins, over=self._over, distances=self._distances
            )
        return self._made[passage]

    def usable(self) -> Iterator[Passage]:
        """Yield the passages from the widest; `OUT` only if the tightest shuts the drone in."""
        yield from (Passage.ORDINARY, Passage.TIGHT, Passage.TIGHTEST)
        if self[Passage.TIGHTEST].shut_in:
            yield Passage.OUT

    def _margins_of(self, passage: Passage) -> Margins:
        margins = self._margins
        if passage is Passage.ORDINARY:
            return margins
        if self._over is not None:
            at_pad = margins.at_pad()
            if passage is Passage.TIGHT:
                return at_pad
            return at_pad.sure() if passage is Passage.TIGHTEST else at_pad.out()
        if passage is Passage.TIGHT:
            return margins.tight()
        narrow = margins.tightest() if passage is Passage.TIGHTEST else margins.out()
        return replace(narrow, past_assumed=self._past_assumed)

    def route_to(self, to: Place, *, near_m: float, far_m: float) -> Route | None:
        """Return the route to a place; None without one.

        The route uses the widest passage, unless a narrower one saves `Margins.saved_s`.

        Args:
            to: Place in the map's frame, metres.
            near_m: As in `ClearanceMap.route_to`.
            far_m: As in `ClearanceMap.route_to`.
        """
        best: Route | None = None
        margins = self._margins
        for passage in self.usable():
            if best is not None and best.length_m <= margins.direct * best.apart_m:
                break
            found = self[passage].route_to(to, near_m=near_m, far_m=far_m)
            if found is not None and (best is None or found.time_s < best.time_s - margins.saved_s):
                best = found
            if best is not None and passage is not Passage.ORDINARY:
                break
        return best
