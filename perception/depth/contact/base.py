"""Bases: the contact of obstacles with the ground by azimuth, from a panorama of the class map.

An upright face meets the ground in a line. The inverse horizontal range of a vertical plane is
linear in the cosine and the sine of the azimuth. So is ``slope = height / range``, the tangent of
the depression of the base. A box shows one or two faces: one such line, or two that meet at the
nearest corner.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import cv2
import numpy as np

from perception.depth.contact.scan import NOT_IN_IMAGE, Panorama, Runs
from uav_bt.compiled import compiled
from uav_bt.types import rotate_points
from uav_bt.types.arrays import Flags, Floats, Indices

_MAX_RMS_PX: Final = 1.5  # of a fitted base; with a larger error the seen base is used unfitted
# A fitted base is extended by this multiple of its visible azimuth range, behind other boxes and
# below the image's lower edge.
_REACH: Final = 1.0
# A box with its base cut off has a ragged upright edge with ground beside it. A cut box needs at
# least this number of columns on ground for a base.
_MIN_BESIDE_CUT: Final = 10
_SPECKS: Final = 0.25  # a base is rejected if more than this share of its columns contradict it
_SLACK_PX: Final = 2.0  # a side may reach below its fitted base by this
_MAX_RANGE_M: Final = 7.0  # the lab's diagonal; there one pixel of the base is 0.2 m
# Remembered bases drift by decimetres and a few degrees. They are used within _RECALL_RAD of their
# azimuths, and up to _RECALL_M beyond the lowest visible pixel.
_RECALL_RAD: Final = 0.09
_RECALL_M: Final = 0.1
_MIN_RECALLED: Final = 3  # points; fewer may be noise of an old mask

_MIN_BEARINGS: Final = 4  # of a face; fewer do not determine its slope
_SPLIT_GAIN: Final = 0.6  # two faces must reduce the squared residuals below this share
_ONE_FACE_PX: Final = 0.4  # a line with a smaller error is not split; rounding gives 0.29
_OUTLIER_PX: Final = 1.5  # residual in the first fit: mask noise, or bases of other boxes


@dataclass(frozen=True, kw_only=True)
class BaseLine:
    """Slope over azimuth: one face, or two that meet at an azimuth."""

    faces: Floats  # (1 or 2, 2): factors of the azimuth's cosine and sine, by increasing azimuth
    corner_rad: float  # azimuth where the second face begins; inf for one face
    rms_px: float  # root mean square residual, in pixels of the image
    spread_rad: float  # azimuth between the outermost fitted bearings

    def slope(self, azimuth_rad: Floats) -> Floats:
        """Return height over range at azimuths, same shape; 0 or less where the line is not met."""
        factors = self.faces[(azimuth_rad >= self.corner_rad).astype(np.intp)]
        return np.asarray(
            factors[..., 0] * np.cos(azimuth_rad) + factors[..., 1] * np.sin(azimuth_rad)
        )


@dataclass(frozen=True, kw_only=True)
class Base:
    """The base of one class, by column of the panorama."""

    slope: Floats  # (A,) camera height over range of the base; NaN where unknown
    line: BaseLine | None  # the fitted line; None without a fit
    fitted: Flags  # (A,) columns whose slope comes from the line
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


def find_base(
    panorama: Panorama,
    runs: Runs,
    *,
    thing: int,
    ground: int,
    height_m: float,
    remembered: Remembered | None,
) -> Base:
    """Find the base of the pixels of class `thing` on class `ground`.

    The lens is at `height_m` above the ground. Bases `remembered` serve where it is out of view.
    """
    columns = np.flatnonzero(runs[0][thing] >= 0)
    first = runs[0][thing, columns].astype(np.intp)
    azimuth, depression = panorama.azimuth_rad[columns], panorama.depression_rad
    below = panorama.next_row(first, columns, ground, -1)
    border = np.tan(0.5 * (depression[first] + depression[below]))
    seen, lowest = np.where(below >= 0, border, np.nan), np.tan(depression[first])
    under = np.where(first > 0, panorama.ids[np.maximum(first - 1, 0), columns], NOT_IN_IMAGE)
    outside = under == NOT_IN_IMAGE  # the image's edge cuts off the lower end
    line, found, on_line = _believed(azimuth, seen, lowest, outside, panorama.pixel_rad)
    if remembered is not None and line is None and (np.isnan(found) & outside).any():
        recalled = _recalled(azimuth[outside], lowest[outside], remembered, height_m)
        found[outside] = np.where(np.isnan(found[outside]), recalled, found[outside])
    found[~(found >= height_m / _MAX_RANGE_M)] = np.nan
    count = panorama.azimuth_rad.size
    slope, visible = np.full(count, np.nan), np.full(count, np.nan)
    top_row, fitted = np.full(count, -1, dtype=np.intp), np.zeros(count, dtype=bool)
    slope[columns], visible[columns], fitted[columns] = found, lowest, on_line
    top_row[columns] = runs[1][thing, columns]
    return Base(slope=slope, line=line, fitted=fitted, visible=visible, top_row=top_row)


def _believed(
    azimuth: Floats, seen: Floats, lowest: Floats, outside: Flags, pixel_rad: float
) -> tuple[BaseLine | None, Floats, Flags]:
    """Return the fitted line, the slope of the base, NaN where unknown, and where it is fitted.

    For N columns that show the class: `seen`, the slope of the border with the ground, NaN without
    ground below; `lowest`, that at its lowest pixel; `outside`, whether the image's edge cuts it.
    """
    stands = np.isfinite(seen)
    count = np.count_nonzero(stands)
    nothing, nowhere = np.full(azimuth.size, np.nan), np.zeros(azimuth.size, dtype=bool)
    if np.count_nonzero(outside) > _SPECKS * azimuth.size and count < _MIN_BESIDE_CUT:
        return None, nothing, nowhere
    line = fit_base(azimuth[stands], seen[stands], pixel_rad)
    if line is None or line.rms_px > _MAX_RMS_PX:
        return None, seen if count >= 0.5 * azimuth.size else nothing, nowhere
    fitted = line.slope(azimuth)
    # The base of a convex box never lies below the line of one of its faces. Pixels of the box
    # below the line show that its ragged upright edge was taken for a base.
    odd = lowest > fitted + _SLACK_PX * pixel_rad * (1.0 + lowest**2)
    if np.count_nonzero(odd) > _SPECKS * count:
        return None, nothing, nowhere
    on_line = (_distance(azimuth, azimuth[stands]) <= _REACH * line.spread_rad) & ~odd
    # Near a corner the fit may miss a visible base.
    return line, np.where(on_line, fitted, np.where(odd, seen, np.nan)), on_line


def _recalled(azimuth: Floats, lowest: Floats, remembered: Remembered, height_m: float) -> Floats:
    """Return the slope of the remembered base at azimuths, NaN without one.

    The azimuths are those whose base is cut off by the image's edge. If another obstacle hides the
    base, the remembered points may belong to either of the two.
    """
    nothing = np.full(azimuth.size, np.nan)
    if not remembered.azimuth_rad.size:
        return nothing
    # Remembered points beyond the ground in view belong to obstacles behind.
    behind_m = np.interp(remembered.azimuth_rad, azimuth, height_m / lowest)
    mine = remembered.range_m <= behind_m + _RECALL_M
    mine &= _distance(remembered.azimuth_rad, azimuth) <= _RECALL_RAD
    if np.count_nonzero(mine) < _MIN_RECALLED:
        return nothing
    places, ranges = remembered.azimuth_rad[mine], remembered.range_m[mine]
    near_m = _near_side(places, ranges, np.clip(azimuth, places[0], places[-1]))
    # The lowest visible pixel limits the range.
    slope = np.maximum(height_m / np.maximum(near_m, 0.05), lowest)
    return np.where(_distance(azimuth, places) <= _RECALL_RAD, slope, np.nan)


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
    return np.where(np.isfinite(met_m), met_m, np.interp(azimuth, places, ranges))


def _distance(places: Floats, seen: Floats) -> Floats:
    """Return the distance of each place to the nearest of `seen`; both are sorted."""
    after = np.searchsorted(seen, places)
    before = np.maximum(after - 1, 0)
    after = np.minimum(after, seen.size - 1)
    return np.asarray(np.minimum(np.abs(places - seen[before]), np.abs(places - seen[after])))


def fit_base(azimuth_rad: Floats, slope: Floats, pixel_rad: float) -> BaseLine | None:
    """Fit one or two faces; return the line, or None for too few bearings.

    `slope`, (N,), is the tangent of the depression of the base at N increasing azimuths; residuals
    are weighted in pixels, whose depression is `pixel_rad`.
    """
    fitted = _fit(azimuth_rad, slope, pixel_rad)
    if fitted is None:
        return None
    residual_px = np.abs(fitted.slope(azimuth_rad) - slope) * (1.0 / ((1.0 + slope**2) * pixel_rad))
    if residual_px.max() <= _OUTLIER_PX:
        return fitted
    kept = residual_px <= max(_OUTLIER_PX, 2.5 * float(np.median(residual_px)))
    return _fit(azimuth_rad[kept], slope[kept], pixel_rad) or fitted


def _fit(azimuth_rad: Floats, slope: Floats, pixel_rad: float) -> BaseLine | None:
    count = azimuth_rad.size
    if count < _MIN_BEARINGS:
        return None
    # Azimuths relative to the middle one make the normal equations well conditioned.
    middle = 0.5 * float(azimuth_rad[0] + azimuth_rad[-1])
    faces, split, squares = _faces(azimuth_rad - middle, slope, pixel_rad)
    corner = math.inf
    if split >= 0:  # where the faces have equal slope; the lines cross once every half turn
        factors = faces[0] - faces[1]
        meeting = middle + math.atan2(-factors[0], factors[1])
        corner = meeting + round((float(azimuth_rad[split]) - meeting) / math.pi) * math.pi
    return BaseLine(
        faces=rotate_points(faces, middle),
        corner_rad=corner,
        rms_px=math.sqrt(squares / count),
        spread_rad=float(azimuth_rad[-1] - azimuth_rad[0]),
    )


@compiled("UniTuple(float64, 3)(float64[::1])")
def _solved(sums: Floats) -> tuple[float, float, float]:
    """Solve 2x2 normal equations from sums (6,) of cc, cd, dd, cs, ds, ss: cosine, sine, slope.

    Return both factors and the squared residuals.
    """
    cc, cd, dd, cs, ds, ss = sums[0], sums[1], sums[2], sums[3], sums[4], sums[5]
    determinant = max(cc * dd - cd * cd, 1e-12)
    first = (cs * dd - ds * cd) / determinant
    second = (ds * cc - cs * cd) / determinant
    return first, second, max(ss - first * cs - second * ds, 0.0)


@compiled("Tuple((float64[:, ::1], int64, float64))(float64[::1], float64[::1], float64)")
def _faces(azimuth_rad: Floats, slope: Floats, pixel_rad: float) -> tuple[Floats, int, float]:
    """Fit one face, or two if they reduce the residuals enough; azimuths are about zero.

    Returns:
        (1 or 2, 2) factors of cosine and sine; the last bearing of the first of two faces, -1 for
        one face; and the sum of the squared residuals, px2.
    """
    count = len(slope)
    sums = np.zeros((count + 1, 6))  # cumulative
    for bearing in range(count):
        weight = 1.0 / ((1.0 + slope[bearing] ** 2) * pixel_rad)
        c = math.cos(azimuth_rad[bearing]) * weight
        d = math.sin(azimuth_rad[bearing]) * weight
        s = slope[bearing] * weight
        for place, product in enumerate((c * c, c * d, d * d, c * s, d * s, s * s)):
            sums[bearing + 1, place] = sums[bearing, place] + product
    whole = sums[count]
    first, second, squares = _solved(whole)
    faces, split = np.array([[first, second]]), -1
    if count < 2 * _MIN_BEARINGS or math.sqrt(squares / count) <= _ONE_FACE_PX:
        return faces, split, squares
    least = _SPLIT_GAIN * squares
    both = np.empty((2, 2))
    for last in range(_MIN_BEARINGS - 1, count - _MIN_BEARINGS):
        before = sums[last + 1]
        left, right = _solved(before), _solved(whole - before)
        # A convex box bends only one way: the line is steepest at its nearest corner.
        if left[1] > right[1] and left[2] + right[2] < least:
            least, split = left[2] + right[2], last
            both[0, 0], both[0, 1], both[1, 0], both[1, 1] = left[0], left[1], right[0], right[1]
    return (faces, split, squares) if split < 0 else (both, split, least)
