"""CanReturn: does the battery suffice for the way home? With it a tree turns back in time."""

from __future__ import annotations

import math
from typing import Final

from behaviours.path.margins import Margins
from behaviours.path.nearby import recent_obstacles
from behaviours.path.passages import route
from behaviours.ports import number
from uav_bt.board import SITE_MAP
from uav_bt.board.context import MissionContext
from uav_bt.board.keys import BATTERY_PER_MIN, BATTERY_SHARE, FLYING, HOME
from uav_bt.tree import Leaf, Status
from uav_bt.types.site_map import SiteMap

# The numbers were chosen.
_SPEED_MPS: Final = 0.4  # mean speed on the way home
_DETOUR: Final = 1.5  # length of the way over the straight distance, where no route is known
_LANDING_S: Final = 30.0  # from the arrival to the landing
_USE_PER_MIN: Final = 0.05  # before it is measured: an ANAFI is empty after 25 minutes
_PLAN_EVERY_S: Final = 2.0  # time between two plans of the route
_NEAR_M: Final = 1.0  # largest distance from the end of the route to the take-off point


class CanReturn(Leaf):
    """SUCCESS while the battery suffices for the way to the take-off point and a landing.

    The use of the battery is that of the present flight. The way is the route over the site map,
    or 1.5 times the straight distance where the map has no route. A drone on the ground is at home.
    While the place is unknown the last known distance counts. FAILURE without a report of the
    battery, and in the air as long as the distance was never known.
    """

    condition = True
    ports = (
        number(
            "reserve", 0.15, 0, 1, "share of the battery that is left after the landing, 0 to 1"
        ),
    )
    reads = (BATTERY_SHARE, BATTERY_PER_MIN, FLYING, HOME, SITE_MAP)

    def on_setup(self, mission: MissionContext) -> None:
        """Start without a distance."""
        import behaviours.path.compiled_loops  # noqa: F401, PLC0415  (compiled before the flight)

        self._margins = Margins().within(mission.clearances, mission.mark)
        self._planned_s, self._detour = -math.inf, _DETOUR
        self._way_m: float | None = None

    def update(self) -> Status:
        """Compare the charge with the need of the way home."""
        charge = self.read(BATTERY_SHARE).value
        if charge is None or charge < 0.0:
            self.feedback_message = "the battery is unknown"
            return Status.FAILURE
        way_m = self._way()
        if way_m is None:
            self.feedback_message = "the way home is unknown"
            return Status.FAILURE
        per_min = self.read(BATTERY_PER_MIN).value
        if per_min is None or per_min < 0.0:
            per_min = _USE_PER_MIN
        need = per_min * (way_m / _SPEED_MPS + _LANDING_S) / 60.0
        self.feedback_message = f"{way_m:.1f} m home take {100 * need:.0f} % of the battery"
        return Status.SUCCESS if charge - need >= self.port_value("reserve") else Status.FAILURE

    def _way(self) -> float | None:
        """Return the length of the way home, metres; None if it was never known."""
        if not self.read(FLYING).value:
            return 0.0
        home_m, site_map = self.read(HOME).value, self.read(SITE_MAP).value
        if home_m is not None and home_m >= 0.0:
            now_s = self.clock.now()
            if site_map is not None and now_s - self._planned_s >= _PLAN_EVERY_S:
                self._planned_s = now_s
                self._detour = self._detour_of(site_map, home_m)
            self._way_m = self._detour * home_m
        return self._way_m

    def _detour_of(self, site_map: SiteMap, home_m: float) -> float:
        """Return the length of the way over the straight distance."""
        recent, start = recent_obstacles(site_map.near, site_map), site_map.start
        to = (start.x_m, start.y_m)
        planned = route(site_map, to, self._margins, recent=recent, near_m=_NEAR_M)
        if planned is None or home_m < _NEAR_M:
            return _DETOUR
        return max((planned.length_m + _NEAR_M) / home_m, 1.0)


NODES = (CanReturn,)
