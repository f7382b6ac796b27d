"""A hall of numbers: views of its ground enter a site map, and a drone flies in it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from tests.paper_lab import CLASSES
from uav_bt.types import Pose2D
from uav_bt.types.site_map import MapMark, SiteMap

CELL_M = 0.1
NEAR_M, FAR_M, HALF_RAD = 1.2, 3.8, math.radians(34)  # of the ground in view


@dataclass
class DrawnHall:
    """Square ground around the origin, its side in metres with square boxes."""

    side_m: float
    boxes: tuple[tuple[float, float], ...] = ()
    pose: Pose2D = field(default_factory=lambda: Pose2D(x_m=0.0, y_m=0.0, yaw_rad=0.0))
    box_m: float = 0.45
    now_s: float = 0.0

    def __post_init__(self) -> None:
        reach = self.side_m / 2 + 2.5
        count = 2 * round(reach / CELL_M) + 1
        self.corner_m = (-(count // 2) * CELL_M,) * 2
        self._xy = np.moveaxis(np.indices((count, count)), 0, -1) * CELL_M + self.corner_m[0]
        self.ground = np.abs(self._xy).max(axis=-1) <= self.side_m / 2
        self.solid = np.zeros_like(self.ground)
        for box in self.boxes:
            self.solid |= np.abs(self._xy - box).max(axis=-1) <= self.box_m / 2
        self.seen_s = np.full(self.ground.shape, -math.inf, dtype=np.float32)
        self.free, self.outside, self.stands = (np.zeros_like(self.ground) for _ in range(3))
        self.look()

    def look(self) -> None:
        """Add the camera's view from this pose to the map."""
        azimuths = self.pose.yaw_rad + np.linspace(-HALF_RAD, HALF_RAD, 81)
        ranges = np.arange(0.05, FAR_M, 0.05)
        rays = np.stack(
            [np.cos(azimuths)[:, None] * ranges, np.sin(azimuths)[:, None] * ranges], axis=-1
        )
        here_m = np.array([self.pose.x_m, self.pose.y_m])
        cells = np.rint((rays + here_m) / CELL_M - self._origin()).astype(int)
        rows, columns = np.clip(np.moveaxis(cells, -1, 0), 0, self.ground.shape[0] - 1)
        solid = self.solid[rows, columns]
        before = np.logical_or.accumulate(solid, axis=1)
        shown = ~before & (ranges >= NEAR_M)
        below = ~before & (ranges < NEAR_M) & ~before[:, [24]]
        first = solid & ~np.pad(before, ((0, 0), (1, 0)))[:, :-1] & (ranges <= 3.0)
        is_ground = self.ground[rows, columns]
        seen = shown & is_ground
        self.seen_s[rows[seen], columns[seen]] = self.now_s
        self.free[rows[seen], columns[seen]] = True
        self.free[rows[below], columns[below]] = True
        gone = shown & ~is_ground
        self.outside[rows[gone], columns[gone]] = True
        self.stands[rows[first], columns[first]] = True
        body = np.hypot(*np.moveaxis(self._xy - here_m, -1, 0)) <= 0.35
        self.free |= body

    def map(self, mark: MapMark | None = None, *, contradicted_s: float = 0.0) -> SiteMap:
        """Return the map of all views up to now."""
        return SiteMap(
            classes=CLASSES,
            pose=self.pose,
            corner_m=self.corner_m,
            cell_m=CELL_M,
            seen_s=self.seen_s.copy(),
            free=self.free.copy(),
            outside=self.outside.copy(),
            passed=np.zeros_like(self.ground),
            obstacles_m=self._xy[self.stands],
            edges_m=np.empty((0, 2)),
            captured_s=self.now_s,
            mark=mark,
            contradicted_s=contradicted_s,
        )

    def _origin(self) -> float:
        return self.corner_m[0] / CELL_M
