"""The objects of the map: clusters of points of one class, and their sizes."""

from __future__ import annotations

import math
from collections.abc import Iterable
from itertools import combinations
from typing import Final

import numpy as np

from perception.mapping.landmarks import Landmarks, clusters
from uav_bt.types import rotation
from uav_bt.types.arrays import Floats, Indices
from uav_bt.types.ground import Footprint
from uav_bt.types.site_map import MapObject

_APART_M: Final = 0.3  # points of one class further apart are two objects
_MIN_POINTS: Final = 4  # of an object
_MIN_SEEN_S: Final = 0.3  # points seen for a shorter time are mask noise
# A box seen from one side shows only a line. Its assumed depth is the usual depth of boxes.
_DEPTH_M: Final = 0.4
_NEAR_M: Final = 0.02  # points this near to a side lie on it; chosen
_MIN_FEET: Final = 2  # points of an object on legs; one point may be a leg; chosen
_SPREAD_M: Final = 0.1  # error of the distance between two legs; chosen
# Points of one leg spread by decimetres when the map drifts. This share of the distances between
# the points of two legs must be short enough. Chosen.
_AGREE: Final = 0.8
# A cluster is of several objects if 5 % of its distances exceed the longest by this factor. Chosen.
_SEVERAL: Final = 1.2
# The tried yaws of rectangles in a quarter turn, 2 degrees apart, and their axes, (45, 2, 2)
_YAWS: Final = np.linspace(0.0, math.pi / 2, 45, endpoint=False)
_AXES: Final = np.stack([rotation(yaw) for yaw in _YAWS])


def find_objects(
    points: Landmarks, standing: Iterable[int], legs_m: Floats
) -> tuple[MapObject, ...]:
    """Return the objects that stand in the place, by class and then by position.

    Args:
        points: points where obstacles meet the ground.
        standing: ids of the classes that stand on the ground.
        legs_m: (number of classes,) largest distance between legs of an object, 0 without legs.
    """
    found: list[MapObject] = []
    lasting = points.take(points.seen_s - points.first_s >= _MIN_SEEN_S)
    for class_id in standing:
        of_class = lasting.take(lasting.ids == class_id)
        on_legs = legs_m[class_id] > 0.0
        if len(of_class) < (1 if on_legs else _MIN_POINTS):
            continue
        if on_legs:
            groups = _on_legs(of_class.xy_m, float(legs_m[class_id]) + _SPREAD_M)
        else:
            labels = clusters(of_class.xy_m, _APART_M)
            large = np.flatnonzero(np.bincount(labels) >= _MIN_POINTS)
            groups = [np.flatnonzero(labels == label) for label in large]
        found += _objects(class_id, [of_class.take(rows) for rows in groups], on_legs=on_legs)
    return tuple(found)


def _on_legs(xy_m: Floats, max_m: float) -> list[Indices]:
    """Return the rows of the objects on legs of one class.

    A leg is a cluster, or a side with the points on it. From the outermost cluster on, those
    nearest to it are of its object, as long as they are not further apart than its legs.
    A cluster of several objects, side by side, is divided into its points.
    """
    apart_m = np.hypot(*np.moveaxis(xy_m[:, None] - xy_m, -1, 0))
    labels = clusters(xy_m, _APART_M)
    nodes: list[Indices] = []
    for label in range(labels.max() + 1):
        rows = np.flatnonzero(labels == label)
        wide_m = np.quantile(apart_m[np.ix_(rows, rows)], 0.95)
        nodes += [rows] if wide_m <= _SEVERAL * max_m else np.split(rows, len(rows))
    groups = []
    while nodes:
        middle_m = xy_m[np.concatenate(nodes)].mean(axis=0)
        outer = [(len(rows) > 1, np.hypot(*(xy_m[rows] - middle_m).T).max()) for rows in nodes]
        group = nodes.pop(max(range(len(nodes)), key=outer.__getitem__))
        to_m = [apart_m[np.ix_(group, rows)].min() for rows in nodes]
        left = []
        for index in np.argsort(to_m, kind="stable"):
            if np.quantile(apart_m[np.ix_(group, nodes[index])], _AGREE) <= max_m:
                group = np.concatenate([group, nodes[index]])
            else:
                left.append(nodes[index])
        nodes = left
        if len(group) >= _MIN_FEET:
            groups.append(np.sort(group))
    return groups


def _objects(class_id: int, parts: list[Landmarks], *, on_legs: bool) -> list[MapObject]:
    """Return the objects of clusters of one class.

    Opposite sides of one box are two clusters, and each makes a whole base. Clusters with bases
    that overlap are one object.
    """
    found = [_object(class_id, part, on_legs=on_legs) for part in parts]
    for first, second in combinations(range(len(found)), 2):
        if _footprint(found[first]).overlaps(_footprint(found[second])):
            rest = [part for index, part in enumerate(parts) if index not in {first, second}]
            return _objects(
                class_id, [*rest, parts[first].with_rows(parts[second])], on_legs=on_legs
            )
    return found


def _footprint(item: MapObject) -> Footprint:
    return Footprint(
        x_m=item.x_m,
        y_m=item.y_m,
        yaw_rad=item.yaw_rad,
        half_x_m=item.size_m / 2,
        half_y_m=item.width_m / 2,
    )


def _object(class_id: int, members: Landmarks, *, on_legs: bool) -> MapObject:
    """Return the object of some points: the rectangle with the points on its sides.

    A side shorter than the assumed depth is extended away from the camera.
    """
    if on_legs:
        # Four legs are the corners of their rectangle, and every other rectangle around them has
        # points on its sides, too. The right one has the shortest sides.
        best = np.ptp(members.xy_m @ _AXES, axis=1).sum(axis=1).argmin()
    else:
        best = _closeness(members.xy_m).argmax()
    yaw_rad = float(_YAWS[best])
    axes = rotation(yaw_rad)  # its columns
    along_m, from_m = members.xy_m @ axes, members.from_m @ axes
    low_m, high_m = along_m.min(axis=0), along_m.max(axis=0)
    missing_m = np.maximum(_DEPTH_M - (high_m - low_m), 0.0)
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


def _closeness(xy_m: Floats) -> Floats:
    """Return the sum of the inverse distances to the nearest sides of each rectangle, (45,), 1/m.

    The smallest rectangle around two sides would lie along or across them by chance. (Zhang et al.:
    Efficient L-Shape Fitting for Vehicle Detection Using Laser Scanners, IV 2017.)
    """
    to_sides_m = []
    for axis in (0, 1):
        along_m = xy_m[:, :1] * _AXES[:, 0, axis] + xy_m[:, 1:] * _AXES[:, 1, axis]
        to_sides_m += [along_m - along_m.min(axis=0), along_m.max(axis=0) - along_m]
    nearest_m = np.minimum.reduce(to_sides_m)
    return np.asarray((1.0 / np.maximum(nearest_m, _NEAR_M)).sum(axis=0))
