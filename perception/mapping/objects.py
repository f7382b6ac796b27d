"""The objects of the map: clusters of points of one class."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache
from itertools import combinations

import numpy as np

from perception.mapping.landmarks import Landmarks
from perception.mapping.tables import clusters
from uav_bt.compiled import compiled
from uav_bt.types import rotation
from uav_bt.types.arrays import Floats, Indices
from uav_bt.types.ground import Footprint
from uav_bt.types.site_map import MapObject


@dataclass(frozen=True, kw_only=True)
class ObjectConfig:
    """Which points form an object."""

    apart_m: float = 0.3  # points of one class further apart are two objects
    min_points: int = 4  # of an object
    min_seen_s: float = 0.3  # points seen for a shorter time are mask noise
    # A box seen from one side shows only a line. Its assumed depth is the usual depth of boxes.
    depth_m: float = 0.4
    yaws: int = 45  # number of yaws tried for rectangles in a quarter turn: 2 degrees; chosen
    near_m: float = 0.02  # points this near to a side lie on it; chosen
    min_feet: int = 2  # points of an object on legs; one point may be a leg; chosen
    spread_m: float = 0.1  # error of the distance between two legs; chosen
    # Points of one leg spread by decimetres when the map drifts. This share of the distances
    # between the points of two legs must be short enough. Chosen.
    agree: float = 0.8
    # A cluster is of several objects if 5 % of its distances exceed the longest by this factor.
    # Chosen.
    several: float = 1.2


def find_objects(
    points: Landmarks,
    standing: Iterable[int],
    config: ObjectConfig | None = None,
    *,
    legs_m: Floats | None = None,
) -> tuple[MapObject, ...]:
    """Return the objects that stand in the place, by class and then by position.

    Args:
        points: points where obstacles meet the ground.
        standing: ids of the classes that stand on the ground.
        config: which points form an object.
        legs_m: (number of classes,) largest distance between legs of an object, 0 without legs;
            default: no class has legs.
    """
    config = config or ObjectConfig()
    found: list[MapObject] = []
    lasting = points.take(points.seen_s - points.first_s >= config.min_seen_s)
    for class_id in standing:
        of_class = lasting.take(lasting.ids == class_id)
        if legs_m is not None and legs_m[class_id] > 0.0:
            found += _on_legs(class_id, of_class, float(legs_m[class_id]), config)
            continue
        if len(of_class) < config.min_points:
            continue
        labels = clusters(of_class.xy_m, config.apart_m)
        counts = np.bincount(labels)
        parts = [
            of_class.take(labels == label) for label in np.flatnonzero(counts >= config.min_points)
        ]
        found += _objects(class_id, parts, config)
    return tuple(found)


def _on_legs(
    class_id: int, points: Landmarks, span_m: float, config: ObjectConfig
) -> list[MapObject]:
    """Return the objects on legs of one class.

    A leg is a cluster, or a side with the points on it. From the outermost cluster on, those
    nearest to it are of its object, as long as they are not further apart than its legs.
    A cluster of several objects, side by side, is divided into its points.
    """
    if not len(points):
        return []
    apart_m = np.hypot(*np.moveaxis(points.xy_m[:, None] - points.xy_m, -1, 0))
    labels, max_m = clusters(points.xy_m, config.apart_m), span_m + config.spread_m
    nodes: list[Indices] = []
    for label in range(labels.max() + 1):
        rows = np.flatnonzero(labels == label)
        wide_m = np.quantile(apart_m[np.ix_(rows, rows)], 0.95)
        nodes += [rows] if wide_m <= config.several * max_m else np.split(rows, len(rows))
    parts = []
    while nodes:
        middle_m = points.xy_m[np.concatenate(nodes)].mean(axis=0)
        outer = [
            (len(rows) > 1, np.hypot(*(points.xy_m[rows] - middle_m).T).max()) for rows in nodes
        ]
        group = nodes.pop(max(range(len(nodes)), key=outer.__getitem__))
        to_m = [apart_m[np.ix_(group, rows)].min() for rows in nodes]
        left = []
        for index in np.argsort(to_m, kind="stable"):
            to_group_m = apart_m[np.ix_(group, nodes[index])]
            if np.quantile(to_group_m, config.agree) <= max_m:
                group = np.concatenate([group, nodes[index]])
            else:
                left.append(nodes[index])
        nodes = left
        if len(group) >= config.min_feet:
            parts.append(points.take(np.sort(group)))
    return _objects(class_id, parts, config, on_legs=True)


def _objects(
    class_id: int, parts: list[Landmarks], config: ObjectConfig, *, on_legs: bool = False
) -> list[MapObject]:
    """Return the objects of clusters of one class.

    Opposite sides of one box are two clusters, and each makes a whole base. Clusters with bases
    that overlap are one object.
    """
    found = [_object(class_id, part, config, on_legs=on_legs) for part in parts]
    for first, second in combinations(range(len(found)), 2):
        if _footprint(found[first]).overlaps(_footprint(found[second])):
            rest = [part for index, part in enumerate(parts) if index not in {first, second}]
            joined = [*rest, parts[first].with_rows(parts[second])]
            return _objects(class_id, joined, config, on_legs=on_legs)
    return found


def _footprint(item: MapObject) -> Footprint:
    return Footprint(
        x_m=item.x_m,
        y_m=item.y_m,
        yaw_rad=item.yaw_rad,
        half_x_m=item.size_m / 2,
        half_y_m=item.width_m / 2,
    )


def _object(class_id: int, members: Landmarks, config: ObjectConfig, *, on_legs: bool) -> MapObject:
    """Return the object of some points: the rectangle with the points on its sides.

    A side shorter than the assumed depth is extended away from the camera.
    """
    yaw_rad = (_yaw_of_legs if on_legs else _yaw_of_sides)(members.xy_m, config)
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
        points=len(members),
    )


def _yaw_of_sides(points_m: Floats, config: ObjectConfig) -> float:
    """Return the yaw of the rectangle with the points on its sides, by the closeness criterion.

    The smallest rectangle around two sides would lie along or across them by chance. (Zhang et al.:
    Efficient L-Shape Fitting for Vehicle Detection Using Laser Scanners, IV 2017.)
    """
    yaws, axes = _axes(config.yaws)
    return float(yaws[_closeness(points_m, axes, config.near_m).argmax()])


def _yaw_of_legs(points_m: Floats, config: ObjectConfig) -> float:
    """Return the yaw of the rectangle around legs with the shortest sides.

    Four legs are the corners of their rectangle, and every other rectangle around them has points
    on its sides, too.
    """
    yaws, axes = _axes(config.yaws)
    sides_m = np.ptp(points_m @ axes, axis=1).sum(axis=1)
    return float(yaws[sides_m.argmin()])


@compiled("float64[::1](float64[:, ::1], float64[:, :, ::1], float64)")
def _closeness(points_m: Floats, axes: Floats, near_m: float) -> Floats:
    """Return the closeness of points to the sides of the rectangles around them.

    Args:
        points_m: (N, 2) points.
        axes: (K, 2, 2) axes of the rectangles, in columns.
        near_m: points this near to a side lie on it.

    Returns:
        (K,) sum of the inverse distances to the nearest sides, 1/m.
    """
    closeness = np.zeros(len(axes))
    along_m = np.empty(points_m.shape)
    for yaw in range(len(axes)):
        low_x, high_x, low_y, high_y = np.inf, -np.inf, np.inf, -np.inf
        for point in range(len(points_m)):
            x_m = points_m[point, 0] * axes[yaw, 0, 0] + points_m[point, 1] * axes[yaw, 1, 0]
            y_m = points_m[point, 0] * axes[yaw, 0, 1] + points_m[point, 1] * axes[yaw, 1, 1]
            low_x, high_x = min(low_x, x_m), max(high_x, x_m)
            low_y, high_y = min(low_y, y_m), max(high_y, y_m)
            along_m[point, 0], along_m[point, 1] = x_m, y_m
        for point in range(len(points_m)):
            x_m, y_m = along_m[point, 0], along_m[point, 1]
            to_x_m, to_y_m = min(x_m - low_x, high_x - x_m), min(y_m - low_y, high_y - y_m)
            closeness[yaw] += 1.0 / max(min(to_x_m, to_y_m), near_m)
    return closeness


@cache
def _axes(count: int) -> tuple[Floats, Floats]:
    """Return `count` yaws in a quarter turn, and their axes, (count, 2, 2)."""
    yaws = np.linspace(0.0, math.pi / 2, count, endpoint=False)
    return yaws, np.stack([rotation(yaw) for yaw in yaws])
