"""CanReturn: does the battery suffice for the way home? With it a tree turns back in time."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar

from behaviours.path.margins import Margins
from behaviours.path.nearby import recent_obstacles
from behaviours.path.passages import route
from uav_bt.board import SITE_MAP
from uav_bt.board.context import MissionContext
from uav_bt.board.keys import BATTERY_PER_MIN, BATTERY_SHARE, FLYING, HOME
from uav_bt.tree import Leaf, Port, Status
from uav_bt.types.site_map import SiteMap


@dataclass(frozen=True, kw_only=True)
class CanReturnConfig:
    """Speed, detour and battery use of the way home. The numbers were chosen.

    Attributes:
        speed_mps: Mean speed on the way home.
        detour: Length of the way over the straight distance, where no route is known.
        landing_s: Time from the arrival to the landing.
        use_per_min: Use of the battery before it is measured: an ANAFI is empty after 25 minutes.
        plan_every_s: Time between two plans of the route.
        near_m: Largest distance from the end of the route to the take-off point.
        margins: Distances that the route keeps.
    """

    speed_mps: float = 0.4
    detour: float = 1.5
    landing_s: float = 30.0
    use_per_min: float = 0.05
    plan_every_s: float = 2.0
    near_m: float = 1.0
    margins: Margins = field(default_factory=Margins)


class CanReturn(Leaf):
    """SUCCESS while the battery suffices for the way to the take-off point and a landing.

    The use of the battery is that of the present flight. The way is the route over the site map,
    or 1.5 times the straight distance where the map has no route. A drone on the ground is at home.
    While the place is unknown the last known distance counts. FAILURE without a report of the
    battery, and in the air as long as the distance was never known.
    """

    condition = True
    config: ClassVar[CanReturnConfig] = CanReturnConfig()
    ports = (
        Port(
            "reserve",
            float,
            default=0.15,
            least=0,
            most=1,
            doc="share of the battery that is left after the landing, 0 to 1",
        ),
    )
    reads = (BATTERY_SHARE, BATTERY_PER_MIN, FLYING, HOME, SITE_MAP)

    def on_setup(self, mission: MissionContext) -> None:
        """Start without a distance."""
        import behaviours.path.compiled_loops  # noqa: F401, PLC0415  (compiled before the flight)

        self._margins = self.config.margins.within(mission.clearances, mission.mark)
        self._planned_s, self._detour = -math.inf, self.config.detour
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
            per_min = self.config.use_per_min
        need_s = way_m / self.config.speed_mps + self.config.landing_s
        need = per_min * need_s / 60.0
        left = charge - need
        self.feedback_message = f"{way_m:.1f} m home take {100 * need:.0f} % of the battery"
        return Status.SUCCESS if left >= self.port_value("reserve") else Status.FAILURE

    def _way(self) -> float | None:
        """Return the length of the way home, metres; None if it was never known."""
        if not self.read(FLYING).value:
            return 0.0
        home_m = self.read(HOME).value
        if home_m is not None and home_m >= 0.0:
            site_map = self.read(SITE_MAP).value
            now_s = self.clock.now()
            if site_map is not None and now_s - self._planned_s >= self.config.plan_every_s:
                self._planned_s = now_s
                self._detour = self._detour_of(site_map, home_m)
            self._way_m = self._detour * home_m
        return self._way_m

    def _detour_of(self, site_map: SiteMap, home_m: float) -> float:
        """Return the length of the way over the straight distance."""
        start = site_map.start
        planned = route(
            site_map,
            (start.x_m, start.y_m),
            self._margins,
            recent=recent_obstacles(site_map.near, site_map),
            near_m=self.config.near_m,
        )
        if planned is None or home_m < self.config.near_m:
            return self.config.detour
        return max((planned.length_m + self.config.near_m) / home_m, 1.0)
