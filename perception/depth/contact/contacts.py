"""Bases: the contact of obstacles with the ground by azimuth, from a panorama of the class map."""

from __future__ import annotations

from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.depth.contact.lines import BaseLine, LineConfig, fit_base
from perception.depth.contact.panorama import OUTSIDE, Panorama
from uav_bt.compiled import compiled
from uav_bt.types.arrays import Floats, Indices


@dataclass(frozen=True, kw_only=True)
class BaseConfig:
    """Which pixels form a base on the ground."""

    min_run_px: float = 2.0  # height of the side above a base; less is mask noise
    gap_px: float = 2.0  # between ground and side; networks blur the border into other classes
    max_rms_px: float = 1.5  # of a fitted base; with a larger error the seen base is used unfitted
    # A fitted base is extended by this multiple of its visible azimuth range, behind other boxes
    # and below the image's lower edge.
    reach: float = 1.0
    # A box with its base cut off has a ragged upright edge with ground beside it. A cut box needs
    # at least this number of columns on ground for a base.
    min_beside_cut: int = 10
    specks: float = 0.25  # a base is rejected if more than this share of its columns contradict it
    slack_px: float = 2.0  # a side may reach below its fitted base by this
    max_range_m: float = 7.0  # the lab's diagonal; there one pixel of the base is 0.2 m
    # Remembered bases drift by decimetres and a few degrees. They are used within recall_rad of
    # their azimuths, and up to recall_m beyond the lowest visible pixel.
    recall_rad: float = 0.09
    recall_m: float = 0.1
    min_recalled: int = 3  # points; fewer may be noise of an old mask
    line: LineConfig = field(default_factory=LineConfig)


@dataclass(frozen=True, kw_only=True)
class Base:
    """The base of one class, by column of the panorama."""

    slope: Floats  # (A,) camera height over range of the base; NaN where unknown
    line: BaseLine | None  # the fitted line; None without a fit
    fitted: NDArray[np.bool_]  # (A,) columns whose slope comes from the line
    visible: Floats  # (A,) slope of the lowest visible pixel, a lower bound of `slope`; or NaN
    top_row: Indices  # (A,) uppermost row of the class; -1 where it is not visible


@dataclass(frozen=True, kw_only=True)
class Remembered:
    """Bases seen earlier, relative to the present lens; for bases that have left the view."""

    azimuth_rad: Floats  # (N,) in increasing order, clockwise from the heading
    range_m: Floats  # (N,) horizontal range

    @classmethod
    def at(cls, points_m: Floats) -> Remembered:
        """Return points (N, 2), metres forward and right of the lens, sorted by azimuth."""
        azimuth = np.arctan2(points_m[:, 1], points_m[:, 0])
        order = np.argsort(azimuth)
        return cls(
            azimuth_rad=azimuth[order], range_m=np.hypot(points_m[order, 0], points_m[order, 1])
        )


@dataclass(frozen=True, kw_only=True)
class Runs:
    """Runs of each class in the columns of a panorama."""

    first: NDArray[np.int32]  # (C, A) row where the lowest run begins; -1 without a run
    last: NDArray[np.int32]  # (C, A) uppermost row of the class; -1 where it is not visible

    @classmethod
    def of(cls, panorama: Panorama, count: int, config: BaseConfig) -> Runs:
        """Return the runs of a panorama that are long enough to stand on a base.

        Args:
            panorama: panorama of the class map.
            count: number of classes.
            config: length of a run.
        """
        run = max(1, round(config.min_run_px * panorama.rows_per_px))
        first, last = _runs(panorama.ids, count, run)
        return cls(first=first, last=last)


@dataclass(frozen=True, kw_only=True)
class _Sight:
    """The panorama's columns that show a class."""

    columns: Indices  # (N,)
    first: Indices  # (N,) lowest row of the class in each column
    last: Indices  # (N,) uppermost row of the class in each column
    visible: Floats  # (N,) slope at the lowest row
    base: Floats  # (N,) slope of the border with the ground; NaN without ground below
    outside: NDArray[np.bool_]  # (N,) whether the image's edge cuts off the lower end
    cut: bool  # whether `outside` holds for many columns


def find_base(
    panorama: Panorama,
    runs: Runs,
    config: BaseConfig,
    *,
    thing: int,
    ground: int,
    height_m: float,
    remembered: Remembered | None = None,
) -> Base:
    """Find the base of the pixels of one class.

    Args:
        panorama: panorama of the class map.
        runs: runs of that panorama.
        config: which pixels form a base.
        thing: the class id.
        ground: the class id of the ground.
        height_m: height of the lens above the ground.
        remembered: bases seen earlier, used where the base is out of view.
    """
    sight = _look(panorama, runs, thing, ground, config)
    line, found, on_line = _believe(panorama, sight, config)
    if remembered is not None and line is None and np.isnan(found).any():
        recalled = _recall(panorama, sight, remembered, height_m, config)
        found = np.where(np.isnan(found), recalled, found)
    found[~(found >= height_m / config.max_range_m)] = np.nan
    count = panorama.azimuth_rad.size
    slope, visible = np.full(count, np.nan), np.full(count, np.nan)
    top_row = np.full(count, -1, dtype=np.intp)
    fitted = np.zeros(count, dtype=bool)
    slope[sight.columns], visible[sight.columns] = found, sight.visible
    top_row[sight.columns], fitted[sight.columns] = sight.last, on_line
    return Base(slope=slope, line=line, fitted=fitted, visible=visible, top_row=top_row)


def _look(panorama: Panorama, runs: Runs, thing: int, ground: int, config: BaseConfig) -> _Sight:
    columns = np.flatnonzero(runs.first[thing] >= 0)
    first = runs.first[thing, columns].astype(np.intp)
    ground_row = rows_above(panorama, first, columns, ground, config.gap_px, step=-1)
    depression = panorama.depression_rad
    border = np.tan(0.5 * (depression[first] + depression[ground_row]))
    below = np.where(first > 0, panorama.ids[np.maximum(first - 1, 0), columns], OUTSIDE)
    return _Sight(
        columns=columns,
        first=first,
        last=runs.last[thing, columns].astype(np.intp),
        visible=np.tan(depression[first]),
        base=np.where(ground_row >= 0, border, np.nan),
        outside=below == OUTSIDE,
        cut=bool(np.count_nonzero(below == OUTSIDE) > config.specks * columns.size),
    )


@compiled("UniTuple(int32[:, ::1], 2)(uint8[:, ::1], int64, int64)")
def _runs(
    ids: NDArray[np.uint8], count: int, run: int
) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
    """Find the lowest run of each class in each column of a panorama.

    Args:
        ids: (R, A) class ids, the lowest row first.
        count: number of classes.
        run: rows of a run at least.

    Returns:
        (C, A) row where the run of a class begins, -1 without a run; (C, A) uppermost row of the
        class, be it part of a run or not.
    """
    rows, columns = ids.shape
    first = np.full((count, columns), -1, dtype=np.int32)
    last = np.full((count, columns), -1, dtype=np.int32)
    before = np.full(columns, OUTSIDE, dtype=np.uint8)  # class in the row before
    begin = np.zeros(columns, dtype=np.int32)  # row where the present run begins
    for row in range(rows):
        for column in range(columns):
            thing = ids[row, column]
            if thing != before[column]:
                before[column], begin[column] = thing, row
            if thing >= count:  # outside the image
                continue
            last[thing, column] = row
            if row - begin[column] + 1 == run and first[thing, column] < 0:
                first[thing, column] = begin[column]
    return first, last


def rows_above(
    panorama: Panorama,
    rows: Indices,
    columns: Indices,
    wanted: int,
    gap_px: float,
    *,
    step: int = 1,
) -> Indices:
    """Return the row of a class right above (step 1) or below (step -1) given cells.

    Args:
        panorama: panorama of the class map.
        rows: (N,) rows of the cells.
        columns: (N,) columns of the cells.
        wanted: the class id.
        gap_px: maximum number of pixels of other classes in between.
        step: 1 up, -1 down.

    Returns:
        (N,) rows; -1 where the class does not follow.
    """
    reach = 1 + round(gap_px * panorama.rows_per_px)
    return _following(panorama.ids, rows, columns, wanted, step, reach)


@compiled("intp[::1](uint8[:, ::1], intp[::1], intp[::1], int64, int64, int64)")
def _following(  # noqa: PLR0917 - Numba passes arguments by position
    ids: NDArray[np.uint8], rows: Indices, columns: Indices, wanted: int, step: int, reach: int
) -> Indices:
    """Return the first row of a class within a number of rows above or below cells.

    Args:
        ids: (R, A) class ids.
        rows: (N,) rows of the cells.
        columns: (N,) columns of the cells.
        wanted: the class id.
        step: 1 towards higher rows, -1 towards lower ones.
        reach: number of rows.

    Returns:
        (N,) rows; -1 where the class does not follow.
    """
    found = np.full(len(rows), -1, dtype=np.intp)
    for cell in range(len(rows)):
        row = rows[cell]
        for _ in range(reach):
            row += step
            if not 0 <= row < ids.shape[0]:
                break
            if ids[row, columns[cell]] == wanted:
                found[cell] = row
                break
    return found


def _believe(
    panorama: Panorama, sight: _Sight, config: BaseConfig
) -> tuple[BaseLine | None, Floats, NDArray[np.bool_]]:
    """Return the fitted line, the slope of the base by column of `sight`, and where it is fitted.

    The slope is NaN where the base is unknown.
    """
    azimuth = panorama.azimuth_rad[sight.columns]
    stands = np.isfinite(sight.base)
    count = np.count_nonzero(stands)
    nothing, nowhere = np.full(azimuth.size, np.nan), np.zeros(azimuth.size, dtype=bool)
    if sight.cut and count < config.min_beside_cut:
        return None, nothing, nowhere
    line = fit_base(azimuth[stands], sight.base[stands], panorama.pixel_rad, config.line)
    if line is None or line.rms_px > config.max_rms_px:
        return None, sight.base if count >= 0.5 * azimuth.size else nothing, nowhere
    fitted = line.slope(azimuth)
    slack = config.slack_px * panorama.pixel_rad * (1.0 + sight.visible**2)
    # The base of a convex box never lies below the line of one of its faces. Pixels of the box
    # below the line show that its ragged upright edge was taken for a base.
    odd = sight.visible > fitted + slack
    if np.count_nonzero(odd) > config.specks * count:
        return None, nothing, nowhere
    on_line = (_distance(azimuth, azimuth[stands]) <= config.reach * line.spread_rad) & ~odd
    # Near a corner the fit may miss a visible base.
    return line, np.where(on_line, fitted, np.where(odd, sight.base, np.nan)), on_line


def _recall(
    panorama: Panorama,
    sight: _Sight,
    remembered: Remembered,
    height_m: float,
    config: BaseConfig,
) -> Floats:
    """Return the slope of the remembered base at the columns of `sight`; NaN without one.

    Only columns whose base is cut off by the image's edge are filled. If another obstacle hides the
    base, the remembered points may belong to either of the two.
    """
    nothing = np.full(sight.columns.size, np.nan)
    if not sight.outside.any() or not remembered.azimuth_rad.size:
        return nothing
    azimuth = panorama.azimuth_rad[sight.columns[sight.outside]]
    visible = sight.visible[sight.outside]
    # Remembered points beyond the ground in view belong to obstacles behind.
    behind_m = np.interp(remembered.azimuth_rad, azimuth, height_m / visible)
    mine = remembered.range_m <= behind_m + config.recall_m
    mine &= _distance(remembered.azimuth_rad, azimuth) <= config.recall_rad
    if np.count_nonzero(mine) < config.min_recalled:
        return nothing
    places, ranges = remembered.azimuth_rad[mine], remembered.range_m[mine]
    within = _distance(azimuth, places) <= config.recall_rad
    near_m = _near_side(places, ranges, np.clip(azimuth, places[0], places[-1]))
    # The lowest visible pixel limits the range.
    slope = np.maximum(height_m / np.maximum(near_m, 0.05), visible)
    nothing[sight.outside] = np.where(within, slope, np.nan)
    return nothing


def _near_side(places: Floats, ranges: Floats, azimuth: Floats) -> Floats:
    """Return the range at which azimuths meet the near side of the points' convex hull.

    The remembered points of a box include sides that no longer face the camera.
    """
    points = np.stack([ranges * np.cos(places), ranges * np.sin(places)], axis=-1)
    hull = cv2.convexHull(points.astype(np.float32))[:, 0].astype(np.float64)
    start, edge = hull, np.roll(hull, -1, axis=0) - hull
    along = np.stack([np.cos(azimuth), np.sin(azimuth)], axis=-1)[:, None]
    with np.errstate(divide="ignore", invalid="ignore"):
        across = along[..., 0] * edge[:, 1] - along[..., 1] * edge[:, 0]
        share = (start[:, 1] * along[..., 0] - start[:, 0] * along[..., 1]) / -across
        range_m = (start[:, 0] * edge[:, 1] - start[:, 1] * edge[:, 0]) / across
        met = (share >= -1e-6) & (share <= 1.0 + 1e-6) & (range_m > 0.0)
    met_m = np.where(met, range_m, np.inf).min(axis=1)
    # Because of rounding an azimuth at the hull's ends may miss every edge.
    nearest = np.interp(azimuth, places, ranges)
    return np.where(np.isfinite(met_m), met_m, nearest)


def _distance(places: Floats, seen: Floats) -> Floats:
    """Return the distance of each place to the nearest of `seen`; both are sorted."""
    after = np.searchsorted(seen, places)
    before = np.maximum(after - 1, 0)
    after = np.minimum(after, seen.size - 1)
    return np.asarray(np.minimum(np.abs(places - seen[before]), np.abs(places - seen[after])))
