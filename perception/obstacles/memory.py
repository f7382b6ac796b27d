"""Remember where obstacles stand after they have left the view.

A forward-looking camera does not see what is beside the drone, nor the carpet nearer than about
1.2 m. But a box stands still, and its base was seen from further away: the lowest obstacle pixel on
a bearing meets the carpet there. Those points are kept in the dead-reckoned frame for a while, and
forgotten where the carpet is seen again. What reaches down to the image's lower edge and is not
explained by such a point has an unknown range: its bearing is reported apart, and for a while it is
assumed to stand anywhere on that bearing, until carpet is seen there or right behind it. Where the
carpet ends is remembered in the same way, and bearings on which it has ended already where the view
begins are reported like those of obstacles.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from perception.obstacles.contact_scan import (
    NO_CLASS,
    ContactScanConfig,
    GroundScan,
    find_bases,
    scan_ground,
)
from uav_bt.classes import GROUP_CARPET
from uav_bt.types import CameraModel, ClassMap, Frame, ObstaclePoints, Pose2D
from uav_bt.types.dead_reckoning import OdometryPose
from uav_bt.types.projection import project


@dataclass(frozen=True, kw_only=True)
class ObstacleMemoryConfig:
    """What is remembered, and for how long."""

    max_age_s: float = 30.0  # dead reckoning has drifted by a decimetre or so by then
    # An obstacle of unknown range is assumed at each of these until carpet is seen there; not
    # nearer than the first, where it would touch the body already.
    assumed_ranges_m: tuple[float, ...] = (0.4, 0.6, 0.8, 1.0)
    assumed_age_s: float = 10.0
    edge_age_s: float = 60.0  # a decimetre matters less there
    max_range_m: float = 3.0  # a pixel of the base's row weighs too much further away
    cell_m: float = 0.05  # one point is kept in each cell
    scan: ContactScanConfig = field(default_factory=ContactScanConfig)
    # A bearing is explained by a remembered base this near to it, not further than the carpet it
    # hides plus this much.
    explain_rad: float = 0.12
    explain_m: float = 0.3
    min_pitch_rad: float = -1.0  # looking further down, roofs are nearer than bases


class _Kind(enum.IntEnum):
    """What a remembered point is; the smaller stays where two fall into one cell."""

    BASE = 0
    EDGE = 1
    ASSUMED = 2


class ObstacleMemory:
    """Collects bases, carries them along with the drone's own motion."""

    def __init__(self, config: ObstacleMemoryConfig | None = None) -> None:
        self._config = config or ObstacleMemoryConfig()
        self._points = np.empty((0, 2))  # odometry frame
        self._until_s = np.empty(0)
        self._seen_s = np.empty(0)
        self._kinds = np.empty(0, dtype=np.int8)
        self._newest_s = -np.inf
        self._unplaced_rad = np.empty(0)  # bearings in the odometry frame
        self._unplaced_edges_rad = np.empty(0)

    def expire(self, now_s: float) -> None:
        """Drop what is too old at a time."""
        self._keep(self._until_s >= now_s)

    def update(
        self, class_map: ClassMap, frame: Frame, camera: CameraModel, pose: Pose2D
    ) -> GroundScan | None:
        """Take in a class map.

        Args:
            class_map: made from `frame`.
            frame: its telemetry places what is seen.
            camera: intrinsics at the class map's size.
            pose: of the body when the frame was captured, dead-reckoned.

        Returns:
            The view as it was scanned; None when nothing in it can be placed.
        """
        self._newest_s = frame.captured_s
        self._unplaced_rad = self._unplaced_edges_rad = np.empty(0)
        if frame.gimbal_pitch_rad < self._config.min_pitch_rad:
            return None
        cfg = self._config
        scan = scan_ground(class_map, frame, camera, cfg.scan)
        offset = np.array([camera.forward_offset_m, 0.0])
        self._forget_where_carpet_shows(scan.image_groups, pose, frame, camera)
        self._forget_before_carpet(scan, pose, offset)
        bases = find_bases(scan)
        hidden = bases.hidden_m + offset
        for seen_m, age_s, kind in (
            (bases.placed_m, cfg.max_age_s, _Kind.BASE),
            (bases.edges_m, cfg.edge_age_s, _Kind.EDGE),
        ):
            near = seen_m[np.hypot(*seen_m.T) <= cfg.max_range_m] + offset
            self._add(pose.points_to_world(near), frame.captured_s + age_s, kind)
        unexplained = self._unexplained(hidden, pose, _Kind.BASE, frame.captured_s + cfg.max_age_s)
        self._unplaced_rad = unexplained + pose.yaw_rad
        ended = self._unexplained(
            bases.hidden_edges_m + offset, pose, _Kind.EDGE, frame.captured_s + cfg.edge_age_s
        )
        self._unplaced_edges_rad = ended + pose.yaw_rad
        rays = np.stack([np.cos(unexplained), np.sin(unexplained)], axis=-1)
        assumed = (rays[:, None, :] * np.array(cfg.assumed_ranges_m)[:, None]).reshape(-1, 2)
        self._add(
            pose.points_to_world(assumed), frame.captured_s + cfg.assumed_age_s, _Kind.ASSUMED
        )
        return scan

    def forget(self) -> None:
        """Drop all that is remembered."""
        self._keep(np.zeros(len(self._points), dtype=bool))
        self._unplaced_rad = self._unplaced_edges_rad = np.empty(0)

    def forget_by(self, until_s: float, trails_m: NDArray[np.float64]) -> None:
        """Keep bases on the trails of what moves no longer than until a time.

        Args:
            until_s: the time.
            trails_m: (K, 3) places in the dead-reckoned frame, and the reach around each.
        """
        if not len(trails_m) or not len(self._points):
            return
        apart_m = np.hypot(*np.moveaxis(self._points[:, None] - trails_m[:, :2], -1, 0))
        on_trail = (apart_m <= trails_m[:, 2]).any(axis=1) & (self._kinds == _Kind.BASE)
        self._until_s[on_trail] = np.minimum(self._until_s[on_trail], until_s)

    def points(self, pose: OdometryPose) -> ObstaclePoints:
        """Return what is remembered, from where the drone is now, dead-reckoned."""
        local, age_s = pose.points_to_body(self._points), pose.time_s - self._seen_s
        is_base, is_edge = self._kinds == _Kind.BASE, self._kinds == _Kind.EDGE
        return ObstaclePoints(
            points_m=local[is_base],
            assumed_m=local[self._kinds == _Kind.ASSUMED],
            edges_m=local[is_edge],
            points_age_s=age_s[is_base],
            edges_age_s=age_s[is_edge],
            captured_s=self._newest_s,
            unplaced_rad=_wrapped(self._unplaced_rad - pose.yaw_rad),
            unplaced_edges_rad=_wrapped(self._unplaced_edges_rad - pose.yaw_rad),
        )

    def _forget_where_carpet_shows(
        self,
        groups: NDArray[np.uint8],
        pose: Pose2D,
        frame: Frame,
        camera: CameraModel,
    ) -> None:
        if not len(self._points):
            return
        local = pose.points_to_body(self._points)
        ahead = np.column_stack(
            [
                local[:, 0] - camera.forward_offset_m,
                local[:, 1],
                np.full(len(local), max(frame.height_above_carpet_m, 0.05)),
            ]
        )
        pixels = project(ahead, camera, frame.gimbal_pitch_rad)
        height_px, width_px = groups.shape
        with np.errstate(invalid="ignore"):
            inside = (
                (pixels[:, 0] >= 0)
                & (pixels[:, 0] <= width_px - 1)
                & (pixels[:, 1] >= 0)
                & (pixels[:, 1] <= height_px - 1)
            )
        shows_carpet = np.zeros(len(local), dtype=bool)
        columns, rows = np.rint(pixels[inside]).astype(int).T
        shows_carpet[inside] = groups[rows, columns] == GROUP_CARPET
        self._keep(~shows_carpet)

    def _forget_before_carpet(
        self, scan: GroundScan, pose: Pose2D, offset: NDArray[np.float64]
    ) -> None:
        """Forget what is assumed nearer than the view begins, where that begins with carpet.

        What stood there and reached up to the drone would hide that carpet.
        """
        begins = (scan.groups != NO_CLASS).argmax(axis=1)
        first = np.arange(len(begins)), begins
        bearings = np.arctan2(scan.level_m[:, 0, 1], scan.level_m[:, 0, 0])
        local = pose.points_to_body(self._points) - offset
        azimuths = np.arctan2(local[:, 1], local[:, 0])
        nearest = np.abs(azimuths[:, None] - bearings).argmin(axis=1)
        hidden = np.hypot(*local.T) < np.hypot(*scan.level_m[first].T)[nearest]
        in_view = (azimuths >= bearings[0]) & (azimuths <= bearings[-1])
        shows_carpet = scan.groups[first][nearest] == GROUP_CARPET
        self._keep(~(hidden & in_view & shows_carpet & (self._kinds == _Kind.ASSUMED)))

    def _keep(self, which: NDArray[np.bool_]) -> None:
        self._points, self._until_s = self._points[which], self._until_s[which]
        self._seen_s, self._kinds = self._seen_s[which], self._kinds[which]

    def _unexplained(
        self, hidden: NDArray[np.float64], pose: Pose2D, kind: _Kind, until_s: float
    ) -> NDArray[np.float64]:
        """Return the bearings, from the pose's heading, that no remembered point explains.

        Points of that kind explain. What does is still there: it is remembered until then.
        """
        bearings = np.arctan2(hidden[:, 1], hidden[:, 0])
        if not len(hidden) or not len(self._points):
            return bearings
        local = pose.points_to_body(self._points)
        known_bearings = np.arctan2(local[:, 1], local[:, 0])
        known_ranges = np.hypot(local[:, 0], local[:, 1])
        limits = np.hypot(hidden[:, 0], hidden[:, 1]) + self._config.explain_m
        explains = (
            (np.abs(bearings[:, None] - known_bearings) < self._config.explain_rad)
            & (known_ranges <= limits[:, None])
            & (self._kinds == kind)
        )
        is_there = explains.any(axis=0)
        self._until_s[is_there], self._seen_s[is_there] = until_s, self._newest_s
        return np.asarray(bearings[~explains.any(axis=1)])

    def _add(self, points: NDArray[np.float64], until_s: float, kind: _Kind) -> None:
        if not len(points):
            return
        # `unique` keeps the first of a cell: of one kind the newest.
        merged = np.vstack([points, self._points])
        expiries = np.concatenate([np.full(len(points), until_s), self._until_s])
        seen_s = np.concatenate([np.full(len(points), self._newest_s), self._seen_s])
        kinds = np.concatenate([np.full(len(points), kind, dtype=np.int8), self._kinds])
        order = np.lexsort((-expiries, kinds))
        cells = np.floor(merged[order] / self._config.cell_m).astype(np.int64)
        _, first = np.unique((cells[:, 0] << 32) + cells[:, 1], return_index=True)
        chosen = order[first]
        self._points, self._until_s = merged[chosen], expiries[chosen]
        self._seen_s, self._kinds = seen_s[chosen], kinds[chosen]


def _wrapped(angles_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray((angles_rad + np.pi) % (2.0 * np.pi) - np.pi)
