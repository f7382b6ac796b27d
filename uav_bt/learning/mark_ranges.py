"""Range of a landing mark in one frame, by its size, by the camera's height, and by depth."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.camera.ground_plane import ground_depth, view_of
from perception.marks.helipad import H_SHARE
from perception.marks.region import region_on_plane
from uav_bt.landing_marks import MarkFinder, MarkView
from uav_bt.learning.geometry import MarkRanges
from uav_bt.types import LandingMark

# Least pixels of the mark's top. A mask is up to a pixel too large on each side: with fewer pixels
# its area is more than 15 % too large.
_MIN_PX: Final = 60
_MIN_MEASURED_PX: Final = 400
_LEAST_RANGE_M: Final = 0.5  # nearer the horizontal range is too short for a ratio. Chosen.


def mark_ranges(
    view: MarkView, mark: LandingMark, finder: MarkFinder, depth: NDArray[np.float32] | None
) -> MarkRanges | None:
    """Return the ranges of the mark in a view.

    Args:
        view: An undistorted frame with its class map.
        mark: Size and height of the mark.
        finder: Finder of that mark.
        depth: (h, w) metres along the optical axis at the class map's size; None if unknown.

    Returns:
        The ranges; None if the view does not show the mark's top whole and large enough.
    """
    class_map, camera, sighting = view.class_map, view.camera, finder.find(view)
    if class_map is None or sighting is None:
        return None
    name = mark.options.get("class") if mark.kind == "region" else None
    top = class_map.classes.mark_top if name is None else class_map.classes.id_of(name)
    height_px, width_px = class_map.ids.shape
    lens = view_of(view.frame, camera, (width_px, height_px))
    if top is None or not lens.height_m > mark.height_m:
        return None
    region = region_on_plane(class_map, top, view, mark.height_m)
    min_px = _MIN_PX if finder.uses_images else _MIN_MEASURED_PX
    if region is None or region.cut or region.rows.size < min_px:
        return None
    by_height = math.hypot(region.forward_m, region.right_m)
    if by_height < _LEAST_RANGE_M:
        return None
    if finder.uses_images:
        by_size = math.hypot(sighting.forward_m - camera.forward_offset_m, sighting.right_m)
    else:
        # Such finders have the range from height and pitch; the area shows the size.
        whole_m2 = mark.area_m2 * (H_SHARE if mark.kind == "helipad" else 1.0)
        by_size = by_height * math.sqrt(whole_m2 / region.area_m2)
    by_depth = math.nan
    if depth is not None:
        plane_m = ground_depth(lens, plane_m=mark.height_m)
        places = region.rows, region.columns
        by_depth = by_height * float(np.median(depth[places] / plane_m[places]))
    return MarkRanges(by_size=by_size, by_height=by_height, by_depth=by_depth)
