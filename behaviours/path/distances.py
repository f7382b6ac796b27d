"""Distances of the cells of a site map from what stands on it; all clearance maps share them."""

from __future__ import annotations

import math
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from behaviours.path.movers_ahead import outlines_m
from behaviours.path.nearby import RecentObstacles
from uav_bt.types.arrays import Flags, Floats
from uav_bt.types.site_map import SiteMap


class Distances:
    """The distance of each cell of a site map from obstacles, edges and other cells.

    Args:
        site_map: The newest map.
        recent: Obstacles that are not on the map.
    """

    def __init__(self, site_map: SiteMap, recent: RecentObstacles) -> None:
        self._map = site_map
        self._recent = recent

    @cached_property
    def obstacle_m(self) -> Floats:
        """(rows, columns) distance to the nearest obstacle, metres; inf without any."""
        found = self._map
        points_m = np.vstack([found.obstacles_m, outlines_m(found.movers), self._recent.seen_m])
        return self.of(self.marked(points_m) | self._filled())

    @cached_property
    def edge_m(self) -> Floats:
        """(rows, columns) distance to the nearest edge of the ground, metres; inf without any."""
        ends = self.marked(np.vstack([self._map.edges_m, self._recent.edges_m]))
        return self.of(ends | self._map.outside)

    @cached_property
    def lane_m(self) -> Floats:
        """(rows, columns) distance to the nearest lane of movers, metres; inf without any."""
        return self.of(self.marked(self._map.lanes_m))

    @cached_property
    def assumed(self) -> Flags:
        """(rows, columns) cells of assumed obstacles."""
        return self.marked(self._recent.assumed_m)

    def of(self, marked: Flags) -> Floats:
        """Return the distance of each cell to the nearest marked one, metres; inf without any.

        Args:
            marked: (rows, columns).
        """
        import cv2  # noqa: PLC0415  (`uav-bt check` must answer at once)

        if not marked.any():
            return np.full(marked.shape, math.inf)
        apart = cv2.distanceTransform((~marked).view(np.uint8), cv2.DIST_L2, 5)
        return np.asarray(np.multiply(apart, self._map.cell_m, dtype=np.float64))

    def marked(self, points_m: Floats) -> Flags:
        """Return the cells with a point, (rows, columns).

        Args:
            points_m: (N, 2) in the map's frame.
        """
        marked = np.zeros(self._map.seen_s.shape, dtype=bool)
        if len(points_m):
            cells = self._cells(points_m)
            inside = ((cells >= 0) & (cells < marked.shape)).all(axis=1)
            marked[tuple(cells[inside].T)] = True
        return marked

    def _cells(self, points_m: Floats) -> NDArray[np.intp]:
        apart_m = points_m - np.array(self._map.corner_m)
        return np.asarray(np.rint(apart_m / self._map.cell_m).astype(np.intp))

    def _filled(self) -> Flags:
        """Return the cells that objects fill, including sides that were never seen."""
        import cv2  # noqa: PLC0415  (`uav-bt check` must answer at once)

        filled = np.zeros(self._map.seen_s.shape, dtype=np.uint8)
        margin_m = -self._map.cell_m / 2
        corners_m = [each.corners_m(margin_m=margin_m) for each in self._map.objects]
        if corners_m:
            # OpenCV's x is the column. It also fills the cells of the border.
            for corners in self._cells(np.stack(corners_m))[..., ::-1].astype(np.int32):
                cv2.fillConvexPoly(filled, corners, 1)
        return filled.view(np.bool_)
