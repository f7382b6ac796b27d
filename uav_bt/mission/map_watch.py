"""Reports faults of the site map, and when nothing can be flown by it."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from uav_bt.types.site_map import SiteMap

_LOG: Final = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class MapWatchConfig:
    """Thresholds of a useless map, and how long an event is shown.

    Attributes:
        no_ground_s: time without ground in view after which a warning is given, seconds.
        land_s: time without ground in view after which the mission ends with a landing, if none
            was seen since the mission began, seconds.
        shown_s: time for which an event of the map is shown, seconds.
    """

    no_ground_s: float = 8.0
    land_s: float = 30.0
    shown_s: float = 10.0


class MapWatch:
    """Follows the map of one mission.

    Args:
        config: thresholds.
    """

    def __init__(self, config: MapWatchConfig | None = None) -> None:
        self._config = config or MapWatchConfig()
        self._airborne_s: float | None = None  # start of the flight; None on the ground
        self._restarts, self._mark_moved_m = 0, 0.0
        self._has_seen_ground = False
        self._events: dict[str, float] = {}  # end of the time for which each is shown
        self.warnings: tuple[str, ...] = ()  # faults and events of the map
        self.trouble: str | None = None  # why nothing can be flown by the map

    def update(self, site_map: SiteMap | None, now_s: float, *, airborne: bool) -> None:
        """Check the map of a tick.

        Args:
            site_map: newest map; None if the mission keeps none.
            now_s: mission clock.
            airborne: whether the drone flies.
        """
        if site_map is None:
            self.warnings, self.trouble = (), None
            return
        cfg, lasting = self._config, []
        blind_s = self._blind_s(site_map, now_s, airborne=airborne)
        if blind_s > cfg.no_ground_s:
            lasting.append("no ground in view: there is nothing to fly over")
        if site_map.full:
            lasting.append("the place is larger than its map, whose rest is not explored")
        self._events = {text: until_s for text, until_s in self._events.items() if until_s >= now_s}
        self._events |= dict.fromkeys(self._happened(site_map), now_s + cfg.shown_s)
        self._has_seen_ground |= bool(site_map.ground.any())
        lands = blind_s > cfg.land_s and not self._has_seen_ground
        self.trouble = f"no ground in view for {blind_s:.0f} s" if lands else None
        before, self.warnings = self.warnings, (*lasting, *self._events)
        for text in self.warnings:
            if text not in before:
                _LOG.warning("%s", text)

    def _blind_s(self, site_map: SiteMap, now_s: float, *, airborne: bool) -> float:
        """Return the time without ground in view, s; views steeply down do not count."""
        if not airborne:
            self._airborne_s = None
            return 0.0
        if self._airborne_s is None:
            self._airborne_s = now_s
        return site_map.captured_s - max(site_map.ground_s, self._airborne_s)

    def _happened(self, site_map: SiteMap) -> Iterator[str]:
        """Yield the events of the map since the last tick."""
        if site_map.restarts > self._restarts:
            yield (
                "the map was begun anew, because the view contradicted it (was the drone moved, or "
                "its odometry reset?)"
            )
        moved_m = 0.0 if site_map.mark is None else site_map.mark.moved_m
        if moved_m > self._mark_moved_m:
            yield (
                f"the landing mark stands {moved_m - self._mark_moved_m:.1f} m from where the map "
                "had it, and was placed anew"
            )
        self._restarts, self._mark_moved_m = site_map.restarts, moved_m
