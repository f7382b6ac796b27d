"""What perception makes of one image."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import ShapeError
from uav_bt.types.shapes import check_shape


@dataclass(frozen=True, kw_only=True)
class ClassMap:
    """A class id for every pixel of a (resized) frame; the ids are `uav_bt.classes`."""

    ids: NDArray[np.uint8]  # (H, W)
    captured_s: float  # of the frame it was made from

    def __post_init__(self) -> None:
        check_shape("class map", self.ids, 2)


@dataclass(frozen=True, kw_only=True)
class DepthMap:
    """Depth along the optical axis for every pixel of a (resized) frame."""

    depth: NDArray[np.float32]  # (H, W); metres when metric, arbitrary unit when relative
    metric: bool
    captured_s: float
    confidence: float = 1.0  # 0 to 1
    # (H, W) metres: an upper bound, also where the depth itself is unknown (NaN); inf without one.
    at_most: NDArray[np.float32] | None = None

    def __post_init__(self) -> None:
        check_shape("depth map", self.depth, 2)
        if self.at_most is not None and self.at_most.shape != self.depth.shape:
            height, width = self.depth.shape
            raise ShapeError(
                "upper bound of a depth map",
                expected=f"{height}x{width}, as the depth",
                actual=self.at_most.shape,
            )


@dataclass(frozen=True, kw_only=True)
class Corridor:
    """What the five-plane safety corridor found in a depth map."""

    captured_s: float
    free_distance_m: float  # straight ahead, from the body's centre
    nearest_m: float  # nearest intrusion from the body's centre; inf when there is none
    nearest_side: Literal["left", "right", "front", "up", "down"] | None
    time_to_impact_s: float  # at the present speed; inf when nothing is ahead
    nearest_left_m: float = math.inf  # nearest intrusion left of the path; inf when there is none
    nearest_right_m: float = math.inf
    unknown_px: int = 0  # pixels of things that may be in the corridor, at a depth nobody knows
