"""The map's input from one frame: its points on the ground, capture time and pose."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Final, Self

import numpy as np

from perception.mapping import scan_loops
from perception.mapping.contact_scan import (
    Bases,
    ContactScanConfig,
    GroundScan,
    find_bases,
    scan_ground,
)
from uav_bt.types import CameraModel, ClassMap, Frame, Pose2D
from uav_bt.types.arrays import Flags, Floats
from uav_bt.types.projection import camera_axes, project

MIN_HEIGHT_M: Final = 0.05  # chosen; lower heights are raised to this to avoid division by zero


@dataclass(frozen=True, kw_only=True)
class ViewConfig:
    """Which frames and which of their points are used for the map."""

    # Lowest pitch of the gimbal; in steeper views roofs hide bases. Chosen.
    min_pitch_rad: float = -1.0
    # Points further from the camera are not placed. At 1.5 m height and this range one row of the
    # class map is 5 cm of ground.
    max_range_m: float = 3.0
    # The same limit as a ratio of the camera's height, for the map's points. The range error of one
    # pixel grows with range squared over height. Chosen.
    max_range_ratio: float = 2.0
    # A base is used only with another base this near in bearing and range. On the bearing of a
    # vertical edge, samples that miss the obstacle below and hit it above look like a base far
    # behind. Both chosen.
    beside_rad: float = 0.03
    beside_m: float = 0.12
    # Share of the image's width at either end, in which an object may continue beyond the image.
    # Chosen.
    cut_share: float = 0.025
    # Resolution of the scan.
    scan: ContactScanConfig = field(default_factory=ContactScanConfig)


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """Bases and edges of the ground in one frame.

    Points are forward and right of the point below the camera, in metres.

    Attributes:
        captured_s: Capture time of the frame.
        pose: Pose of the body at capture; dead-reckoned, or in the map's frame after `at`.
        camera: Intrinsics at the class map's size.
        pitch_rad: Pitch of the gimbal at capture, negative down.
        height_m: Height of the camera above the ground.
        config: Which points are used.
        scan: The class map along bearings.
        contacts: The bases and edges of the scan, at any range.
        bases_m: (N, 2) bases near enough for the map, each with another one beside it.
        base_ids: (N,) classes of the obstacles there.
        base_heights_m: (N,) heights of their upper edges; NaN where the roof is not in view.
        edges_m: (M, 2) edges of the ground near enough for the map.
    """

    captured_s: float
    pose: Pose2D
    camera: CameraModel
    pitch_rad: float
    height_m: float
    config: ViewConfig
    scan: GroundScan
    contacts: Bases
    bases_m: Floats
    base_ids: np.ndarray[tuple[int, ...], np.dtype[np.uint8]]
    base_heights_m: Floats
    edges_m: Floats

    @classmethod
    def of(
        cls,
        class_map: ClassMap,
        frame: Frame,
        camera: CameraModel,
        pose: Pose2D,
        config: ViewConfig | None = None,
    ) -> Self | None:
        """Return the view of a frame.

        Args:
            class_map: class map of `frame`.
            frame: its gimbal pitch and height place its points.
            camera: intrinsics at the class map's size.
            pose: dead-reckoned pose of the body at the frame's capture.
            config: which points are used.

        Returns:
            The view; None when the camera looks too far down.
        """
        config = config or ViewConfig()
        if frame.gimbal_pitch_rad < config.min_pitch_rad:
            return None
        scan = scan_ground(class_map, frame, camera, config.scan)
        contacts, height_m = find_bases(scan), frame.height_above_ground_m
        reach_m = min(config.max_range_m, config.max_range_ratio * height_m)
        firm = _have_neighbours(contacts.placed_m, config)
        legs = class_map.classes.legs_m[contacts.placed_ids] > 0.0
        firm |= legs & _stand_out(contacts.placed_m, config)
        firm &= np.hypot(*contacts.placed_m.T) <= reach_m
        near = np.hypot(*contacts.edges_m.T) <= reach_m
        return cls(
            captured_s=frame.captured_s,
            pose=pose,
            camera=camera,
            pitch_rad=frame.gimbal_pitch_rad,
            height_m=height_m,
            config=config,
            scan=scan,
            contacts=contacts,
            bases_m=contacts.placed_m[firm],
            base_ids=contacts.placed_ids[firm],
            base_heights_m=contacts.placed_heights_m[firm],
            edges_m=contacts.edges_m[near],
        )

    @property
    def reach_m(self) -> float:
        """Range up to which points of the map are used, m."""
        return min(self.config.max_range_m, self.config.max_range_ratio * self.height_m)

    @cached_property
    def lens(self) -> Pose2D:
        """Position and heading of the camera, in the frame of `pose`."""
        x_m, y_m = self.pose.to_world(self.camera.forward_offset_m, 0.0)
        return replace(self.pose, x_m=x_m, y_m=y_m)

    def at(self, pose: Pose2D) -> Self:
        """Return the same view with another pose of the body, in the map's frame."""
        return replace(self, pose=pose)

    def without(self, centre: Pose2D, radius_m: float) -> Self:
        """Return the view without the bases within a circle.

        Args:
            centre: middle of the circle, in the frame of `pose`.
            radius_m: radius of the circle.
        """
        forward_m, right_m = self.lens.to_body(centre.x_m, centre.y_m)

        def outside(points_m: Floats) -> Flags:
            return np.asarray(np.hypot(*(points_m - (forward_m, right_m)).T) > radius_m)

        placed, bases = outside(self.contacts.placed_m), outside(self.bases_m)
        return replace(
            self,
            contacts=replace(
                self.contacts,
                placed_m=self.contacts.placed_m[placed],
                placed_ids=self.contacts.placed_ids[placed],
                placed_heights_m=self.contacts.placed_heights_m[placed],
            ),
            bases_m=self.bases_m[bases],
            base_ids=self.base_ids[bases],
            base_heights_m=self.base_heights_m[bases],
        )

    def body_m(self, points_m: Floats) -> Floats:
        """Return points of the view, (N, 2), forward and right of the body's centre."""
        return np.asarray(points_m + np.array([self.camera.forward_offset_m, 0.0]))

    def shows_ground(self, points_m: Floats) -> tuple[Flags, Flags]:
        """Return which points lie in the image, and which of them show free ground.

        Ground below the board of an object on legs is not free.

        Args:
            points_m: (..., 2) on the ground, forward and right of the point below the camera.

        Returns:
            Two arrays of flags, (...).
        """
        places_m = np.ascontiguousarray(points_m.reshape(-1, 2))
        inside, shows = scan_loops.looked_up(
            places_m,
            max(self.height_m, MIN_HEIGHT_M),
            self.scan.image_roles,
            camera_axes(self.pitch_rad),
            self.camera.pinhole_px,
        )
        if self.scan.covered is not None:
            shows &= ~self.scan.covered.holds(places_m)
        shape = points_m.shape[:-1]
        return inside.reshape(shape), shows.reshape(shape)

    def is_cut(self, arrived: Flags) -> Flags:
        """Return which of `bases_m` may be followed by more of the same obstacle, (N,).

        It goes on beyond the end of the image, behind a nearer obstacle, beyond the reach of the
        map, or with bases that have not arrived.

        Args:
            arrived: (N,) bases on ground that was seen free before.
        """
        down_m = np.full((len(self.bases_m), 1), self.height_m)
        columns = project(np.hstack([self.bases_m, down_m]), self.camera, self.pitch_rad)[:, 0]
        margin_px = self.config.cut_share * self.camera.width_px
        ends = (columns < margin_px) | (columns > self.camera.width_px - margin_px)
        placed, bases = self.contacts.placed_m @ (1.0, 1.0j), self.bases_m @ (1.0, 1.0j)
        others_m = np.vstack(
            [self.contacts.placed_m[~np.isin(placed, bases)], self.contacts.hidden_m]
        )
        points_m = np.vstack([self.bases_m, others_m])
        inside = np.concatenate([arrived, np.zeros(len(others_m), dtype=bool)])
        ranges_m, bearings_rad = np.hypot(*points_m.T), np.arctan2(*points_m.T[::-1])
        order = np.argsort(bearings_rad)
        inside, ranges_m, bearings_rad = inside[order], ranges_m[order], bearings_rad[order]
        beside = np.diff(bearings_rad) <= self.config.beside_rad
        nearer = np.diff(ranges_m)
        cut = np.zeros(len(points_m), dtype=bool)
        cut[order[:-1]] |= inside[:-1] & ~inside[1:] & beside & (nearer < 0.2)
        cut[order[1:]] |= inside[1:] & ~inside[:-1] & beside & (nearer > -0.2)
        return np.asarray(ends | cut[: len(ends)])


def _have_neighbours(points_m: Floats, config: ViewConfig) -> Flags:
    """Return which points, sorted by bearing, have another point beside them."""
    ranges_m, bearings_rad = np.hypot(*points_m.T), np.arctan2(*points_m.T[::-1])
    alike = (np.abs(np.diff(bearings_rad)) <= config.beside_rad) & (
        np.abs(np.diff(ranges_m)) <= config.beside_m
    )
    found = np.zeros(len(points_m), dtype=bool)
    found[1:] |= alike
    found[:-1] |= alike
    return found


def _stand_out(points_m: Floats, config: ViewConfig) -> Flags:
    """Return which points, sorted by bearing, are nearer than those on the bearings beside them.

    A leg may be as narrow as one bearing.
    """
    ranges_m, bearings_rad = np.hypot(*points_m.T), np.arctan2(*points_m.T[::-1])
    beside = np.diff(bearings_rad) <= config.beside_rad
    nearer = np.ones(len(points_m), dtype=bool)
    nearer[1:] &= ~beside | (np.diff(ranges_m) < 0.0)
    nearer[:-1] &= ~beside | (np.diff(ranges_m) > 0.0)
    return nearer
