"""Confidence of a frame's depth, and of the scale that turns a network's depth into metres.

The scale is wrong where the class map calls a wall ground, where only a patch of ground is in view,
where the network's depth does not follow the plane, or where the pitch is wrong. Each case shows in
the ratios of known to predicted depth: they scatter, they come from one place, or they change with
the range. On ground they do not change. On a wall, whose depth is constant, they grow with the
range. A wrong height does not show: it changes all ratios alike.

A logistic regression combines the measures. `python -m benchmarks.confidence train` gives its
coefficients, for the event that the scale is within a fifth of the exact one. A wrong scale counts
as twenty right ones there, so that the confidence is low rather than high. That of `history` was
fitted to sequences of images.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from operator import itemgetter
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.types.arrays import Floats, Floats32

Measure = tuple[float, str]
"""How far a measurement speaks for a quantity, 0 to 1, and the measurement in words."""

# Intercept and coefficients by measure, in the order of `evidence`: for depth in an unknown unit,
# and for depth in heights of the camera.
INTERCEPTS: Final = -9.64, -9.66
COEFFICIENTS: Final[Mapping[str, float]] = MappingProxyType(
    {"spread": 5.86, "extent": 3.45, "slope": 2.92, "residual": 1.74, "history": 0.90}
)
COEFFICIENTS_IN_HEIGHTS: Final[Mapping[str, float]] = MappingProxyType(
    {"spread": 3.24, "extent": 1.54, "slope": 2.12, "residual": 1.14, "history": 0.09}
    | {"height": 5.52}
)
# Each measure is a half at these values. Chosen on the training scenes.
_SPREAD, _SLOPE, _RESIDUAL, _INNOVATION = 0.1, 0.3, 0.03, 0.1
_HEIGHT: Final = 0.2  # twice the standard deviation of the logarithm in rooms of no training
_FLOW: Final = math.log(1.2)  # a scale is right within a fifth
# The extent is one from this share of the visible ground and this span of ranges on.
_SHARE: Final = 0.1
_SPAN: Final = 0.25
_NO_HISTORY: Final = 0.5  # instead of the agreement, without earlier frames
_NORMAL: Final = 1.4826  # standard deviation over median absolute deviation
_OF_MEDIAN: Final = 1.2533  # standard error of a median over that of a mean


@dataclass(frozen=True)
class Confidence:
    """A number from 0 to 1, or the reason why it is missing."""

    value: float | None = None
    reason: str = ""  # why it is missing, or the measure that lowers it below a half
    measures: Mapping[str, Measure] = field(default_factory=dict)

    def limited(self, name: str, by: Measure) -> Confidence:
        """Return it with a further measure, which it cannot exceed."""
        if self.value is None:
            return self
        measures = {**self.measures, name: by}
        if by[0] >= self.value:
            return replace(self, measures=measures)
        return Confidence(by[0], by[1] if by[0] < 0.5 else self.reason, measures)


@dataclass(frozen=True, kw_only=True)
class GroundMeasures:
    """Measures of a sample of ground; ratios and ranges as natural logarithms."""

    log_scale: float  # median of the ratios of known to predicted depth
    std: float  # standard error of `log_scale`
    spread: float  # of the ratios about their median, a standard deviation
    share: float  # of the pixels that can show ground which do, 0 to 1
    span: float  # of the ranges, from near to far
    slope: float  # of the ratios over the ranges, with its error: 0 on ground, 1 on a wall
    residual: float  # of the ratios about that slope, a standard deviation

    @classmethod
    def of(cls, known_m: Floats32, predicted: Floats32, share: float) -> GroundMeasures:
        """Return the measures of (N,) positive depths of the plane and of the network."""
        ranges: Floats = np.log(known_m.astype(np.float64))
        ratios: Floats = ranges - np.log(predicted.astype(np.float64))
        near, far = np.percentile(ranges, (5.0, 95.0))
        varied = max(float(ranges.std()), 1e-6)
        slope = _slope(ranges, ratios, 0.25 * varied)
        residual, spread = _deviation(ratios - slope * ranges), _deviation(ratios)
        # Ranges that hardly differ show no slope. Its standard error then stands for it.
        error = _OF_MEDIAN * residual / (math.sqrt(len(ranges)) * varied)
        return cls(
            log_scale=float(np.median(ratios)),
            std=_OF_MEDIAN * spread / math.sqrt(len(ranges)),
            spread=spread,
            share=share,
            span=float(far - near),
            slope=abs(slope) + error,
            residual=residual,
        )


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
) -> dict[str, Measure]:
    """Return how far each measure speaks for the scale.

    Args:
        measures: of the frame's ground.
        innovation: difference between the logarithms of this frame's scale and of the scale of
            earlier frames; None without any.
        height_m: height of the camera above the ground, if the network's depth is in such heights:
            the ground in view and the height then both give the scale. None for another network.
    """
    spread, span, slope = measures.spread, measures.span, measures.slope
    words = {
        "spread": f"the scale differs by {_percent(spread)} from pixel to pixel",
        "extent": f"ground in {100.0 * measures.share:.0f} % of the pixels that can show it, "
        f"the farthest {math.exp(span):.1f} times as far as the nearest",
        "slope": f"the scale changes with the range to the power of {slope:.2f}: 0 on ground, 1 on "
        "a wall",
        "residual": f"the depth is rough by {_percent(measures.residual)}",
        "history": "no scale of earlier frames",
    }
    found = {
        "spread": _falling(spread, _SPREAD),
        "extent": min(1.0, measures.share / _SHARE) * min(1.0, span / _SPAN),
        "slope": _falling(slope, _SLOPE),
        "residual": _falling(measures.residual, _RESIDUAL),
        "history": _NO_HISTORY,
    }
    if innovation is not None:
        found["history"], off = _falling(innovation, _INNOVATION), _percent(innovation)
        words["history"] = f"the scale differs by {off} from that of earlier frames"
    if height_m is not None:
        apart = measures.log_scale - math.log(height_m)
        found["height"] = _falling(apart**2, _HEIGHT**2)
        words["height"] = f"the scale by the ground differs by {_percent(apart)} from the height"
    return {name: (value, words[name]) for name, value in found.items()}


def scale_confidence(found: Mapping[str, Measure]) -> Confidence:
    """Return the probability that a scale with this evidence is right within a fifth."""
    in_heights = "height" in found
    weights = COEFFICIENTS_IN_HEIGHTS if in_heights else COEFFICIENTS
    logit = INTERCEPTS[in_heights] + sum(
        weight * found[name][0] for name, weight in weights.items()
    )
    value = 1.0 / (1.0 + math.exp(-logit))
    lost = {name: weight * (1.0 - found[name][0]) for name, weight in weights.items()}
    reason = found[max(lost, key=lost.__getitem__)][1] if value < 0.5 else ""
    return Confidence(value, reason, found)


def ground_confidence(measures: GroundMeasures) -> Confidence:
    """Return how far the ground is seen as such: by its extent, and as a plane."""
    found = evidence(measures, None)
    about = {name: found[name] for name in ("extent", "slope")}
    value, reason = weakest(about)
    return Confidence(value, reason if value < 0.5 else "", about)


def weakest(measures: Mapping[str, Measure]) -> Measure:
    """Return the measure that says least."""
    return min(measures.values(), key=itemgetter(0))


def flow_measure(stretch: float) -> Measure:
    """Return how far the ground's optical flow agrees with the drone's motion.

    Args:
        stretch: `MotionEstimate.stretch`, the factor by which height or focal length is wrong.
    """
    value = 0.0 if stretch <= 0.0 else _falling(math.log(stretch), _FLOW)
    return value, f"the ground passes {stretch:.2f} times as fast as telemetry reports"


def _falling(value: float, half: float) -> float:
    """Return 1 for zero, a half at `half`, and less beyond."""
    return 1.0 / (1.0 + (value / half) ** 2)


def _percent(logarithm: float) -> str:
    return f"{100.0 * math.expm1(abs(logarithm)):.0f} %"
