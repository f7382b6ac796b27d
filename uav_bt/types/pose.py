"""Poses in a level plane, and rotations within it.

The same formulas serve both conventions of the project, because in each the yaw turns the first
axis towards the second:

*world*          x, y with z up; yaw counter-clockwise; a body's axes are forward and left;
*dead reckoning* x along yaw 0, y to its right, z down; yaw clockwise, as the drone reports it; a
                 body's axes are forward and right.

A vector given as forward and right enters the world with its second number negated.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from uav_bt.types.arrays import Floats


def wrap_angle(angle_rad: float) -> float:
    """Return the angle folded into [-pi, pi)."""
    return (angle_rad + math.pi) % (2.0 * math.pi) - math.pi


def wrap_angles(angles_rad: Floats) -> Floats:
    """Return angles of any shape folded into [-pi, pi)."""
    return np.asarray((angles_rad + math.pi) % (2.0 * math.pi) - math.pi)


def rotation(yaw_rad: float) -> Floats:
    """Return the matrix, (2, 2), that turns column vectors by a yaw."""
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    return np.array([[c, -s], [s, c]])


def rotate(x: float, y: float, yaw_rad: float) -> tuple[float, float]:
    """Return a vector turned by a yaw."""
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    return c * x - s * y, s * x + c * y


def rotate_points(points: Floats, yaw_rad: float) -> Floats:
    """Return vectors, (N, 2), turned by a yaw."""
    return np.asarray(points.dot(rotation(yaw_rad).T))  # for few points twice as fast as `@`


@dataclass(frozen=True, kw_only=True)
class Pose2D:
    """Position and heading of a body in a level plane, in either convention."""

    x_m: float
    y_m: float
    yaw_rad: float

    def pose_to_world(self, pose: Pose2D) -> Pose2D:
        """Return a pose relative to this one in the frame of this one."""
        x_m, y_m = self.to_world(pose.x_m, pose.y_m)
        return Pose2D(x_m=x_m, y_m=y_m, yaw_rad=pose.yaw_rad + self.yaw_rad)

    def pose_to_body(self, pose: Pose2D) -> Pose2D:
        """Return a pose of this pose's frame relative to this one."""
        x_m, y_m = self.to_body(pose.x_m, pose.y_m)
        return Pose2D(x_m=x_m, y_m=y_m, yaw_rad=pose.yaw_rad - self.yaw_rad)

    def to_world(self, forward_m: float, side_m: float) -> tuple[float, float]:
        """Return a point in this pose's frame; its side is left (world), right (dead reckoning)."""
        c, s = math.cos(self.yaw_rad), math.sin(self.yaw_rad)
        return self.x_m + c * forward_m - s * side_m, self.y_m + s * forward_m + c * side_m

    def to_body(self, x_m: float, y_m: float) -> tuple[float, float]:
        """Return a point of the pose's frame relative to the pose: forward, and to its side."""
        return rotate(x_m - self.x_m, y_m - self.y_m, -self.yaw_rad)

    def points_to_world(self, points_m: Floats) -> Floats:
        """Return points, (N, 2) forward and to the side, in the frame of the pose."""
        return np.asarray(rotate_points(points_m, self.yaw_rad) + np.array([self.x_m, self.y_m]))

    def points_to_body(self, points_m: Floats) -> Floats:
        """Return points, (N, 2) in the pose's frame, relative to the pose: forward, side."""
        return rotate_points(points_m - np.array([self.x_m, self.y_m]), -self.yaw_rad)

    def rectangle(self, half_x_m: float, half_y_m: float) -> list[tuple[float, float]]:
        """Return the corners of a rectangle around this pose, in the direction of growing yaw."""
        a, b = half_x_m, half_y_m
        return [self.to_world(*corner) for corner in ((a, b), (-a, b), (-a, -b), (a, -b))]

    def towards(self, other: Self, share: float) -> Self:
        """Return the pose a share (0 to 1) of the way to another, turned the short way."""
        turn = math.remainder(other.yaw_rad - self.yaw_rad, 2.0 * math.pi)
        return replace(
            self,
            x_m=self.x_m + share * (other.x_m - self.x_m),
            y_m=self.y_m + share * (other.y_m - self.y_m),
            yaw_rad=self.yaw_rad + share * turn,
        )


@dataclass(frozen=True, kw_only=True)
class Pose(Pose2D):
    """A pose in the world: z up, yaw counter-clockwise from +x, origin in the ground's middle."""

    z_m: float

    def towards(self, other: Self, share: float) -> Self:
        """Return the pose a share (0 to 1) of the way to another, turned the short way."""
        z_m = self.z_m + share * (other.z_m - self.z_m)
        return replace(super().towards(other, share), z_m=z_m)


def clamp(value: float, limit: float) -> float:
    """Return a value bounded to [-limit, limit]."""
    return max(-limit, min(limit, value))


def limit_length(x: float, y: float, limit: float) -> tuple[float, float]:
    """Return a horizontal vector shortened to a length; its direction stays."""
    length = math.hypot(x, y)
    if length <= limit:
        return x, y
    share = limit / length
    return x * share, y * share
