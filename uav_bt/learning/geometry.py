"""Lengths of a lab in its flights, measured in several ways, and likely causes of differences."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np

from uav_bt.types.arrays import Floats

_LEAST_MARKS: Final = 3  # frames with the mark, below which no cause is named. Chosen.
_GROUND_ERROR: Final = 0.1  # median on the ground, above which the depth network is wrong. Chosen.


@dataclass(frozen=True, kw_only=True)
class MarkRanges:
    """Horizontal range from the lens to the mark in one frame, metres.

    Attributes:
        by_size: From the mark's size: that of the tags, or of its top in the class map.
        by_height: From the lens' height above the mark's top and the place in the class map.
        by_depth: From the depth network, scaled by the ground; NaN without a scale.
    """

    by_size: float
    by_height: float
    by_depth: float


@dataclass(kw_only=True)
class Geometry:
    """Comparison of lengths in flights.

    Attributes:
        tolerance: Relative difference of two ranges of the mark that needs no cause.
        frames: Number of frames that were compared.
        ground_errors: Relative errors of the scaled depth on ground nearer than 4 m, by frame.
        refusals: Frames without scaled depth, by reason.
        marks: Ranges of the mark, one for each frame that shows it.
    """

    tolerance: float = 0.1
    frames: int = 0
    ground_errors: list[Floats] = field(default_factory=list)
    refusals: Counter[str] = field(default_factory=Counter)
    marks: list[MarkRanges] = field(default_factory=list)

    def ground_error(self, percentile: float) -> float:
        """Return a percentile of the absolute relative error on the ground; NaN without ground."""
        if not self.ground_errors:
            return math.nan
        return float(np.percentile(np.abs(np.concatenate(self.ground_errors)), percentile))

    def ratio(self, of: str, to: str) -> float:
        """Return the median ratio of two ranges of the mark, named as in `MarkRanges`."""
        ratios = [getattr(each, of) / getattr(each, to) for each in self.marks]
        known = [each for each in ratios if math.isfinite(each)]
        return float(np.median(known)) if known else math.nan

    def to_json(self) -> dict[str, Any]:
        """Return the figures as JSON values; None where nothing was measured."""
        figures = {
            "ground_error": self.ground_error(50),
            "ground_error_90": self.ground_error(90),
            "size_to_height": self.ratio("by_size", "by_height"),
            "size_to_depth": self.ratio("by_size", "by_depth"),
            "height_to_depth": self.ratio("by_height", "by_depth"),
        }
        known = {
            name: round(each, 4) if math.isfinite(each) else None for name, each in figures.items()
        }
        refusals = dict(self.refusals.most_common())
        return {"frames": self.frames, "refusals": refusals, "marks": len(self.marks), **known}

    def lines(self) -> Iterator[str]:
        """Yield the lines that describe the figures."""
        yield f"geometry in {self.frames} frames of flights"
        if self.ground_errors:
            middle, most = self.ground_error(50), self.ground_error(90)
            yield (
                "  ground nearer than 4 m: depth network and ground plane differ by "
                f"{_percent(middle)} (median), {_percent(most)} (90th percentile)"
            )
        if self.refusals:
            share = _percent(self.refusals.total() / self.frames)
            reasons = ", ".join(f"{why}: {count}" for why, count in self.refusals.most_common())
            yield f"  without metric depth: {share} of the frames ({reasons})"
        if not self.marks:
            yield "  mark: in no frame found whole and large enough, as a class of the role mark"
            return
        yield (
            f"  mark in {len(self.marks)} frames: the range by its size is "
            f"{_difference(self.ratio('by_size', 'by_height'))} that by height and pitch, and "
            f"{_difference(self.ratio('by_size', 'by_depth'))} that by the depth network"
        )

    def likely_wrong(self, lab_file: Path) -> str:
        """Return the likely cause of a systematic difference; empty without one.

        Args:
            lab_file: Named in the text.
        """
        if len(self.marks) < _LEAST_MARKS:
            return ""
        to_height, to_depth = self.ratio("by_size", "by_height"), self.ratio("by_size", "by_depth")
        height_to_depth = self.ratio("by_height", "by_depth")
        if abs(to_height - 1.0) <= self.tolerance:
            if math.isnan(height_to_depth) or abs(height_to_depth - 1.0) <= self.tolerance:
                return ""
            return (
                "likely wrong: the depth network, which does not know this place; size and height "
                "of the mark agree (`uav-bt net train depth` trains it from records)"
            )
        large, small = ("large", "small") if to_height > 1.0 else ("small", "large")
        others = f", the height of the drone (too {small}), or focal length or pitch of the camera"
        if not self.ground_error(50) < _GROUND_ERROR or math.isnan(to_depth):
            keys = "size or height_m"
        elif abs(math.log(to_depth)) < abs(math.log(height_to_depth)):
            # With a wrong height of the mark, its size and the depth network still agree.
            keys, others = "height_m", ""
        else:
            keys = "size"
        return f"likely wrong: {keys} of the mark in {lab_file} (too {large}){others}"


def _percent(share: float) -> str:
    return f"{100 * share:.1f} %"


def _difference(ratio: float) -> str:
    """Return a ratio of lengths in words, before 'that by ...'."""
    if math.isnan(ratio):
        return "not comparable with"
    return f"{_percent(abs(ratio - 1.0))} {'above' if ratio > 1.0 else 'below'}"
