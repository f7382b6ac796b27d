"""Where the landing mark is on the map."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from perception.mapping.ground_grid import GroundGrid
from perception.mapping.registration import Registration
from uav_bt.types import HelipadFix, Pose2D
from uav_bt.types.site_map import MapMark


@dataclass(frozen=True, kw_only=True)
class MarkPlaceConfig:
    """How far sightings of the mark are trusted."""

    std_m: float = 0.03  # of a sighting close by. Chosen.
    std_ratio: float = 0.05  # of its range, in addition. Chosen.
    # In addition, at confidence 0; in proportion to 1 - confidence. Half an H that the image's
    # border cuts has its middle 0.25 m off.
    doubt_m: float = 0.3
    moved_views: int = 10  # this many sightings elsewhere in a row move the mark. Chosen.
    # The mark is moved this far, as the map may have drifted; further only when ground was seen at
    # its former place. Sightings far from a mark that still stands are a mask's errors. Chosen.
    drift_m: float = 0.7


class MarkPlace:
    """Keeps the mark's place of all its sightings.

    Args:
        config: how far sightings are trusted.
    """

    def __init__(self, config: MarkPlaceConfig) -> None:
        self._config = config
        self.mark: MapMark | None = None
        self._elsewhere = 0  # sightings in a row that were not at its place

    def add(
        self, fix: HelipadFix, reckoned: Pose2D, registration: Registration, grid: GroundGrid
    ) -> None:
        """Take in a sighting, and correct the drone's place by it.

        Args:
            fix: from the body's centre.
            reckoned: pose of the body, dead-reckoned.
            registration: is corrected where the sighting agrees with the map.
            grid: of the ground.
        """
        cfg, known = self._config, self.mark
        std_m = math.hypot(
            cfg.std_m, cfg.std_ratio * fix.range_m, cfg.doubt_m * (1.0 - fix.confidence)
        )
        place = np.array(reckoned.to_world(fix.forward_m, fix.right_m))
        x_m, y_m = registration.correction.to_world(*map(float, place))
        if grid.is_beyond_edge(x_m, y_m):
            return
        moved_m = 0.0 if known is None else known.moved_m
        if known is not None:
            known_m = np.array([known.x_m, known.y_m])
            agrees = registration.correct_by_mark(place, known_m, math.hypot(std_m, known.std_m))
            self._elsewhere = 0 if agrees else self._elsewhere + 1
            x_m, y_m = registration.correction.to_world(*map(float, place))
            apart_m = math.hypot(x_m - known.x_m, y_m - known.y_m)
            gone = apart_m <= cfg.drift_m or grid.shows_ground(
                known.x_m, known.y_m, since_s=known.seen_s
            )
            if self._elsewhere >= cfg.moved_views and gone:
                moved_m += apart_m
                known, self._elsewhere = None, 0
            elif not agrees:
                return
        if known is None or std_m < known.std_m:
            self.mark = MapMark(
                x_m=x_m, y_m=y_m, std_m=std_m, seen_s=fix.captured_s, moved_m=moved_m
            )
        else:
            self.mark = replace(known, seen_s=fix.captured_s)
