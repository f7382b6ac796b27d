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
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from perception.camera.ground_plane import CameraView, GroundPlane
from perception.depth.contact.contacts import (
    Base,
    BaseConfig,
    Remembered,
    Runs,
    find_base,
    rows_above,
)
from perception.depth.contact.lines import fit_base
from perception.depth.contact.panorama import Panorama
from perception.depth.contact.side_loops import sides
from uav_bt.errors import ShapeError
from uav_bt.lab.shipped import default_mark
from uav_bt.types import ClassMap
from uav_bt.types.arrays import Floats, Indices


@dataclass(frozen=True, kw_only=True)
class ContactDepthConfig:
    """Dimensions of the lab, and limits for noise in the class map."""

    # Height of the landing mark's top above the ground.
    pad_height_m: float = field(default_factory=lambda: default_mark().height_m)
    max_depth_m: float = 8.0  # the lab's diagonal; larger depths are mask noise
    max_roof_m: float = 1.0  # largest extent of a roof behind its front edge
    min_edge: int = 3  # least number of columns in which a roof must meet its side
    # Ratio by which the network overestimates the distance of roofs below the lens if the base of
    # the box is out of sight: median 1.14 on the training scenes, 1.06 to 1.17 on the validation
    # scenes, half of all within 1.01 and 1.45 (commit 71858fd,
    # U-Net masks).
    roof_too_far: float = 1.1
    base: BaseConfig = field(default_factory=BaseConfig)


@dataclass(frozen=True, kw_only=True)
class ContactDepth:
    """Depth from masks and geometry."""

    depth: NDArray[np.float32]  # (H, W) metres along the optical axis; NaN where unknown
    at_most: NDArray[np.float32]  # (H, W) metres; upper bound of the depth, inf without one
    known_share: float  # of the pixels of boxes, roofs and mark, 0 to 1; 1 without such pixels


def contact_depth(
    class_map: ClassMap, view: CameraView, *, remembered: Remembered | None = None
) -> ContactDepth:
    """Estimate the depth of ground, boxes, roofs and mark.

    Args:
        class_map: the class map.
        view: the camera, at the map's size.
        remembered: bases seen earlier, for boxes whose base is now out of view.

    Raises:
        ShapeError: the map has another size than the view.
        ValueRangeError: the lens is not above the ground.
    """
    return ContactEstimation(class_map, GroundPlane.of(view), remembered=remembered).result()


class ContactEstimation:
    """Estimation of the depth of one map; its steps share the rays, the panorama and the result.

    Args:
        class_map: the class map.
        ground: the ground plane of the view, at the map's size.
        config: dimensions of the lab.
        remembered: bases seen earlier, for boxes whose base is now out of view.

    Raises:
        ShapeError: the map has another size than the view.
        ValueRangeError: the lens is not above the ground.
    """

    def __init__(
        self,
        class_map: ClassMap,
        ground: GroundPlane,
        config: ContactDepthConfig | None = None,
        remembered: Remembered | None = None,
    ) -> None:
        self._size = (ground.view.camera.height_px, ground.view.camera.width_px)
        self._check("class map", class_map.ids.shape)
        self._class_map, self._classes = class_map, class_map.classes
        ids = self._classes.with_one_ground(class_map.ids)
        config, panorama = config or ContactDepthConfig(), Panorama.of(ids, ground.view)
        self._ids = ids.ravel()
        self._height_m, self._config = ground.view.height_m, config
        self._rays, depth_m = ground.rays.reshape(3, -1), ground.depth_m.ravel()
        self._panorama, self._remembered = panorama, remembered
        self._runs = Runs.of(panorama, len(self._classes), config.base)
        self._depth = np.where(self._ids == self._classes.ground, depth_m, np.float32(np.nan))
        self._at_most = np.where(np.isnan(depth_m), np.float32(np.inf), depth_m)
        self._incomplete: set[int] = set()  # boxes with pixels of unknown depth
        self._present = np.bincount(self._ids, minlength=256) > 0

        standing, top_of = self._classes.standing, self._classes.top_of
        bases = {box: self._base(box) for box in standing if self._present[box]}
        for box, base in bases.items():
            self._fill_sides(box, base)
        self._carriers = {
            roof: {box: base for box, base in bases.items() if top_of[box] == roof}
            for roof in self._classes.tops
            if self._present[roof] and roof != self._classes.mark_top
        }
        for roof, carriers in self._carriers.items():
            self._fill_roof(roof, carriers.values())

    def complete(self, network_m: NDArray[np.float32]) -> None:
        """Estimate the roofs of boxes whose base is out of sight, and the sides below them.

        Args:
            network_m: (H, W) a network's metric depth.

        Raises:
            ShapeError: it has another size than the class map.
        """
        self._check("network's depth", network_m.shape)
        for roof, carriers in self._carriers.items():
            self._fill_below_roof(roof, carriers, network_m.ravel())

    def result(self) -> ContactDepth:
        """Return the depth by contact, and by the network if it has completed the estimation."""
        depth = self._depth.copy()
        self._fill_mark(depth)
        with np.errstate(invalid="ignore"):
            depth[depth > self._config.max_depth_m] = np.nan
        things = self._class_map.is_above_ground.ravel()
        count = int(np.count_nonzero(things))
        known = int(np.count_nonzero(things & np.isfinite(depth)))
        return ContactDepth(
            depth=depth.reshape(self._size),
            at_most=self._at_most.reshape(self._size).copy(),
            known_share=known / count if count else 1.0,
        )

    def _check(self, name: str, shape: tuple[int, ...]) -> None:
        if shape != self._size:
            expected = f"{self._size[0]}x{self._size[1]}, as its camera"
            raise ShapeError(name, expected=expected, actual=shape)

    def _base(self, thing: int) -> Base:
        return find_base(
            self._panorama,
            self._runs,
            self._config.base,
            thing=thing,
            ground=self._classes.ground,
            height_m=self._height_m,
            remembered=self._remembered,
        )

    def _pixels(self, thing: int) -> tuple[Indices, Floats, Floats]:
        """Return the pixels of a class, their azimuths, and their rays' level parts."""
        pixels = np.flatnonzero(self._ids == thing)
        forward, right = self._rays[0, pixels], self._rays[1, pixels]
        return pixels, np.arctan2(right, forward), np.hypot(forward, right)

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
        return sides(
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
        pixels, azimuth, level = self._pixels(roof)
        down = self._rays[2, pixels]
        columns = self._panorama.columns(azimuth)
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
            plausible = depth <= front + self._config.max_roof_m / level[mine]
            self._depth[pixels[mine][plausible]] = depth[plausible]

    def _fill_below_roof(
        self, roof: int, carriers: Mapping[int, Base], network_m: NDArray[np.float32]
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
            seen_m = float(np.median(network_m[pixels] * down)) / self._config.roof_too_far
            above_m = {box: known_m or seen_m for box, known_m in above_m.items()}
            # Roof pixels without a side below are level with those that have one.
            only_m = next(iter(above_m.values())) if len(above_m) == 1 else seen_m
            self._depth[pixels] = only_m / down
        for box, base in carriers.items():
            if above_m[box] > 0.0 and box in self._incomplete:
                self._fill_sides(box, self._below_edge(base, roof, above_m[box]))

    def _below_edge(self, base: Base, roof: int, above_m: float) -> Base:
        """Return the base completed where it is out of sight, from the edge of the roof above."""
        hidden = np.isnan(base.slope)
        columns, edge = self._roof_edge(base, roof)
        azimuth = self._panorama.azimuth_rad
        line = fit_base(azimuth[columns], edge, self._panorama.pixel_rad, self._config.base.line)
        if line is None:
            return base
        slope = np.fmax(line.slope(azimuth) * self._height_m / above_m, base.visible)
        return replace(base, slope=np.where(hidden, slope, base.slope))

    def _above_roof(self, base: Base, roof: int) -> float:
        """Return the lens's height above the roof's edge; 0 if the edge is not found."""
        columns, edge = self._roof_edge(base, roof)
        share = edge / base.slope[columns]
        share = share[np.isfinite(share)]
        if share.size < self._config.min_edge:
            return 0.0
        return self._height_m * float(np.median(share))

    def _roof_edge(self, base: Base, roof: int) -> tuple[Indices, Floats]:
        """Return the columns in which a roof meets a side below it, and the edge's slope there."""
        panorama = self._panorama
        columns = np.flatnonzero(base.top_row >= 0)
        top = base.top_row[columns]
        above = rows_above(panorama, top, columns, roof, self._config.base.gap_px)
        meets = above >= 0
        depression = panorama.depression_rad
        return columns[meets], np.tan(0.5 * (depression[top[meets]] + depression[above[meets]]))

    def _fill_mark(self, filled: Floats) -> None:
        """Fill sides and top of what carries the mark; its rim has the class of its sides."""
        above_m = self._height_m - self._config.pad_height_m
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
