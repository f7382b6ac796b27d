"""Confidence of the depth of a frame: of its ground, its scale, and the depth itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


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

    @classmethod
    def none(cls, reason: str) -> Confidences:
        """Return no confidence in anything, for one reason."""
        nothing = Confidence(reason=reason)
        return cls(ground=nothing, scale=nothing, depth=nothing)
