"""The objects of the map: points of one class that stand together."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.cluster.hierarchy import fcluster, linkage

from perception.mapping.landmarks import Landmarks
from uav_bt.classes import standing_classes
from uav_bt.types import rotation
from uav_bt.types.arrays import Floats
from uav_bt.types.site_map import MapObject


@dataclass(frozen=True, kw_only=True)
class ObjectConfig:
    """What makes an object of points."""

    apart_m: float = 0.3  # points of one class further apart are two objects
    min_points: int = 4
    min_seen_s: float = 0.3  # shorter sights are specks of the mask
    # A box seen from one side shows a line: what stands behind it is assumed to be as deep as
    # boxes are.
    depth_m: float = 0.4
    yaws: int = 45  # at which rectangles are tried, in a quarter turn: 2 degrees apart; chosen
    near_m: float = 0.02  # points this near to a side lie on it; chosen


def find_objects(points: Landmarks, config: ObjectConfig | None = None) -> tuple[MapObject, ...]:
    """Return the objects that stand in the place, by class and then by position.

    Args:
        points: where obstacles meet the ground.
        config: what makes an object.
    """
    config = config or ObjectConfig()
    found: list[MapObject] = []
    lasting = points.take(points.seen_s - points.first_s >= config.min_seen_s)
    for class_id in standing_classes():
        of_class = lasting.take(lasting.ids == class_id)
        if len(of_class) < config.min_points:
            continue
        labels = fcluster(linkage(of_class.xy_m), config.apart_m, criterion="distance")
        for label in range(1, labels.max() + 1):
            members = of_class.take(labels == label)
            if len(members) >= config.min_points:
                found.append(_object(class_id, members, config))
    return tuple(found)


def _object(class_id: int, members: Landmarks, config: ObjectConfig) -> MapObject:
    """Return the object of some points: the rectangle that they are the sides of, made deep enough.

    The rectangle's thin side grows away from where it was seen.
    """
    yaw_rad = _yaw_of_sides(members.xy_m, config)
    axes = rotation(yaw_rad)  # its columns
    along_m, from_m = members.xy_m @ axes, members.from_m @ axes
    low_m, high_m = along_m.min(axis=0), along_m.max(axis=0)
    missing_m = np.maximum(config.depth_m - (high_m - low_m), 0.0)
    middle_m = (low_m + high_m) / 2
    seen_from = np.sign((from_m - middle_m).mean(axis=0))
    x_m, y_m = axes @ (middle_m - seen_from * missing_m / 2)
    sides_m = high_m - low_m + missing_m
    longer = int(sides_m.argmax())
    return MapObject(
        class_id=class_id,
        x_m=float(x_m),
        y_m=float(y_m),
        size_m=float(sides_m[longer]),
        width_m=float(sides_m[1 - longer]),
        yaw_rad=yaw_rad + longer * math.pi / 2,
        std_m=float(missing_m.max() / 2 + 0.03),
        seen_s=float(members.seen_s.max()),
    )


def _yaw_of_sides(points_m: Floats, config: ObjectConfig) -> float:
    """Return how the rectangle lies on whose sides points are, by the closeness to its sides.

    The smallest rectangle around two sides lies along them or across, by chance. (Zhang et al.:
    Efficient L-Shape Fitting for Vehicle Detection Using Laser Scanners, IV 2017.)
    """
    yaws, axes = _axes(config.yaws)
    along_m = points_m @ axes  # (yaws, N, 2)
    to_low_m = along_m - along_m.min(axis=1, keepdims=True)
    to_high_m = along_m.max(axis=1, keepdims=True) - along_m
    to_side_m = np.minimum(to_low_m, to_high_m).min(axis=-1)
    return float(yaws[(1.0 / np.maximum(to_side_m, config.near_m)).sum(axis=1).argmax()])


@cache
def _axes(count: int) -> tuple[Floats, Floats]:
    """Return a number of yaws in a quarter turn, and the axes there, (count, 2, 2)."""
    yaws = np.linspace(0.0, math.pi / 2, count, endpoint=False)
    return yaws, np.stack([rotation(yaw) for yaw in yaws])
