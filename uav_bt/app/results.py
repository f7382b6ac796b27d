"""Results of a flight as arrays: the flown path and the site map."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uav_bt.display.shown import FlownPath
from uav_bt.mission.flight_report import FlightReport
from uav_bt.mission.tick import TickRecord
from uav_bt.types import SiteMap


@dataclass(frozen=True, kw_only=True, eq=False)
class FlownMission(FlightReport):
    """The report of a flight, with its path and its map.

        flown = app.fly("land_only")
        plt.plot(flown.path[:, 1], flown.path[:, 2])

    Attributes:
        path: (N, 5) float64, a row for each tick: time in mission seconds, x, y, z in metres and
            yaw in radians. In a simulated drone it is the true pose in the lab frame of
            `docs/frames.md`. Otherwise it is dead-reckoned from the telemetry, with the first
            pose as the origin.
        site_map: The map at the end of the flight. None if the tree has no leaf that makes one.
    """

    path: NDArray[np.float64] = field(repr=False)
    site_map: SiteMap | None = field(repr=False)

    def to_json(self) -> dict[str, Any]:
        """Return the report as plain JSON values, without the arrays."""
        report = {each.name: getattr(self, each.name) for each in fields(FlightReport)}
        return FlightReport(**report).to_json()


class PathLog:
    """Listens to the runner and keeps the drone's pose at each tick."""

    def __init__(self) -> None:
        self._flown = FlownPath()
        self._rows: list[tuple[float, ...]] = []

    def on_tick(self, record: TickRecord) -> None:
        """Add the pose of a tick."""
        pose = self._flown.add(record)
        self._rows.append((record.time_s, pose.x_m, pose.y_m, pose.z_m, pose.yaw_rad))

    def array(self) -> NDArray[np.float64]:
        """Return the path until now, (N, 5); see `FlownMission.path`."""
        return np.array(self._rows, dtype=np.float64).reshape(-1, 5)


def path_of(ticks: Iterable[TickRecord]) -> NDArray[np.float64]:
    """Return the path of recorded ticks, (N, 5); see `FlownMission.path`."""
    log = PathLog()
    for tick in ticks:
        log.on_tick(tick)
    return log.array()
