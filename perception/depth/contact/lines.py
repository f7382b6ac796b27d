"""Fit of the line in which an upright box meets the ground.

The inverse horizontal range of a vertical plane is linear in the cosine and the sine of the
azimuth. So is ``slope = height / range``, the tangent of the depression of the base. A box shows
one or two faces: one such line, or two that meet at the nearest corner.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from uav_bt.compiled import compiled
from uav_bt.types import rotate_points
from uav_bt.types.arrays import Floats


@dataclass(frozen=True, kw_only=True)
class LineConfig:
    """How faces are fitted."""

    min_bearings: int = 4  # per face; fewer do not determine its slope
    split_gain: float = 0.6  # two faces must reduce the squared residuals below this share
    one_face_px: float = 0.4  # a line with a smaller error is not split; rounding gives 0.29
    outlier_px: float = 1.5  # residual in the first fit: mask noise, or bases of other boxes


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


def fit_base(
    azimuth_rad: Floats, slope: Floats, pixel_rad: float, config: LineConfig | None = None
) -> BaseLine | None:
    """Fit one or two faces.

    Args:
        azimuth_rad: (N,) azimuths in increasing order.
        slope: (N,) tangent of the depression of the base at these azimuths.
        pixel_rad: depression of one pixel; residuals are weighted in pixels.
        config: how faces are fitted.

    Returns:
        The line; None for too few bearings.
    """
    config = config or LineConfig()
    fitted = _fit(azimuth_rad, slope, pixel_rad, config)
    if fitted is None:
        return None
    weight = _weight(slope, pixel_rad)
    residual_px = np.abs(fitted.slope(azimuth_rad) - slope) * weight
    if residual_px.max() <= config.outlier_px:
        return fitted
    kept = residual_px <= max(config.outlier_px, 2.5 * float(np.median(residual_px)))
    return _fit(azimuth_rad[kept], slope[kept], pixel_rad, config) or fitted


def _weight(slope: Floats, pixel_rad: float) -> Floats:
    return np.asarray(1.0 / ((1.0 + slope**2) * pixel_rad))


def _fit(
    azimuth_rad: Floats, slope: Floats, pixel_rad: float, config: LineConfig
) -> BaseLine | None:
    count = azimuth_rad.size
    if count < config.min_bearings:
        return None
    # Azimuths relative to the middle one make the normal equations well conditioned.
    middle = 0.5 * float(azimuth_rad[0] + azimuth_rad[-1])
    faces, split, sse = _faces(
        azimuth_rad - middle,
        slope,
        pixel_rad,
        config.min_bearings,
        (config.one_face_px, config.split_gain),
    )
    corner = math.inf if split < 0 else _meeting(faces, middle, float(azimuth_rad[split]))
    return BaseLine(
        faces=rotate_points(faces, middle),
        corner_rad=corner,
        rms_px=math.sqrt(sse / count),
        spread_rad=float(azimuth_rad[-1] - azimuth_rad[0]),
    )


@compiled("UniTuple(float64, 3)(float64[::1])")
def _solved(sums: Floats) -> tuple[float, float, float]:
    """Solve 2x2 normal equations: both factors and the squared residuals.

    Args:
        sums: (6,) sums of cc, cd, dd, cs, ds, ss: cosine, sine and slope.
    """
    cc, cd, dd, cs, ds, ss = sums[0], sums[1], sums[2], sums[3], sums[4], sums[5]
    determinant = max(cc * dd - cd * cd, 1e-12)
    first = (cs * dd - ds * cd) / determinant
    second = (ds * cc - cs * cd) / determinant
    return first, second, max(ss - first * cs - second * ds, 0.0)


@compiled(
    "Tuple((float64[:, ::1], int64, float64))"
    "(float64[::1], float64[::1], float64, int64, UniTuple(float64, 2))"
)
def _faces(
    azimuth_rad: Floats,
    slope: Floats,
    pixel_rad: float,
    min_bearings: int,
    limits: tuple[float, float],
) -> tuple[Floats, int, float]:
    """Fit one face, or two if they reduce the residuals enough.

    Args:
        azimuth_rad: (N,) azimuths in increasing order, about zero.
        slope: (N,) tangent of the depression of the base.
        pixel_rad: depression of one pixel.
        min_bearings: of a face.
        limits: root mean square error, px, up to which one face suffices; two faces must reduce the
            squared residuals below this share.

    Returns:
        (1 or 2, 2) factors of cosine and sine; the last bearing of the first of two faces, -1 for
        one face; and the sum of the squared residuals, px2.
    """
    one_face_px, split_gain = limits
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
    first, second, sse = _solved(whole)
    faces, split = np.array([[first, second]]), -1
    if count < 2 * min_bearings or math.sqrt(sse / count) <= one_face_px:
        return faces, split, sse
    least = split_gain * sse
    both = np.empty((2, 2))
    for last in range(min_bearings - 1, count - min_bearings):
        before = sums[last + 1]
        left, right = _solved(before), _solved(whole - before)
        # A convex box bends only one way: the line is steepest at its nearest corner.
        if left[1] > right[1] and left[2] + right[2] < least:
            least, split = left[2] + right[2], last
            both[0, 0], both[0, 1], both[1, 0], both[1, 1] = left[0], left[1], right[0], right[1]
    return (faces, split, sse) if split < 0 else (both, split, least)


def _meeting(faces: Floats, middle: float, split_rad: float) -> float:
    """Return the azimuth at which two faces have equal slope, near the split of the data."""
    difference = faces[0] - faces[1]
    meeting = middle + math.atan2(-difference[0], difference[1])
    turns = round((split_rad - meeting) / math.pi)  # the lines cross once every half turn
    return meeting + turns * math.pi
