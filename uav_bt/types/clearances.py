"""The distances that routes keep."""

from __future__ import annotations

from dataclasses import dataclass, fields

from uav_bt.settings import check_numbers


@dataclass(frozen=True, kw_only=True)
class Clearances:
    """Distances from the body's centre that routes keep, metres; chosen in flights."""

    obstacle_m: float = 0.40
    """From obstacles: 0.2 m of hull, the map's drift and the sway; up to 0.1 m less in passages."""
    edge_m: float = 0.30
    """From the edge of the ground."""
    unknown_m: float = 0.35
    """From cells that were never seen: they may be an obstacle's hidden side."""
    lane_m: float = 0.7
    """From the path of a mover that may come back unseen."""

    def __post_init__(self) -> None:
        check_numbers(self, dict.fromkeys(vars(self), 0.0), dict.fromkeys(vars(self), 5.0))

    def below(self, radius_m: float) -> dict[str, float]:
        """Return the least value of each distance that is too small for a hull, by name."""
        least_m = {each.name: radius_m for each in fields(self)}
        least_m["obstacle_m"] = round(radius_m + NARROWER_M, 6)  # 0.2 and 0.1 are 0.3
        return {name: least for name, least in least_m.items() if getattr(self, name) < least}


NARROWER_M = 0.10  # the tightest passage keeps this much less from obstacles; chosen
