"""Rules that a mission states about its flight: time limit, where it may land, area."""

from __future__ import annotations

import enum
from dataclasses import dataclass

from uav_bt.types.place import Place


class LandOn(enum.StrEnum):
    """Where a mission may land for its flight to be a success."""

    MARK = "mark"  # on the landing mark
    GROUND = "ground"  # beside the landing mark
    ANY = "any"
    NONE = "none"  # nowhere: the mission never takes off


@dataclass(frozen=True, kw_only=True)
class MissionRules:
    """The rules of a mission. None: the mission does not say."""

    time_limit_s: float | None = None  # from the take-off command
    land_on: LandOn | None = None
    area: tuple[Place, ...] | None = None  # corners of a polygon, in the frames start or lab
