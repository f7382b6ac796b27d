"""A landing mark of any picture: one region of a class in class maps."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.marks.mark_options import refuse_unknown
from uav_bt.errors import UnknownNameError, ValueRangeError
from uav_bt.lab.classes import MARK
from uav_bt.landing_marks import MarkSighting, MarkView
from uav_bt.types import ClassMap, LandingMark
from uav_bt.types.arrays import Image
from uav_bt.types.projection import pixel_rays

_LEAST_PX: Final = 6  # pixels of the smallest region. Chosen: smaller ones are mask noise.
# A smaller share of the mark's area is mask noise, unless the mark is cut by the image's border.
_SPECK: Final = 0.2
_FARTHEST_M: Final = 15.0  # no lab is longer
_COLOUR: Final = (240, 90, 30)
_PICTURE_PX: Final = 64


@dataclass(frozen=True, kw_only=True, eq=False)
class RegionOnPlane:
    """The largest region of a class, projected to a level plane.

    Attributes:
        forward_m: Its middle ahead of the lens.
        right_m: Its middle to the right of the lens.
        area_m2: Its area on the plane.
        cut: Whether the image's border cuts it.
        rows: (N,) of its pixels in the class map.
        columns: (N,) of its pixels in the class map.
    """

    forward_m: float
    right_m: float
    area_m2: float
    cut: bool
    rows: NDArray[np.intp]
    columns: NDArray[np.intp]


def region_on_plane(
    class_map: ClassMap, class_id: int, view: MarkView, plane_m: float
) -> RegionOnPlane | None:
    """Return the largest region of a class on a level plane below the lens.

    Args:
        class_map: Class map of the view.
        class_id: The class.
        view: Its camera, height and gimbal pitch, which are finite.
        plane_m: Height of the plane above the ground; the lens is above it.

    Returns:
        The region; None if it has fewer than 6 pixels, or none of them within 15 m.
    """
    rows, columns, cut = _largest_region(class_map.ids == class_id)
    if rows.size < _LEAST_PX:
        return None
    height_px, width_px = class_map.ids.shape
    camera = view.camera.resized(width_px, height_px)
    above_m, pitch_rad = view.frame.height_above_ground_m - plane_m, view.frame.gimbal_pitch_rad
    rays = pixel_rays(np.stack([columns, rows], axis=-1), camera, pitch_rad)
    near = rays[:, 2] > above_m / _FARTHEST_M
    rays, rows, columns = rays[near], rows[near], columns[near]
    if not len(rays):
        return None
    places = rays[:, :2] * (above_m / rays[:, 2:])
    # A pixel covers an area of the plane in proportion to 1 / down^3 of its ray.
    areas_m2 = above_m**2 / rays[:, 2] ** 3 / (camera.fx_px * camera.fy_px)
    forward_m, right_m = np.average(places, axis=0, weights=areas_m2)
    return RegionOnPlane(
        forward_m=float(forward_m),
        right_m=float(right_m),
        area_m2=float(areas_m2.sum()),
        cut=cut,
        rows=rows,
        columns=columns,
    )


class RegionFinder:
    """Finds the mark as the largest region of one class; implements `MarkFinder`.

    The region is projected to the plane of the mark's top, so that its middle is not biased by
    perspective.

    Args:
        mark: Size and height of the mark. Option `class` names the class of its top. Default: the
            lab's class for it.

    Raises:
        ValueRangeError: An option is unknown or not a name.
    """

    uses_images = False
    shows_heading = False

    def __init__(self, mark: LandingMark) -> None:
        refuse_unknown(mark, ("class",))
        self._name = mark.options.get("class")
        if self._name is not None and not isinstance(self._name, str):
            raise ValueRangeError(f"option class: expected the name of a class, got {self._name!r}")
        self._mark = mark

    def find(self, view: MarkView) -> MarkSighting | None:
        """Return the mark in a class map; None without a region of its size.

        Raises:
            UnknownNameError: The lab has no class of that name with the role mark.
        """
        class_map, frame = view.class_map, view.frame
        above_m = frame.height_above_ground_m - self._mark.height_m
        if class_map is None or not (above_m > 0.0 and math.isfinite(frame.gimbal_pitch_rad)):
            return None
        seen = region_on_plane(class_map, self._class_id(class_map), view, self._mark.height_m)
        if seen is None:
            return None
        share = min(1.0, seen.area_m2 / self._mark.area_m2)
        if share < _SPECK and not seen.cut:
            return None
        return MarkSighting(
            forward_m=seen.forward_m + view.camera.forward_offset_m,
            right_m=seen.right_m,
            height_m=self._mark.height_m,
            confidence=0.5 * share if seen.cut else share,
        )

    def picture(self) -> Image:
        """Return a plain colour, (64, 64, 3) RGB."""
        return np.full((_PICTURE_PX, _PICTURE_PX, 3), _COLOUR, dtype=np.uint8)

    def _class_id(self, class_map: ClassMap) -> int:
        classes = class_map.classes
        marks = [classes.names[each] for each in classes.of_role(MARK)]
        if self._name is not None:
            if self._name not in marks:
                raise UnknownNameError("class with the role mark", self._name, marks)
            return classes.id_of(self._name)
        if classes.mark_top is None:
            raise ValueRangeError("no class of the lab has the role mark: add one to its lab file")
        return classes.mark_top


def _largest_region(
    binary: NDArray[np.bool_],
) -> tuple[NDArray[np.intp], NDArray[np.intp], bool]:
    """Return rows and columns of the largest region, and whether the image's border cuts it."""
    _, labels, stats, _ = cv2.connectedComponentsWithStats(binary.astype(np.uint8), connectivity=8)
    areas = stats[1:, cv2.CC_STAT_AREA]
    label = 1 + int(np.argmax(areas)) if areas.size else -1
    rows, columns = np.nonzero(labels == label)
    if not rows.size:
        return rows, columns, False
    height_px, width_px = binary.shape
    inside = rows.min() > 0 and columns.min() > 0
    return (
        rows,
        columns,
        not (inside and rows.max() < height_px - 1 and columns.max() < width_px - 1),
    )
