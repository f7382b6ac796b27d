"""Confidence of the scale of one frame, from measures of the ground that it was taken from.

The scale is wrong where the class map calls a wall ground, where only a patch of ground is in view,
where the network's depth does not follow the plane, or where the pitch is wrong. Each case shows in
the ratios of known to predicted depth: they scatter, they come from one place, or they change with
the range. On ground they do not change. On a wall, whose depth is constant, they grow with the
range. A wrong height does not show: it changes all ratios alike.

A logistic regression combines the measures. Its coefficients are those of

    python -m benchmarks.confidence fit

for the event that the scale is within a fifth of the exact one. A wrong scale counts as twenty
right ones there, so that the confidence is low rather than high.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.depth.confidence import Confidence
from uav_bt.types.arrays import Floats, Floats32

INTERCEPT: Final = -9.64
COEFFICIENTS: Final[Mapping[str, float]] = MappingProxyType(
    {"spread": 5.86, "extent": 3.45, "slope": 2.92, "residual": 1.74, "history": 0.90}
)
"""By measure, in the order of `evidence`."""

INTERCEPT_IN_HEIGHTS: Final = -9.66
COEFFICIENTS_IN_HEIGHTS: Final[Mapping[str, float]] = MappingProxyType(
    {
        "spread": 3.24,
        "extent": 1.54,
        "slope": 2.12,
        "residual": 1.14,
        "history": 0.09,
        "height": 5.52,
    }
)
"""The same for a network whose depth is in heights of the camera."""

# Each measure is a half at these values. Chosen on the training scenes.
_SPREAD: Final = 0.1
_SLOPE: Final = 0.3
_RESIDUAL: Final = 0.03
_INNOVATION: Final = 0.1
# Twice the standard deviation of the logarithm in rooms that no training saw.
_HEIGHT: Final = 0.2
_FLOW: Final = math.log(1.2)  # a scale is right within a fifth
# The extent is one from this share of the visible ground and this span of ranges on.
_SHARE: Final = 0.1
_SPAN: Final = 0.25
_NO_HISTORY: Final = 0.5  # instead of the agreement, without earlier frames
_NORMAL: Final = 1.4826  # standard deviation over median absolute deviation
_OF_MEDIAN: Final = 1.2533  # standard error of a median over that of a mean


@dataclass(frozen=True, kw_only=True)
class GroundMeasures:
    """Measures of a sample of ground; ratios and ranges as natural logarithms."""

    log_scale: float  # median of the ratios of known to predicted depth
    spread: float  # of the ratios about their median, a standard deviation
    share: float  # of the pixels that can show ground which do, 0 to 1
    span: float  # of the ranges, from near to far
    slope: float  # of the ratios over the ranges, with its error: 0 on ground, 1 on a wall
    residual: float  # of the ratios about that slope, a standard deviation
    points: int

    @classmethod
    def of(cls, known_m: Floats32, predicted: Floats32, share: float) -> GroundMeasures:
        """Return the measures of a sample.

        Args:
            known_m: (N,) depth of the plane of the ground, metres, positive.
            predicted: (N,) depth by the network, in its unit, positive.
            share: of the pixels that can show ground which do, 0 to 1.
        """
        ranges: Floats = np.log(known_m.astype(np.float64))
        ratios: Floats = ranges - np.log(predicted.astype(np.float64))
        near, far = np.percentile(ranges, (5.0, 95.0))
        varied = max(float(ranges.std()), 1e-6)
        slope = _slope(ranges, ratios, 0.25 * varied)
        residual = _deviation(ratios - slope * ranges)
        # Ranges that hardly differ show no slope. Its standard error then stands for it.
        error = _OF_MEDIAN * residual / (math.sqrt(len(ranges)) * varied)
        return cls(
            log_scale=float(np.median(ratios)),
            spread=_deviation(ratios),
            share=share,
            span=float(far - near),
            slope=abs(slope) + error,
            residual=residual,
            points=len(ranges),
        )

    @property
    def std(self) -> float:
        """Standard error of `log_scale`."""
        return _OF_MEDIAN * self.spread / math.sqrt(self.points)


def _deviation(values: Floats) -> float:
    return _NORMAL * float(np.median(np.abs(values - np.median(values))))


def _slope(ranges: Floats, ratios: Floats, least: float) -> float:
    """Return the median slope between two points that are `least` apart (Theil and Sen)."""
    first, second = _pairs(len(ranges))
    apart = ranges[second] - ranges[first]
    usable = np.abs(apart) > least
    if not usable.any():
        return 0.0
    return float(np.median((ratios[second] - ratios[first])[usable] / apart[usable]))


@lru_cache(maxsize=32)
def _pairs(count: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    first, second = np.triu_indices(count, k=1)
    return first, second


def evidence(
    measures: GroundMeasures, innovation: float | None, height_m: float | None = None
) -> dict[str, Confidence]:
    """Return how far each measure speaks for the scale, 0 to 1, with its measurement.

    Args:
        measures: of the frame's ground.
        innovation: difference between the logarithms of this frame's scale and of the scale of
            earlier frames; None without any.
        height_m: height of the camera above the ground, if the network's depth is in such heights.
            Two facts then give the scale: the ground in view, and the height by range sensor and
            altimeter. None for another network.
    """
    filled = min(1.0, measures.share / _SHARE)
    extent = filled * min(1.0, measures.span / _SPAN)
    history, before = _NO_HISTORY, "no scale of earlier frames"
    if innovation is not None:
        history = _falling(innovation, _INNOVATION)
        before = f"the scale differs by {_percent(innovation)} from that of earlier frames"
    found = {
        "spread": Confidence(
            value=_falling(measures.spread, _SPREAD),
            reason=f"the scale differs by {_percent(measures.spread)} from pixel to pixel",
        ),
        "extent": Confidence(
            value=extent,
            reason=f"ground in {100.0 * measures.share:.0f} % of the pixels that can show it, "
            f"the farthest {math.exp(measures.span):.1f} times as far as the nearest",
        ),
        "slope": Confidence(
            value=_falling(measures.slope, _SLOPE),
            reason=f"the scale changes with the range to the power of {measures.slope:.2f}: 0 on "
            "ground, 1 on a wall",
        ),
        "residual": Confidence(
            value=_falling(measures.residual, _RESIDUAL),
            reason=f"the depth is rough by {_percent(measures.residual)}",
        ),
        "history": Confidence(value=history, reason=before),
    }
    if height_m is not None:
        off = measures.log_scale - math.log(height_m)
        found["height"] = Confidence(
            value=_falling(off**2, _HEIGHT**2),
            reason=f"the scale by the ground differs by {_percent(off)} from the height",
        )
    return found


def scale_confidence(found: Mapping[str, Confidence]) -> Confidence:
    """Return the probability that a scale is right within a fifth.

    Args:
        found: `evidence` of its frame.
    """
    intercept, weights = INTERCEPT, COEFFICIENTS
    if "height" in found:
        intercept, weights = INTERCEPT_IN_HEIGHTS, COEFFICIENTS_IN_HEIGHTS
    values = {name: found[name].value or 0.0 for name in weights}
    logit = intercept + sum(weight * values[name] for name, weight in weights.items())
    value = 1.0 / (1.0 + math.exp(-logit))
    lost = {name: weight * (1.0 - values[name]) for name, weight in weights.items()}
    reason = found[max(lost, key=lost.__getitem__)].reason if value < 0.5 else ""
    return Confidence(value=value, reason=reason, measures=dict(found))


def ground_confidence(measures: GroundMeasures) -> Confidence:
    """Return how far the ground is seen as such: by its extent, and as a plane."""
    found = evidence(measures, None)
    about = {name: found[name] for name in ("extent", "slope")}
    weakest = min(about.values(), key=lambda each: each.value or 0.0)
    value = weakest.value or 0.0
    return Confidence(value=value, reason=weakest.reason if value < 0.5 else "", measures=about)


def flow_confidence(stretch: float) -> Confidence:
    """Return how far the ground's optical flow agrees with the drone's motion.

    Args:
        stretch: displacement over the ground by the frames over that of telemetry
            (`MotionEstimate.stretch`): the factor by which height or focal length is wrong.
    """
    value = 0.0 if stretch <= 0.0 else _falling(math.log(stretch), _FLOW)
    return Confidence(
        value=value, reason=f"the ground passes {stretch:.2f} times as fast as telemetry reports"
    )


def _falling(value: float, half: float) -> float:
    """Return 1 for zero, a half at `half`, and less beyond."""
    return 1.0 / (1.0 + (value / half) ** 2)


def _percent(logarithm: float) -> str:
    return f"{100.0 * math.expm1(abs(logarithm)):.0f} %"
