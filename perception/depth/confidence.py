"""Confidence of the depth of a frame: of its ground, its scale, and the depth itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace


@dataclass(frozen=True, kw_only=True)
class Confidence:
    """A number from 0 to 1, or the reason why it is missing."""

    value: float | None = None
    reason: str = ""  # why it is missing, or the measure that lowers it below a half
    # Its measures by name; each has its number and its measurement.
    measures: Mapping[str, Confidence] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Confidences:
    """Confidences of one frame."""

    ground: Confidence = field(default_factory=Confidence)  # that the ground is seen as such
    scale: Confidence = field(default_factory=Confidence)  # of the network's depth
    depth: Confidence = field(default_factory=Confidence)  # of the metric depth

    def limited(self, name: str, by: Confidence) -> Confidences:
        """Return them with a further measure, which neither ground nor depth can exceed."""
        return replace(
            self, ground=_limited(self.ground, name, by), depth=_limited(self.depth, name, by)
        )

    @classmethod
    def none(cls, reason: str) -> Confidences:
        """Return no confidence in anything, for one reason."""
        nothing = Confidence(reason=reason)
        return cls(ground=nothing, scale=nothing, depth=nothing)


def _limited(confidence: Confidence, name: str, by: Confidence) -> Confidence:
    if confidence.value is None or by.value is None:
        return confidence
    measures = {**confidence.measures, name: by}
    if by.value >= confidence.value:
        return replace(confidence, measures=measures)
    reason = by.reason if by.value < 0.5 else confidence.reason
    return Confidence(value=by.value, reason=reason, measures=measures)
