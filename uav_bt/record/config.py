"""Configuration of a record."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from uav_bt.errors import ValueRangeError

Quality = Literal["lossless", "high", "small"]


@dataclass(frozen=True, kw_only=True)
class RecordConfig:
    """The amount of data that is recorded, and the limits for a slow disk."""

    # Quality of camera images; only lossless ones replay exactly. A small record has images 320
    # pixels wide and no maps, for networks with a smaller input.
    quality: Quality = "lossless"
    # Largest lag of the file behind the flight; beyond it images are omitted. A killed flight
    # loses at most `lag_s` and `flush_s`, less than a second.
    lag_s: float = 0.5
    # Most ticks with images in the queue: 64 noisy frames of 640x360 are 45 MB.
    queued_images: int = 64
    queued_ticks: int = 1_024  # most ticks in the queue; without images some kilobytes each
    # Mission time, or idle time of the thread, after which all data goes to the system; long
    # enough for chunks of several ticks.
    flush_s: float = 0.3
    # Whether the flight waits for the disk. A simulated one can, because its clock stands still;
    # a real one omits images.
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
