"""Says what is wrong with the mission's map of the place, and when it cannot be flown by at all."""

from __future__ import annotations

import logging
import math
from dataclasses import dataclass
from typing import Final

from uav_bt.types.site_map import SiteMap

_LOG: Final = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class MapWatchConfig:
    """When a map is useless, and for how long an event is shown.

    Attributes:
        no_ground_s: views that have shown no ground for so long are named ...
        land_s: ... and after so long the mission is ended with a landing.
        shown_s: what happened to the map is shown for so long.
    """

    no_ground_s: float = 3.0
    land_s: float = 30.0
    shown_s: float = 10.0


class MapWatch:
    """Follows the map of one mission.

    Args:
        config: when a map is useless.
    """

    def __init__(self, config: MapWatchConfig | None = None) -> None:
        self._config = config or MapWatchConfig()
        self._airborne_s: float | None = None  # since when
        self._restarts, self._mark_moved_m = 0, 0.0
        self._shown: dict[str, float] = {}  # until when each warning is shown
        self.trouble: str | None = None  # why nothing can be flown by this map

    def update(self, site_map: SiteMap | None, now_s: float, *, airborne: bool) -> None:
        """Look at the map of a tick.

        Args:
            site_map: as it is known now; None where the mission keeps none.
            now_s: mission clock.
            airborne: whether the drone flies.
        """
        cfg, self.trouble = self._config, None
        self._shown = {text: until_s for text, until_s in self._shown.items() if until_s >= now_s}
        if site_map is None:
            return
        if not airborne:
            self._airborne_s = None
        elif self._airborne_s is None:
            self._airborne_s = now_s
        blind_s = 0.0 if self._airborne_s is None else _blind_s(site_map, self._airborne_s)
        if blind_s > cfg.no_ground_s:
            self._show("no ground in view: there is nothing to fly over", now_s)
        if blind_s > cfg.land_s:
            self.trouble = f"no ground in view for {blind_s:.0f} s"
        if site_map.full:
            self._show("the place is larger than its map, whose rest is not explored", math.inf)
        if site_map.restarts > self._restarts:
            self._restarts = site_map.restarts
            self._show(
                "the view contradicted the map, which was begun anew: was the drone moved, or its "
                "odometry reset?",
                now_s + cfg.shown_s,
            )
        moved_m = 0.0 if site_map.mark is None else site_map.mark.moved_m
        if moved_m > self._mark_moved_m:
            self._show(
                f"the landing mark stands {moved_m - self._mark_moved_m:.1f} m from where the map "
                "had it, and was placed anew",
                now_s + cfg.shown_s,
            )
        self._mark_moved_m = moved_m

    def warnings(self, now_s: float) -> tuple[str, ...]:
        """Return what is wrong with the map, or has just happened to it."""
        return tuple(text for text, until_s in self._shown.items() if until_s >= now_s)

    def _show(self, text: str, until_s: float) -> None:
        if text not in self._shown:
            _LOG.warning("%s", text)
        self._shown[text] = until_s


def _blind_s(site_map: SiteMap, airborne_s: float) -> float:
    """Return for how long views have shown no ground; those that look steeply down do not count."""
    ground_s = float(site_map.seen_s.max(initial=-math.inf))
    return site_map.captured_s - max(ground_s, airborne_s)
