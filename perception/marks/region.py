"""A landing mark of any picture: one region of a class in class maps."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from uav_bt.errors import UnknownNameError, ValueRangeError
from uav_bt.lab.classes import MARK, LabClasses
from uav_bt.landing_marks import MarkSighting, MarkView, Options, read_options
from uav_bt.types import ClassMap, LandingMark
from uav_bt.types.arrays import Image, Indices
from uav_bt.types.projection import pixel_rays

_LEAST_PX: Final = 6  # pixels of the smallest region. Chosen: smaller ones are mask noise.
# A smaller share of the mark's area is mask noise, unless the mark is cut by the image's border.
_SPECK: Final = 0.2
_FARTHEST_M: Final = 15.0  # no lab is longer


class _Options(Options):
    name: str | None = Field(None, alias="class")


class RegionOnPlane(NamedTuple):
    """A region of a class map, projected to a level plane."""

    forward_m: float  # its middle ahead of the lens
    right_m: float  # its middle to the right of the lens
    area_m2: float
    cut: bool  # whether the image's border cuts it
    rows: Indices  # (N,) of its pixels in the class map
    columns: Indices  # (N,)


class RegionFinder:
    """Finds the mark as the largest region of one class; implements `MarkFinder`.

    Option `class` names the class of the mark's top. Default: the lab's class for it. The region is
    projected to the plane of the top, so that its middle is not biased by perspective.
    """

    uses_images = False
    shows_heading = False

    def __init__(self, mark: LandingMark) -> None:
        self._name = read_options(mark, _Options).name
        self._mark = mark

    def find(self, view: MarkView) -> MarkSighting | None:
        """Return the mark in a class map; None without a region of its size."""
        class_map, mark = view.class_map, self._mark
        above_m = view.frame.height_above_ground_m - mark.height_m
        if class_map is None or not (above_m > 0.0 and math.isfinite(view.frame.gimbal_pitch_rad)):
            return None
        seen = region_on_plane(class_map, self.top_id(class_map.classes), view, mark.height_m)
        if seen is None:
            return None
        share = min(1.0, seen.area_m2 / mark.area_m2)
        if share < _SPECK and not seen.cut:
            return None
        return MarkSighting(
            forward_m=seen.forward_m + view.camera.forward_offset_m,
            right_m=seen.right_m,
            height_m=mark.height_m,
            confidence=0.5 * share if seen.cut else share,
        )

    def picture(self) -> Image:
        """Return a plain colour, (64, 64, 3) RGB."""
        return np.full((64, 64, 3), (240, 90, 30), dtype=np.uint8)

    def top_id(self, classes: LabClasses) -> int:
        """Return the id of the top's class; raises InputError if the lab has no such class."""
        marks = {classes.names[each]: each for each in classes.of_role(MARK)}
        if self._name is None:
            if classes.mark_top is None:
                raise ValueRangeError("no class of the lab has the role mark: add one to its file")
            return classes.mark_top
        if self._name not in marks:
            raise UnknownNameError("class with the role mark", self._name, marks)
        return marks[self._name]


def region_on_plane(
    class_map: ClassMap, class_id: int, view: MarkView, plane_m: float
) -> RegionOnPlane | None:
    """Return the largest region of a class on a level plane at a height above the ground.

    None if it has fewer than 6 pixels, or none of them within 15 m.
    """
    shown: NDArray[np.uint8] = (class_map.ids == class_id).astype(np.uint8)
    _, labels, stats, _ = cv2.connectedComponentsWithStats(shown, connectivity=8)
    areas_px = stats[1:, cv2.CC_STAT_AREA]
    if not areas_px.size or areas_px.max() < _LEAST_PX:
        return None
    rows, columns = np.nonzero(labels == 1 + int(np.argmax(areas_px)))
    height_px, width_px = shown.shape
    cut = bool(np.isin(rows, (0, height_px - 1)).any() or np.isin(columns, (0, width_px - 1)).any())
    camera = view.camera.resized(width_px, height_px)
    above_m = view.frame.height_above_ground_m - plane_m
    rays = pixel_rays(np.stack([columns, rows], axis=-1), camera, view.frame.gimbal_pitch_rad)
    near = rays[:, 2] > above_m / _FARTHEST_M
    rays, rows, columns = rays[near], rows[near], columns[near]
    if not len(rays):
        return None
    places_m = rays[:, :2] * (above_m / rays[:, 2:])
    # A pixel covers an area of the plane in proportion to 1 / down^3 of its ray.
    areas_m2 = above_m**2 / rays[:, 2] ** 3 / (camera.fx_px * camera.fy_px)
    forward_m, right_m = np.average(places_m, axis=0, weights=areas_m2).tolist()
    return RegionOnPlane(forward_m, right_m, float(areas_m2.sum()), cut, rows, columns)
