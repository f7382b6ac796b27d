"""Metric depth without a network: from a class map and from what things stand on.

The carpet lies in the ground plane. The side of a box is a vertical face that stands on the carpet
where its lowest pixels meet it, and a vertical line keeps its azimuth: the base gives one
horizontal range for each azimuth, and with it a depth to every side pixel above. The sides of one
box meet the carpet in one or two straight lines, which are fitted, so that a base is better than a
pixel and reaches on where another box hides it. A roof is a level face at the height of the side's
upper edge; the helipad's is known.

The class map is first unrolled into a panorama of azimuth by depression, where vertical edges are
columns. What cannot be known stays NaN: background, boxes whose base is hidden or below the image's
lower edge, roofs of boxes that are higher than the camera. Of those an upper bound is told: nothing
is further away than the ground behind it, or than the carpet that its base must stand before.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perception.classes import BOXES, CARPET, HELIPAD_BOX, HELIPAD_H, ROOFS
from perception.depth.base_lines import BaseLine, fit_base
from perception.depth.ground import CameraView, ground_depth, level_rays
from perception.depth.panorama import unroll
from uav_bt.errors import ShapeError

__all__ = ["FootingConfig", "FootingDepth", "footing_depth"]

Array = NDArray[np.float64]

_LEAST_EDGE = 3  # columns in which a roof must meet its side before its height is believed
_DEEPEST_M = 1.0  # no box is deeper, seen from its front


@dataclass(frozen=True, kw_only=True)
class FootingConfig:
    """What counts as standing on the carpet."""

    pad_height_m: float = 0.4  # top of the helipad above the carpet, in every lab
    min_run_px: float = 2.0  # of side above a base; less is a speck of the mask
    gap_px: float = 2.0  # between carpet and side; networks blur the border into other classes
    max_rms_px: float = 1.5  # of a fitted base; what is more crooked is taken as it was seen
    # A fitted base is followed this many times as far as it was seen: behind other boxes and below
    # the image's lower edge, not around the corner of a room.
    reach: float = 1.0
    max_range_m: float = 7.0  # the lab's diagonal; a pixel of the base weighs 0.2 m there


@dataclass(frozen=True, kw_only=True)
class FootingDepth:
    """What masks and geometry know."""

    depth: NDArray[np.float32]  # (H, W) metres along the optical axis; NaN where unknown
    at_most: NDArray[np.float32]  # (H, W) metres; upper bound of the depth, inf without one
    known_share: float  # of the pixels of boxes, roofs and helipad, 0 to 1; 1 when there are none


def footing_depth(
    ids: NDArray[np.uint8], view: CameraView, config: FootingConfig | None = None
) -> FootingDepth:
    """Estimate the depth of carpet, boxes, roofs and helipad.

    Args:
        ids: (H, W) class ids of `perception.classes`.
        view: the camera, at the map's size.
        config: what counts as standing on the carpet.

    Raises:
        ShapeError: the map's size is not the view's.
        ValueRangeError: the lens is not above the carpet.
    """
    size = (view.camera.height_px, view.camera.width_px)
    if ids.shape != size:
        raise ShapeError(
            "class map", expected=f"{size[0]}x{size[1]}, as its camera", actual=ids.shape
        )
    return _Footing(ids, view, config or FootingConfig()).result()


@dataclass(frozen=True, kw_only=True)
class _Base:
    """Where one thing stands, by column of the panorama."""

    steepness: Array  # (A,) height over range of its base; NaN where unknown
    line: BaseLine | None  # what the steepness was fitted with
    visible: Array  # (A,) of its lowest pixel seen, which its base is at least as steep as; or NaN
    top_row: NDArray[np.intp]  # (A,) uppermost row of its side; -1 where it does not show


class _Footing:
    """The work on one map; its steps share the rays, the panorama and the result."""

    def __init__(self, ids: NDArray[np.uint8], view: CameraView, config: FootingConfig) -> None:
        self._ids, self._height_m, self._config = ids, view.height_m, config
        self._rays = level_rays(view).reshape(3, -1)
        self._panorama = unroll(ids, view)
        ground = ground_depth(view).ravel()
        self._flat_ids = ids.ravel()
        self._depth = np.where(self._flat_ids == CARPET, ground, np.float32(np.nan))
        self._at_most = np.where(np.isnan(ground), np.float32(np.inf), ground)
        self._present = np.bincount(self._flat_ids, minlength=256) > 0

    def result(self) -> FootingDepth:
        bases = {box: self._base(box) for box in BOXES if self._present[box]}
        for box, base in bases.items():
            self._fill_sides(np.flatnonzero(self._flat_ids == box), base)
        for number, roof in enumerate(ROOFS):
            if self._present[roof]:
                wearers = [bases[box] for box in BOXES[number :: len(ROOFS)] if box in bases]
                self._fill_roof(roof, wearers)
        if self._present[HELIPAD_BOX] or self._present[HELIPAD_H]:
            self._fill_helipad()
        things = self._flat_ids > CARPET
        count = int(np.count_nonzero(things))
        known = int(np.count_nonzero(things & np.isfinite(self._depth)))
        return FootingDepth(
            depth=self._depth.reshape(self._ids.shape),
            at_most=self._at_most.reshape(self._ids.shape),
            known_share=known / count if count else 1.0,
        )

    # --- bases ------------------------------------------------------------------------------------

    def _base(self, thing: int) -> _Base:
        panorama, config = self._panorama, self._config
        shows = panorama.ids == thing
        run = max(1, round(config.min_run_px * panorama.rows_per_px))
        solid = shows[: shows.shape[0] - run + 1].copy()
        for shift in range(1, run):
            solid &= shows[shift : shows.shape[0] - run + 1 + shift]
        columns = np.flatnonzero(solid.any(axis=0))
        first = solid[:, columns].argmax(axis=0)
        tan = np.tan(panorama.depression_rad)
        visible = np.full(panorama.azimuth_rad.size, np.nan)
        visible[columns] = tan[first]
        top_row = np.full(panorama.azimuth_rad.size, -1, dtype=np.intp)
        top_row[columns] = shows.shape[0] - 1 - shows[::-1, columns].argmax(axis=0)

        below = self._carpet_below(columns, first)
        stands = below >= 0
        seen = columns[stands]
        depression = panorama.depression_rad
        steepness = np.full(panorama.azimuth_rad.size, np.nan)
        steepness[seen] = np.tan(0.5 * (depression[first[stands]] + depression[below[stands]]))
        line = fit_base(panorama.azimuth_rad[seen], steepness[seen], panorama.pixel_rad)
        if line is not None and line.rms_px <= config.max_rms_px:
            steepness = self._followed(line, seen, columns, visible)
        else:
            line = None
        flattest = self._height_m / config.max_range_m
        steepness[~(steepness >= flattest)] = np.nan
        return _Base(steepness=steepness, line=line, visible=visible, top_row=top_row)

    def _carpet_below(self, columns: NDArray[np.intp], first: NDArray[np.intp]) -> NDArray[np.intp]:
        """Return the row of the carpet right below a side, -1 where there is none."""
        gap = 1 + round(self._config.gap_px * self._panorama.rows_per_px)
        found = np.full(columns.size, -1, dtype=np.intp)
        for step in range(1, gap + 1):
            row = np.maximum(first - step, 0)
            carpet = (self._panorama.ids[row, columns] == CARPET) & (first >= step)
            found = np.where((found < 0) & carpet, row, found)
        return found

    def _followed(
        self,
        line: BaseLine,
        seen: NDArray[np.intp],
        columns: NDArray[np.intp],
        visible: Array,
    ) -> Array:
        """Follow a fitted base to the columns that hide it but show what stands on it."""
        azimuth = self._panorama.azimuth_rad
        place = np.clip(np.searchsorted(seen, columns), 1, max(seen.size - 1, 1))
        nearest = np.minimum(
            np.abs(azimuth[columns] - azimuth[seen[place - 1]]),
            np.abs(azimuth[columns] - azimuth[seen[np.minimum(place, seen.size - 1)]]),
        )
        within = columns[nearest <= self._config.reach * line.spread_rad]
        steepness = np.full(azimuth.size, np.nan)
        steepness[within] = line.steepness(azimuth[within])
        # A base above what stands on it was followed too far.
        slack = 1.0 - 2.0 * self._panorama.pixel_rad
        steepness[steepness < slack * visible] = np.nan
        return steepness

    # --- faces ------------------------------------------------------------------------------------

    def _azimuths(self, pixels: NDArray[np.intp]) -> Array:
        return np.arctan2(self._rays[1, pixels], self._rays[0, pixels]).astype(np.float64)

    def _fill_sides(self, pixels: NDArray[np.intp], base: _Base) -> None:
        depth, at_most = self._side_depth(pixels, base)
        self._depth[pixels] = depth
        self._at_most[pixels] = np.fmin(self._at_most[pixels], at_most)

    def _side_depth(self, pixels: NDArray[np.intp], base: _Base) -> tuple[Array, Array]:
        """Return depth (NaN where unknown) and its bound at side pixels, by their azimuth."""
        azimuth = self._azimuths(pixels)
        columns = self._panorama.columns(azimuth)
        steepness = base.steepness[columns]
        if base.line is not None:
            exact = base.line.steepness(azimuth)
            steepness = np.where(np.isnan(steepness), np.nan, exact)
        level = np.hypot(self._rays[0, pixels], self._rays[1, pixels])
        depth = self._height_m / (steepness * level)
        return depth, np.asarray(self._height_m / (base.visible[columns] * level))

    def _top_height(self, base: _Base, roof: int) -> float | None:
        """Return the height of the upper edge of a side where a roof begins, or None."""
        panorama = self._panorama
        columns = np.flatnonzero((base.top_row >= 0) & np.isfinite(base.steepness))
        top = base.top_row[columns]
        gap = 1 + round(self._config.gap_px * panorama.rows_per_px)
        last = panorama.depression_rad.size - 1
        above = np.full(columns.size, -1, dtype=np.intp)
        for step in range(1, gap + 1):
            row = np.minimum(top + step, last)
            begins = panorama.ids[row, columns] == roof
            above = np.where((above < 0) & begins, row, above)
        meets = above >= 0
        if np.count_nonzero(meets) < _LEAST_EDGE:
            return None
        edge_rad = 0.5 * (
            panorama.depression_rad[top[meets]] + panorama.depression_rad[above[meets]]
        )
        ratio = np.tan(edge_rad) / base.steepness[columns[meets]]
        return self._height_m * (1.0 - float(np.median(ratio)))

    def _fill_roof(self, roof: int, wearers: Sequence[_Base]) -> None:
        """Lay each roof pixel level with the edge of the box below it in its column."""
        pixels = np.flatnonzero(self._flat_ids == roof)
        down = self._rays[2, pixels]
        azimuth = self._azimuths(pixels)
        columns = self._panorama.columns(azimuth)
        level = np.hypot(self._rays[0, pixels], self._rays[1, pixels])
        rows = self._panorama.rows(np.arctan2(down, level))
        nearest_below = np.full(pixels.size, -1, dtype=np.intp)
        for base in wearers:
            height_m = self._top_height(base, roof)
            top = base.top_row[columns]
            mine = (top <= rows) & (top > nearest_below)
            nearest_below[mine] = top[mine]
            if height_m is None or height_m >= self._height_m:
                self._depth[pixels[mine]] = np.nan
                continue
            with np.errstate(divide="ignore", invalid="ignore"):
                depth = (self._height_m - height_m) / down
                front = self._height_m / (base.steepness[columns] * level)
            plausible = mine & (down > 0.0) & (depth <= front + _DEEPEST_M / level)
            self._depth[pixels[mine]] = np.nan
            self._depth[pixels[plausible]] = np.fmax(depth, front)[plausible]

    def _fill_helipad(self) -> None:
        """The pad's height is known; its rim wears the colours of its sides."""
        above_m = self._height_m - self._config.pad_height_m
        base = self._base(HELIPAD_BOX)
        pixels = np.flatnonzero(self._flat_ids == HELIPAD_BOX)
        side, at_most = self._side_depth(pixels, base)
        down = self._rays[2, pixels]
        with np.errstate(divide="ignore"):
            top = np.where((down > 0.0) & (above_m > 0.0), above_m / down, np.inf)
        # A ray meets the side first unless it passes above its upper edge.
        self._depth[pixels] = np.where(np.isfinite(top), np.fmax(side, top), side)
        self._depth[pixels[np.isnan(side)]] = np.nan
        self._at_most[pixels] = np.fmin(self._at_most[pixels], at_most)
        panel = np.flatnonzero((self._flat_ids == HELIPAD_H) & (self._rays[2] > 0.0))
        if above_m > 0.0:
            self._depth[panel] = above_m / self._rays[2, panel]
