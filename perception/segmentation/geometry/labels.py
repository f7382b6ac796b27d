"""Labels of one frame: ground, not ground or unknown, each with a confidence."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import ShapeError

UNKNOWN: Final = 0
GROUND: Final = 1
NOT_GROUND: Final = 2


@dataclass(frozen=True, kw_only=True, eq=False)
class GroundLabels:
    """Labels of the pixels of one frame.

    Attributes:
        frame: Index of the frame in its footage.
        labels: (H, W) uint8 of `UNKNOWN`, `GROUND` and `NOT_GROUND`.
        confidence: (H, W) float32, 0 to 1; 0 where unknown, 1 above the horizon.
    """

    frame: int
    labels: NDArray[np.uint8]
    confidence: NDArray[np.float32]

    def __post_init__(self) -> None:
        if self.labels.ndim != 2 or self.labels.shape != self.confidence.shape:
            raise ShapeError(
                "confidence of ground labels",
                expected=f"{'x'.join(map(str, self.labels.shape))}, as the labels",
                actual=self.confidence.shape,
            )

    @property
    def known_share(self) -> float:
        """Share of the pixels with a label."""
        return float(np.mean(self.labels != UNKNOWN))
