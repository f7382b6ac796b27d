"""Fit of the line in which an upright box meets the carpet.

The inverse horizontal range of a vertical plane is linear in the cosine and the sine of the
azimuth. So is ``slope = height / range``, the tangent of the depression of the base. A box shows
one or two faces: one such line, or two that meet at the nearest corner.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

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
    kept = residual_px <= max(config.outlier_px, 2.5 * float(np.median(residual_px)))
    if kept.all():
        return fitted
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
    weight = _weight(slope, pixel_rad)
    c = np.cos(azimuth_rad - middle) * weight
    d = np.sin(azimuth_rad - middle) * weight
    s = slope * weight
    sums = np.cumsum(np.stack([c * c, c * d, d * d, c * s, d * s, s * s]), axis=1)
    whole, whole_sse = _solve(sums[:, -1:])
    faces, corner, sse = whole, math.inf, float(whole_sse[0])
    if count >= 2 * config.min_bearings and math.sqrt(sse / count) > config.one_face_px:
        before = sums[:, config.min_bearings - 1 : count - config.min_bearings]
        left, left_sse = _solve(before)
        right, right_sse = _solve(sums[:, -1:] - before)
        # A convex box bends only one way: the line is steepest at its nearest corner.
        both = np.where(left[:, 1] > right[:, 1], left_sse + right_sse, np.inf)
        best = int(both.argmin())
        if both[best] < config.split_gain * sse:
            faces, sse = np.stack([left[best], right[best]]), float(both[best])
            corner = _meeting(faces, middle, azimuth_rad[config.min_bearings - 1 + best])
    return BaseLine(
        faces=rotate_points(faces, middle),
        corner_rad=corner,
        rms_px=math.sqrt(max(sse, 0.0) / count),
        spread_rad=float(azimuth_rad[-1] - azimuth_rad[0]),
    )


def _solve(sums: Floats) -> tuple[Floats, Floats]:
    """Solve stacked 2x2 normal equations: (M, 2) factors and (M,) squared residuals."""
    cc, cd, dd, cs, ds, ss = sums
    determinant = np.maximum(cc * dd - cd * cd, 1e-12)
    first = (cs * dd - ds * cd) / determinant
    second = (ds * cc - cs * cd) / determinant
    return np.stack([first, second], axis=1), np.maximum(ss - first * cs - second * ds, 0.0)


def _meeting(faces: Floats, middle: float, split_rad: float) -> float:
    """Return the azimuth at which two faces have equal slope, near the split of the data."""
    difference = faces[0] - faces[1]
    meeting = middle + math.atan2(-difference[0], difference[1])
    turns = round((split_rad - meeting) / math.pi)  # the lines cross once every half turn
    return meeting + turns * math.pi
