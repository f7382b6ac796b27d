"""The objects of the map: points of one class that stand together."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.cluster.hierarchy import fcluster, linkage

from perception.mapping.landmarks import Landmarks
from uav_bt.classes import BOXES
from uav_bt.types.site_map import MapObject

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class ObjectConfig:
    """What makes an object of points."""

    apart_m: float = 0.3  # points of one class further apart are two objects
    min_points: int = 4
    min_seen_s: float = 0.3  # shorter sights are specks of the mask
    # A box seen from one side shows a line: what stands behind it is assumed to be as deep as
    # boxes are.
    depth_m: float = 0.4


def objects_of(points: Landmarks, config: ObjectConfig | None = None) -> tuple[MapObject, ...]:
    """Return the objects that stand in the place, by class and then by position.

    Args:
        points: where obstacles meet the ground.
        config: what makes an object.
    """
    config = config or ObjectConfig()
    found: list[MapObject] = []
    lasting = points.take(points.seen_s - points.first_s >= config.min_seen_s)
    for class_id in BOXES:
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
    """Return the object of some points: the middle of the rectangle around them, made deep enough.

    The rectangle's thin side grows away from where it was seen.
    """
    centre, sides, angle_deg = cv2.minAreaRect(members.xy_m.astype(np.float32))
    middle, angle = np.array(centre, dtype=float), np.radians(angle_deg)
    for length, axis in zip(
        sides,
        (np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])),
        strict=True,
    ):
        missing = (config.depth_m - length) / 2
        if missing > 0.0:
            seen_from = np.sign(np.mean((members.from_m - middle) @ axis))
            middle = middle - seen_from * missing * axis
    return MapObject(
        class_id=class_id,
        x_m=float(middle[0]),
        y_m=float(middle[1]),
        size_m=float(max(*sides, config.depth_m)),
        std_m=float(max(0.0, config.depth_m - min(sides)) / 2 + 0.03),
        seen_s=float(members.seen_s.max()),
    )
