"""The map's input from one frame: its points on the ground, capture time and pose."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, Self

import numpy as np

from perception.mapping.contact_scan import (
    MIN_HEIGHT_M,
    Bases,
    GroundScan,
    Placed,
    find_bases,
    ground_pixels,
    scan_ground,
)
from uav_bt.lab.classes import GROUND
from uav_bt.types import CameraModel, ClassMap, Frame, Pose2D
from uav_bt.types.arrays import Flags, Floats
from uav_bt.types.projection import camera_axes, project

# Points further from the camera are not placed. At 1.5 m height and this range one row of the class
# map is 5 cm of ground.
MAX_RANGE_M: Final = 3.0
# The same limit as a ratio of the camera's height, for the map's points. The range error of one
# pixel grows with range squared over height. Chosen.
_MAX_RANGE_RATIO: Final = 2.0
_MIN_PITCH_RAD: Final = -1.0  # of the gimbal; in steeper views roofs hide bases. Chosen.
# A base is used only with another base this near in bearing and range. On the bearing of a vertical
# edge, samples that miss the obstacle below and hit it above look like a base far behind. Chosen.
_BESIDE_RAD: Final = 0.03
_BESIDE_M: Final = 0.12
# Share of the image's width at either end, in which an object may continue beyond the image.
# Chosen.
_CUT_SHARE: Final = 0.025


@dataclass(frozen=True, kw_only=True, eq=False)
class View:
    """Bases and edges of the ground in one frame.

    Points are forward and right of the point below the camera, in metres.
    """

    captured_s: float
    pose: Pose2D  # of the body at capture; dead-reckoned, or in the map's frame after `at`
    camera: CameraModel  # at the class map's size
    pitch_rad: float  # of the gimbal at capture, negative down
    height_m: float  # of the camera above the ground
    class_map: ClassMap
    scan: GroundScan  # the class map along bearings
    contacts: Bases  # the bases and edges of the scan, at any range
    firm: Flags  # which of the placed bases are `bases`
    bases: Placed  # N bases near enough for the map, each with another one beside it
    edges_m: Floats  # (M, 2) edges of the ground near enough for the map

    @classmethod
    def of(
        cls, class_map: ClassMap, frame: Frame, camera: CameraModel, pose: Pose2D
    ) -> Self | None:
        """Return the view of a frame; None when the camera looks too far down.

        The camera is at the class map's size; the pose is the dead-reckoned one of the body at
        capture.
        """
        if frame.gimbal_pitch_rad < _MIN_PITCH_RAD:
            return None
        scan = scan_ground(class_map, frame, camera)
        contacts, height_m = find_bases(scan), frame.height_above_ground_m
        placed = contacts.placed
        legs = class_map.classes.legs_m[placed.ids] > 0.0
        firm = _are_firm(placed.xy_m, legs) & (np.hypot(*placed.xy_m.T) <= _reach_m(height_m))
        near = np.hypot(*contacts.edges_m.T) <= _reach_m(height_m)
        return cls(
            captured_s=frame.captured_s,
            pose=pose,
            camera=camera,
            pitch_rad=frame.gimbal_pitch_rad,
            height_m=height_m,
            class_map=class_map,
            scan=scan,
            contacts=contacts,
            firm=firm,
            bases=placed.take(firm),
            edges_m=contacts.edges_m[near],
        )

    @property
    def reach_m(self) -> float:
        """Range up to which points of the map are used, m."""
        return _reach_m(self.height_m)

    @cached_property
    def lens(self) -> Pose2D:
        """Position and heading of the camera, in the frame of `pose`."""
        x_m, y_m = self.pose.to_world(self.camera.forward_offset_m, 0.0)
        return replace(self.pose, x_m=x_m, y_m=y_m)

    def at(self, pose: Pose2D) -> Self:
        """Return the same view with another pose of the body, in the map's frame."""
        return replace(self, pose=pose)

    def without(self, centre: Pose2D, radius_m: float) -> Self:
        """Return the view without the bases within a circle in the frame of `pose`."""
        centre_m = self.lens.to_body(centre.x_m, centre.y_m)
        tables = self.contacts.placed, self.bases
        placed, bases = (np.hypot(*(each.xy_m - centre_m).T) > radius_m for each in tables)
        return replace(
            self,
            contacts=replace(self.contacts, placed=self.contacts.placed.take(placed)),
            firm=self.firm[placed],
            bases=self.bases.take(bases),
        )

    def body_m(self, points_m: Floats) -> Floats:
        """Return points of the view, (N, 2), forward and right of the body's centre."""
        return np.asarray(points_m + np.array([self.camera.forward_offset_m, 0.0]))

    def shows_ground(self, points_m: Floats) -> tuple[Flags, Flags]:
        """Return which points, (..., 2), lie in the image, and which of them show free ground.

        Ground below the board of an object on legs is not free.
        """
        height_m, roles = max(self.height_m, MIN_HEIGHT_M), self.class_map.roles
        axes, pinhole_px = camera_axes(self.pitch_rad), self.camera.pinhole_px
        flat_m = np.ascontiguousarray(points_m).reshape(-1, 2)
        pixels = ground_pixels(flat_m, height_m, axes, pinhole_px, roles.shape, False)
        pixels = pixels.reshape(points_m.shape[:-1])
        inside = pixels >= 0
        shows = inside & (roles.take(pixels) == GROUND)
        if self.scan.covered is not None:
            shows &= ~self.scan.covered.holds(points_m)
        return inside, shows

    def is_cut(self, arrived: Flags) -> Flags:
        """Return which of `bases` may be followed by more of the same obstacle, (N,).

        It goes on beyond the end of the image, behind a nearer obstacle, beyond the reach of the
        map, or with bases that have not `arrived`, (N,), on ground that was seen free before.
        """
        down_m = np.full((len(self.bases.xy_m), 1), self.height_m)
        columns = project(np.hstack([self.bases.xy_m, down_m]), self.camera, self.pitch_rad)[:, 0]
        margin_px = _CUT_SHARE * self.camera.width_px
        ends = (columns < margin_px) | (columns > self.camera.width_px - margin_px)
        others_m = np.vstack([self.contacts.placed.xy_m[~self.firm], self.contacts.hidden_m])
        points_m = np.vstack([self.bases.xy_m, others_m])
        inside = np.concatenate([arrived, np.zeros(len(others_m), dtype=bool)])
        ranges_m, bearings_rad = np.hypot(*points_m.T), np.arctan2(*points_m.T[::-1])
        order = np.argsort(bearings_rad)
        inside, ranges_m, bearings_rad = inside[order], ranges_m[order], bearings_rad[order]
        beside = np.diff(bearings_rad) <= _BESIDE_RAD
        nearer = np.diff(ranges_m)
        cut = np.zeros(len(points_m), dtype=bool)
        cut[order[:-1]] |= inside[:-1] & ~inside[1:] & beside & (nearer < 0.2)
        cut[order[1:]] |= inside[1:] & ~inside[:-1] & beside & (nearer > -0.2)
        return np.asarray(ends | cut[: len(ends)])


def _reach_m(height_m: float) -> float:
    return min(MAX_RANGE_M, _MAX_RANGE_RATIO * height_m)


def _are_firm(points_m: Floats, legs: Flags) -> Flags:
    """Return which points, sorted by bearing, have another one beside them, or are legs.

    A leg may be as narrow as one bearing; it is nearer than what the bearings beside it show.
    """
    ranges_m, bearings_rad = np.hypot(*points_m.T), np.arctan2(*points_m.T[::-1])
    beside, further_m = np.diff(bearings_rad) <= _BESIDE_RAD, np.diff(ranges_m)
    alike = beside & (np.abs(further_m) <= _BESIDE_M)
    firm, nearer = np.zeros(len(points_m), dtype=bool), legs.copy()
    nearer[1:] &= ~beside | (further_m < 0.0)
    nearer[:-1] &= ~beside | (further_m > 0.0)
    firm[1:] |= alike
    firm[:-1] |= alike
    return firm | nearer
