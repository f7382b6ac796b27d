"""What every source gives: pictures, one after another."""

from __future__ import annotations

from collections.abc import Generator, Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

__all__ = ["FOLDER_RATE", "Image", "Picture", "PictureSource", "Pictures"]

Image = NDArray[np.uint8]

FOLDER_RATE: Final = 10.0  # pictures a second where nothing tells: a mission's tick


@dataclass(frozen=True, kw_only=True, eq=False)
class Picture:
    """One picture of a source."""

    image: Image  # (H, W, 3) RGB
    index: int  # counts all pictures of the source, also those that are left out
    time_s: float  # since the source began
    name: str  # for messages


Pictures = Generator[Picture, None, None]
"""Pictures in order of time; closing lets go of the file or the camera."""


class PictureSource(Protocol):
    """Gives pictures of one size in order of time."""

    @property
    def name(self) -> str:
        """What it is, for messages."""
        ...

    @property
    def total(self) -> int | None:
        """How many pictures it has; None where nobody knows."""
        ...

    @property
    def rate_per_s(self) -> float:
        """How many pictures a second, about."""
        ...

    @property
    def skipped(self) -> Sequence[str]:
        """What could not be used so far, and why."""
        ...

    def pictures(self, every: int = 1) -> Pictures:
        """Iterate over every n-th picture; what cannot be read is left out and told."""
        ...
