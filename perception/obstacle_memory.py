"""Remember where obstacles stand after they have left the view.

A forward-looking camera does not see what is beside the drone, nor the carpet nearer than about
1.2 m. But a box stands still, and its base was seen from further away: the lowest obstacle pixel of
a column meets the carpet there. Those points are kept in the dead-reckoned frame for a while, and
forgotten where the carpet is seen again. What reaches down to the image's lower edge and is not
explained by such a point has an unknown range; its bearing is reported apart.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perception.classes import GROUP_CARPET, GROUP_OBSTACLE, group_of
from perception.geometry import ground_points, project
from perception.tracking import Odometry, OdometryPose
from uav_bt.types import CameraModel, ClassMap, DroneState, Frame, ObstaclePoints

__all__ = ["ObstacleMemory", "ObstacleMemoryConfig", "hidden_bases", "visible_bases"]


@dataclass(frozen=True, kw_only=True)
class ObstacleMemoryConfig:
    """What is remembered, and for how long."""

    max_age_s: float = 15.0  # dead reckoning has gone astray by a decimetre or so by then
    max_range_m: float = 3.0  # a pixel of the base's row weighs too much further away
    cell_m: float = 0.05  # one point is kept in each cell
    min_run_px: int = 4  # obstacle pixels above a base, of a 112-row map; fewer are specks
    # A column is explained by a remembered base this near in bearing, not further than the carpet it
    # hides plus this much.
    explain_rad: float = 0.17
    explain_m: float = 0.3
    min_pitch_rad: float = -1.0  # looking further down, roofs are nearer than bases


def visible_bases(
    groups: NDArray[np.uint8],
    camera: CameraModel,
    gimbal_pitch_rad: float,
    height_m: float,
    *,
    min_run_px: int,
) -> NDArray[np.float64]:
    """Return where obstacles in view meet the carpet.

    Args:
        groups: (H, W) group ids.
        camera: intrinsics at that size.
        gimbal_pitch_rad: when the frame was captured.
        height_m: of the camera above the carpet.
        min_run_px: obstacle pixels that must stand above a base.

    Returns:
        (N, 2) metres forward and right of the point below the camera; a column whose obstacle goes
        down to the image's lower edge shows no base and gives no point.
    """
    obstacle = groups == GROUP_OBSTACLE
    last = obstacle.shape[0] - 1
    columns = np.flatnonzero(obstacle.any(axis=0))
    lowest = last - obstacle[::-1, columns].argmax(axis=0)
    above = np.maximum(lowest - (min_run_px - 1), 0)
    solid = obstacle[above, columns] & (lowest < last - 1)
    columns, lowest = columns[solid], lowest[solid]
    below = groups[lowest + 1, columns]
    # On the background below an obstacle there is no carpet to meet: it is seen across the edge.
    stands = below == GROUP_CARPET
    pixels = np.stack([columns[stands], lowest[stands]], axis=-1)
    return ground_points(pixels, camera, gimbal_pitch_rad, max(height_m, 0.05))


def hidden_bases(
    groups: NDArray[np.uint8], camera: CameraModel, gimbal_pitch_rad: float, height_m: float
) -> NDArray[np.float64]:
    """Return the nearest visible carpet that obstacles hide down to the image's lower edge.

    Such an obstacle stands somewhere between the drone and the point returned, on its bearing: a
    vertical line keeps its bearing.

    Args:
        groups: (H, W) group ids.
        camera: intrinsics at that size.
        gimbal_pitch_rad: when the frame was captured.
        height_m: of the camera above the carpet.

    Returns:
        (N, 2) metres forward and right of the point below the camera.
    """
    last = groups.shape[0] - 1
    columns = np.flatnonzero((groups[last - 1 :] == GROUP_OBSTACLE).all(axis=0))
    pixels = np.stack([columns, np.full_like(columns, last)], axis=-1)
    return ground_points(pixels, camera, gimbal_pitch_rad, max(height_m, 0.05))


class ObstacleMemory:
    """Collects bases, carries them along with the drone's own motion."""

    def __init__(self, config: ObstacleMemoryConfig | None = None) -> None:
        self._config = config or ObstacleMemoryConfig()
        self._odometry = Odometry()
        self._points = np.empty((0, 2))  # odometry frame
        self._seen_s = np.empty(0)
        self._newest_s = -np.inf
        self._unplaced_rad = np.empty(0)  # bearings in the odometry frame

    def predict(self, state: DroneState) -> None:
        """Follow the drone's own motion up to a telemetry sample."""
        now = self._odometry.update(state)
        keep = self._seen_s >= now.time_s - self._config.max_age_s
        self._points, self._seen_s = self._points[keep], self._seen_s[keep]

    def update(self, class_map: ClassMap, frame: Frame, camera: CameraModel) -> None:
        """Take in a class map.

        Args:
            class_map: made from `frame`.
            frame: its telemetry places what is seen.
            camera: intrinsics at the class map's size.
        """
        self._newest_s = frame.captured_s
        self._unplaced_rad = np.empty(0)
        pose = self._odometry.at(frame.captured_s)
        if pose is None or frame.gimbal_pitch_rad < self._config.min_pitch_rad:
            return
        groups = group_of(class_map.ids)
        self._forget_where_carpet_shows(groups, pose, frame, camera)
        cfg = self._config
        run_px = max(1, round(cfg.min_run_px * groups.shape[0] / 112))
        bases = visible_bases(
            groups, camera, frame.gimbal_pitch_rad, frame.height_above_carpet_m, min_run_px=run_px
        )
        bases[:, 0] += camera.forward_offset_m
        near = np.hypot(bases[:, 0], bases[:, 1]) <= cfg.max_range_m
        self._add(_to_odometry(bases[near], pose), frame.captured_s)
        hidden = hidden_bases(groups, camera, frame.gimbal_pitch_rad, frame.height_above_carpet_m)
        hidden[:, 0] += camera.forward_offset_m
        self._unplaced_rad = self._unexplained(hidden, pose) + pose.yaw_rad

    def points(self) -> ObstaclePoints:
        """Return what is remembered, from where the drone is now."""
        pose = self._odometry.now
        if pose is None:
            return ObstaclePoints(points_m=np.empty((0, 2)), captured_s=self._newest_s)
        bearings = self._unplaced_rad - pose.yaw_rad
        return ObstaclePoints(
            points_m=_to_body(self._points, pose),
            captured_s=self._newest_s,
            unplaced_rad=(bearings + np.pi) % (2.0 * np.pi) - np.pi,
        )

    def _forget_where_carpet_shows(
        self,
        groups: NDArray[np.uint8],
        pose: OdometryPose,
        frame: Frame,
        camera: CameraModel,
    ) -> None:
        if not len(self._points):
            return
        local = _to_body(self._points, pose)
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
        self._points, self._seen_s = self._points[~shows_carpet], self._seen_s[~shows_carpet]

    def _unexplained(self, hidden: NDArray[np.float64], pose: OdometryPose) -> NDArray[np.float64]:
        """Return the bearings, from the pose's heading, of what no remembered base explains."""
        bearings = np.arctan2(hidden[:, 1], hidden[:, 0])
        if not len(hidden) or not len(self._points):
            return bearings
        local = _to_body(self._points, pose)
        known_bearings = np.arctan2(local[:, 1], local[:, 0])
        known_ranges = np.hypot(local[:, 0], local[:, 1])
        limits = np.hypot(hidden[:, 0], hidden[:, 1]) + self._config.explain_m
        near = np.abs(bearings[:, None] - known_bearings) < self._config.explain_rad
        explained = (near & (known_ranges <= limits[:, None])).any(axis=1)
        return np.asarray(bearings[~explained])

    def _add(self, points: NDArray[np.float64], time_s: float) -> None:
        # Newest first, so that `unique` keeps the newest point of a cell.
        merged = np.vstack([points, self._points])
        seen_s = np.concatenate([np.full(len(points), time_s), self._seen_s])
        cells = np.floor(merged / self._config.cell_m).astype(np.int64)
        _, first = np.unique(cells, axis=0, return_index=True)
        self._points, self._seen_s = merged[first], seen_s[first]


def _to_odometry(points: NDArray[np.float64], pose: OdometryPose) -> NDArray[np.float64]:
    c, s = np.cos(pose.yaw_rad), np.sin(pose.yaw_rad)
    return np.asarray(points @ np.array([[c, s], [-s, c]]) + (pose.x_m, pose.y_m))


def _to_body(points: NDArray[np.float64], pose: OdometryPose) -> NDArray[np.float64]:
    c, s = np.cos(pose.yaw_rad), np.sin(pose.yaw_rad)
    return np.asarray((points - (pose.x_m, pose.y_m)) @ np.array([[c, -s], [s, c]]))
