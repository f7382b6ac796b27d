"""How a flight is recorded."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from uav_bt.errors import ValueRangeError

Quality = Literal["lossless", "high", "small"]


@dataclass(frozen=True, kw_only=True)
class RecordConfig:
    """What is kept, and what happens when the disk does not keep up."""

    # Of camera images; only lossless ones replay exactly. A small record has images of 320
    # pixels' width and no maps: for networks that look at less than that.
    quality: Quality = "lossless"
    # So far the file may lag behind the flight before images are left out: with `flush_s` it is
    # what a killed flight loses, less than a second.
    lag_s: float = 0.5
    # Ticks with images that may wait, whatever their age: 64 noisy frames of 640x360 are 45 MB.
    queued_images: int = 64
    queued_ticks: int = 1_024  # that may wait without images, some kilobytes each
    # After so much mission time, or so long without work, everything is handed to the system; long
    # enough for chunks of some ticks.
    flush_s: float = 0.3
    # A simulated flight waits for the disk, its clock stands still meanwhile; a real one leaves
    # images out.
    wait: bool = False

    def __post_init__(self) -> None:
        if not 1 <= self.queued_images <= self.queued_ticks:
            raise ValueRangeError(
                "a record's queue needs 1 <= queued_images <= queued_ticks, got "
                f"{self.queued_images} and {self.queued_ticks}"
            )
        if not (0.0 <= self.flush_s <= 1.0 and self.lag_s > 0.0):
            raise ValueRangeError(
                "a record must be flushed at least every second and may lag a little, got "
                f"{self.flush_s} and {self.lag_s} s"
            )
