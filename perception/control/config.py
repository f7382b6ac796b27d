"""The control student's shape, and the meaning of its outputs. It imports without torch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any, Final

from uav_bt.errors import ValueRangeError

VERSION: Final = 2  # of layers' names, inputs and outputs; files of another one are refused

OUTPUTS: Final = ("advance", "clockwise", "step_m", "carpet_ends", "free_m")
"""Logits of: advance (not turn), clockwise (if it turns), the carpet ends; and metres."""


@dataclass(frozen=True, kw_only=True)
class ControlNetConfig:
    """The network's shape."""

    width_px: int = 160  # a box's base at 3 m is still seen to 5 cm
    height_px: int = 80
    channels: tuple[int, ...] = (24, 48, 96, 160)  # by level: the segmentation U-Net's encoder
    bottleneck: int = 24  # channels that each place of the last level hands to the dense layers
    embedding: int = 192  # values that a view is reduced to
    hidden: int = 128  # of the layers that join the views
    views: int = 3  # the present one and earlier ones
    spacing_s: float = 0.5  # between them: the paper has three within a second

    def __post_init__(self) -> None:
        divisor = 2 ** len(self.channels)
        if len(self.channels) < 2 or self.width_px % divisor or self.height_px % divisor:
            raise ValueRangeError(
                f"{len(self.channels)} levels need sides divisible by {divisor}, "
                f"got {self.width_px}x{self.height_px}"
            )
        if self.views < 1 or not self.spacing_s > 0.0:
            raise ValueRangeError(
                f"views and their spacing must be positive, got {self.views}, {self.spacing_s} s"
            )

    @property
    def ages_s(self) -> tuple[float, ...]:
        """How long before the present each view was, the present one first."""
        return tuple(self.spacing_s * number for number in range(self.views))

    def to_json(self) -> dict[str, Any]:
        """Return the shape as plain JSON values."""
        return asdict(self)

    @classmethod
    def from_json(cls, values: Mapping[str, Any]) -> ControlNetConfig:
        """Return the shape that `to_json` wrote.

        Raises:
            KeyError: a part of it is missing.
        """
        known = {item.name: values[item.name] for item in fields(cls)}
        return cls(**{**known, "channels": tuple(known["channels"])})
