"""Says what is wrong with the mission's map of the place, and when it cannot be flown by at all."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from uav_bt.types.site_map import SiteMap

_LOG: Final = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class MapWatchConfig:
    """When a map is useless, and for how long an event is shown.

    Attributes:
        no_ground_s: views that have shown no ground for so long are named ...
        land_s: ... and where none was seen since the mission began, it is ended with a landing.
        shown_s: what happened to the map is shown for so long.
    """

    no_ground_s: float = 8.0
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
        self._has_seen_ground = False
        self._events: dict[str, float] = {}  # until when each is shown
        self.warnings: tuple[str, ...] = ()  # what is wrong with the map, or has happened to it
        self.trouble: str | None = None  # why nothing can be flown by this map

    def update(self, site_map: SiteMap | None, now_s: float, *, airborne: bool) -> None:
        """Look at the map of a tick.

        Args:
            site_map: as it is known now; None where the mission keeps none.
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
        """Return for how long views have shown no ground; those looking steeply down are none."""
        if not airborne:
            self._airborne_s = None
            return 0.0
        if self._airborne_s is None:
            self._airborne_s = now_s
        return site_map.captured_s - max(site_map.ground_s, self._airborne_s)

    def _happened(self, site_map: SiteMap) -> Iterator[str]:
        """Yield what has happened to the map since the last tick."""
        if site_map.restarts > self._restarts:
            yield (
                "the view contradicted the map, which was begun anew: was the drone moved, or its "
                "odometry reset?"
            )
        moved_m = 0.0 if site_map.mark is None else site_map.mark.moved_m
        if moved_m > self._mark_moved_m:
            yield (
                f"the landing mark stands {moved_m - self._mark_moved_m:.1f} m from where the map "
                "had it, and was placed anew"
            )
        self._restarts, self._mark_moved_m = site_map.restarts, moved_m
