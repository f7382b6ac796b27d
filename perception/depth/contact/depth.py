"""Metric depth without a network, from a class map and the contact of obstacles with the ground.

The ground is a plane. The side of a box is a vertical face, and its lowest pixels
meet the ground at its base. A vertical line keeps its azimuth, so the base gives one horizontal
range for each azimuth, and with it the depth of every side pixel above. The sides of one box meet
the ground in one or two straight lines. These are fitted, which makes a base more accurate than one
pixel and extends it behind other boxes. A roof is a level face at the height of the side's upper
edge; the height of the mark is known.

The class map is first remapped to a panorama of azimuth by depression, where vertical edges are
columns. Unknown depth stays NaN: background, boxes with a base that is hidden or below the image's
lower edge, roofs of boxes higher than the camera. For these an upper bound is given: the depth of
the ground behind the pixel, or of the nearest visible ground below the box.

For a box with a visible roof but without a visible base, only the height is missing. The median of
a network's depth over the roof gives it; the geometry gives the rest.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.camera.ground_plane import GroundPlane
from perception.depth.contact.base import Base, Remembered, find_base, fit_base
from perception.depth.contact.scan import Panorama
from uav_bt.compiled import compiled
from uav_bt.lab.shipped import default_mark
from uav_bt.types import ClassMap
from uav_bt.types.arrays import Flags, Floats, Floats32, Indices

_MAX_DEPTH_M: Final = 8.0  # the lab's diagonal; larger depths are mask noise
_MAX_ROOF_M: Final = 1.0  # largest extent of a roof behind its front edge
_MIN_EDGE: Final = 3  # least number of columns in which a roof must meet its side
# Ratio by which the network overestimates the distance of roofs below the lens if the base of the
# box is out of sight: median 1.14 on the training scenes, 1.06 to 1.17 on the validation scenes,
# half of all within 1.01 and 1.45 (commit 71858fd, U-Net masks).
ROOF_TOO_FAR: Final = 1.1


@dataclass(frozen=True, kw_only=True)
class ContactDepth:
    """Depth from masks and geometry."""

    depth: Floats32  # (H, W) metres along the optical axis; NaN where unknown
    at_most: Floats32  # (H, W) metres; upper bound of the depth, inf without one
    known_share: float  # of the pixels of boxes, roofs and mark, 0 to 1; 1 without such pixels


class ContactEstimation:
    """Estimation of the depth of one map; its steps share the rays, the panorama and the result.

    Args:
        class_map: the class map.
        ground: the ground plane of the view, at the map's size.
        remembered: bases seen earlier, for boxes whose base is now out of view.
        mark_height_m: height of the landing mark's top above the ground; None for that of the
            default lab.
    """

    def __init__(
        self,
        class_map: ClassMap,
        ground: GroundPlane,
        remembered: Remembered | None = None,
        mark_height_m: float | None = None,
    ) -> None:
        self._class_map, self._classes = class_map, class_map.classes
        ids = self._classes.with_one_ground(class_map.ids)
        self._ids = ids.ravel()
        self._height_m, self._remembered = ground.view.height_m, remembered
        self._mark_m = default_mark().height_m if mark_height_m is None else mark_height_m
        self._rays, depth_m = ground.rays.reshape(3, -1), ground.depth_m.ravel()
        self._panorama = Panorama.of(ids, ground.view)
        self._runs = self._panorama.runs(len(self._classes))
        self._depth = np.where(self._ids == self._classes.ground, depth_m, np.float32(np.nan))
        self._at_most = np.where(np.isnan(depth_m), np.float32(np.inf), depth_m)
        self._incomplete: set[int] = set()  # boxes with pixels of unknown depth
        self._present = np.bincount(self._ids, minlength=256) > 0
        top_of = self._classes.top_of
        bases = {box: self._base(box) for box in self._classes.standing if self._present[box]}
        for box, base in bases.items():
            self._fill_sides(box, base)
        self._carriers = {
            roof: {box: base for box, base in bases.items() if top_of[box] == roof}
            for roof in self._classes.tops
            if self._present[roof] and roof != self._classes.mark_top
        }
        for roof, carriers in self._carriers.items():
            self._fill_roof(roof, carriers.values())

    def complete(self, network_m: Floats32) -> None:
        """Fill in the depth of roofs of boxes whose base is out of sight, and of the sides below.

        Args:
            network_m: (H, W) a network's metric depth.
        """
        for roof, carriers in self._carriers.items():
            self._fill_below_roof(roof, carriers, network_m.ravel())

    def result(self) -> ContactDepth:
        """Return the depth by contact, and by the network if it has completed the estimation."""
        depth = self._depth.copy()
        self._fill_mark(depth)
        with np.errstate(invalid="ignore"):
            depth[depth > _MAX_DEPTH_M] = np.nan
        things, size = self._class_map.is_above_ground.ravel(), self._class_map.ids.shape
        count = int(np.count_nonzero(things))
        known = int(np.count_nonzero(things & np.isfinite(depth)))
        return ContactDepth(
            depth=depth.reshape(size),
            at_most=self._at_most.reshape(size).copy(),
            known_share=known / count if count else 1.0,
        )

    def _base(self, thing: int) -> Base:
        return find_base(
            self._panorama,
            self._runs,
            thing=thing,
            ground=self._classes.ground,
            height_m=self._height_m,
            remembered=self._remembered,
        )

    def _fill_sides(self, box: int, base: Base) -> None:
        pixels, depth, bound = self._side_depth(box, base)
        self._depth[pixels] = depth
        self._at_most[pixels] = np.fmin(self._at_most[pixels], bound)
        if np.isnan(depth).any():
            self._incomplete.add(box)

    def _side_depth(self, thing: int, base: Base) -> tuple[Indices, Floats, Floats]:
        """Return the pixels of a side, their depth, NaN where unknown, and its upper bound.

        The bound is the ground at the lowest pixel of the column.
        """
        azimuth, line = self._panorama.azimuth_rad, base.line
        return _sides(
            self._ids,
            thing,
            self._rays,
            self._height_m,
            (float(azimuth[0]), float(azimuth[1] - azimuth[0])),
            np.stack([base.slope, base.visible]),
            base.fitted,
            np.empty((0, 2)) if line is None else line.faces,
            math.inf if line is None else line.corner_rad,
        )

    # --- level faces ------------------------------------------------------------------------------

    def _fill_roof(self, roof: int, carriers: Iterable[Base]) -> None:
        """Set each roof pixel to the height of the upper edge of the box below it."""
        pixels = np.flatnonzero(self._ids == roof)
        forward, right, down = self._rays[:, pixels]
        level = np.hypot(forward, right)
        columns = self._panorama.columns(np.arctan2(right, forward))
        rows = self._panorama.rows(np.arctan2(down, level))
        nearest_below = np.full(pixels.size, -1, dtype=np.intp)
        for base in carriers:
            top = base.top_row[columns]
            mine = (top <= rows) & (top > nearest_below) & (down > 0.0)
            nearest_below[mine] = top[mine]
            self._depth[pixels[mine]] = np.nan
            above_m = self._above_roof(base, roof)
            if above_m <= 0.0:
                continue
            front = self._height_m / (base.slope[columns[mine]] * level[mine])
            depth = np.fmax(above_m / down[mine], front)  # not nearer than the front edge
            plausible = depth <= front + _MAX_ROOF_M / level[mine]
            self._depth[pixels[mine][plausible]] = depth[plausible]

    def _fill_below_roof(
        self, roof: int, carriers: Mapping[int, Base], network_m: Floats32
    ) -> None:
        """Fill roofs, and the sides below their edges, of boxes whose base is out of sight.

        The network is used only for the height of the roof. A roof is level, so each of its pixels
        gives its height, and the median is taken. The range of the sides follows from the roof's
        edge.
        """
        pixels = np.flatnonzero((self._ids == roof) & (self._rays[2] > 0.0))
        pixels = pixels[np.isnan(self._depth[pixels])]
        if not pixels.size and self._incomplete.isdisjoint(carriers):
            return
        above_m = {box: self._above_roof(base, roof) for box, base in carriers.items()}
        if pixels.size:
            down = self._rays[2, pixels]
            seen_m = float(np.median(network_m[pixels] * down)) / ROOF_TOO_FAR
            above_m = {box: known_m or seen_m for box, known_m in above_m.items()}
            # Roof pixels without a side below are level with those that have one.
            only_m = next(iter(above_m.values())) if len(above_m) == 1 else seen_m
            self._depth[pixels] = only_m / down
        for box, base in carriers.items():
            if above_m[box] > 0.0 and box in self._incomplete:
                self._fill_sides(box, self._below_edge(base, roof, above_m[box]))

    def _below_edge(self, base: Base, roof: int, above_m: float) -> Base:
        """Return the base completed where it is out of sight, from the edge of the roof above."""
        columns, edge = self._roof_edge(base, roof)
        azimuth = self._panorama.azimuth_rad
        line = fit_base(azimuth[columns], edge, self._panorama.pixel_rad)
        if line is None:
            return base
        slope = np.fmax(line.slope(azimuth) * self._height_m / above_m, base.visible)
        return replace(base, slope=np.where(np.isnan(base.slope), slope, base.slope))

    def _above_roof(self, base: Base, roof: int) -> float:
        """Return the lens's height above the roof's edge; 0 if the edge is not found."""
        columns, edge = self._roof_edge(base, roof)
        share = edge / base.slope[columns]
        share = share[np.isfinite(share)]
        return self._height_m * float(np.median(share)) if share.size >= _MIN_EDGE else 0.0

    def _roof_edge(self, base: Base, roof: int) -> tuple[Indices, Floats]:
        """Return the columns in which a roof meets a side below it, and the edge's slope there."""
        columns = np.flatnonzero(base.top_row >= 0)
        top, depression = base.top_row[columns], self._panorama.depression_rad
        above = self._panorama.next_row(top, columns, roof, 1)
        meets = above >= 0
        return columns[meets], np.tan(0.5 * (depression[top[meets]] + depression[above[meets]]))

    def _fill_mark(self, filled: Floats32) -> None:
        """Fill sides and top of what carries the mark; its rim has the class of its sides."""
        above_m = self._height_m - self._mark_m
        down = np.maximum(self._rays[2], np.float32(1e-6))
        top, side = self._classes.mark_top, self._classes.mark_sides
        if top is not None and self._present[top] and above_m > 0.0:
            panel = np.flatnonzero((self._ids == top) & (self._rays[2] > 0.0))
            filled[panel] = above_m / down[panel]
        if side is not None and self._present[side]:
            pixels, depth, _ = self._side_depth(side, self._base(side))
            if above_m > 0.0:
                # A ray that passes above the upper edge of the side meets the top.
                depth = np.maximum(depth, above_m / down[pixels])
            filled[pixels] = depth


@compiled(
    "Tuple((intp[::1], float64[::1], float64[::1]))"
    "(Array(uint8, 1, 'C', readonly=True), int64, float32[:, ::1], float64, UniTuple(float64, 2),"
    " float64[:, ::1], boolean[::1], float64[:, ::1], float64)"
)
def _sides(  # noqa: PLR0917 - Numba passes arguments by position
    ids: NDArray[np.uint8],
    thing: int,
    rays: Floats32,
    height_m: float,
    azimuths_rad: tuple[float, float],
    slopes: Floats,
    fitted: Flags,
    faces: Floats,
    corner_rad: float,
) -> tuple[Indices, Floats, Floats]:
    """Return the depth of the side pixels of a class from the base below them.

    Args:
        ids: (P,) class ids of the image.
        thing: the class id.
        rays: (3, P) rays of unit depth: forward, right, down.
        height_m: height of the lens above the ground.
        azimuths_rad: azimuth of the panorama's first column, and step between columns.
        slopes: (2, A) slope of the base, and of the lowest visible pixel, by column; or NaN.
        fitted: (A,) columns whose slope comes from the fitted line.
        faces: (0 to 2, 2) factors of cosine and sine of the line.
        corner_rad: azimuth where its second face begins.

    Returns:
        (N,) pixels; (N,) their depth, m, NaN where unknown; (N,) upper bounds, m, or NaN.
    """
    first_rad, step_rad = azimuths_rad
    pixels = np.empty(len(ids), dtype=np.intp)
    depth_m, bound_m = np.empty(len(ids)), np.empty(len(ids))
    count = 0
    for pixel in range(len(ids)):
        if ids[pixel] != thing:
            continue
        azimuth_rad = math.atan2(rays[1, pixel], rays[0, pixel])
        forward, right = np.float64(rays[0, pixel]), np.float64(rays[1, pixel])
        level = math.sqrt(forward * forward + right * right)
        nearest = np.rint((azimuth_rad - first_rad) / step_rad)
        column = int(min(max(nearest, 0.0), slopes.shape[1] - 1.0))
        slope = slopes[0, column]
        if fitted[column] and len(faces):
            face = 1 if azimuth_rad >= corner_rad else 0
            exact = (faces[face, 0] * forward + faces[face, 1] * right) / level
            slope = exact if exact > 0.0 else slope
        pixels[count] = pixel
        depth_m[count] = height_m / (slope * level)
        bound_m[count] = height_m / (slopes[1, column] * level)
        count += 1
    return pixels[:count], depth_m[:count], bound_m[:count]
