"""The control student's shape, and what its numbers mean. It imports without torch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from typing import Any, Final, Literal

from uav_bt.errors import UnknownNameError, ValueRangeError

__all__ = ["LEARNS", "OUTPUTS", "VERSION", "ControlNetConfig", "Learns"]

VERSION: Final = 1  # of inputs and outputs; weights of another one are refused

Learns = Literal["choice", "movement"]
LEARNS: Final[tuple[Learns, ...]] = ("choice", "movement")

OUTPUTS: Final[Mapping[str, tuple[str, ...]]] = {
    # Logits of: advance (not turn), clockwise (if it turns), the carpet ends; and metres.
    "choice": ("advance", "clockwise", "step_m", "carpet_ends", "free_m"),
    # The paper's: the movement itself, and beside it what the rule tells.
    "movement": ("forward_m", "yaw_rad", "unused", "carpet_ends", "free_m"),
}
"""What the network's five outputs are, by what it learns."""


@dataclass(frozen=True, kw_only=True)
class ControlNetConfig:
    """The network's shape."""

    width_px: int = 160  # a box's base at 3 m is still seen to 5 cm
    height_px: int = 80
    channels: tuple[int, ...] = (24, 48, 96, 160)  # by level: the segmentation U-Net's encoder
    narrow: int = 24  # channels that each place of the last level hands to the dense layers
    embedding: int = 192  # numbers a view comes down to
    hidden: int = 128  # of the layers that join the views
    views: int = 3  # the present one and earlier ones
    spacing_s: float = 0.5  # between them: the paper has three within a second
    learns: Learns = "choice"  # or "movement", the paper's

    def __post_init__(self) -> None:
        shrinks = 2 ** len(self.channels)
        if len(self.channels) < 2 or self.width_px % shrinks or self.height_px % shrinks:
            raise ValueRangeError(
                f"{len(self.channels)} levels need sides divisible by {shrinks}, "
                f"got {self.width_px}x{self.height_px}"
            )
        if self.views < 1 or not self.spacing_s > 0.0:
            raise ValueRangeError(
                f"views and their spacing must be positive, got {self.views}, {self.spacing_s} s"
            )
        if self.learns not in LEARNS:
            raise UnknownNameError("way to learn", self.learns, LEARNS)

    @property
    def places(self) -> tuple[int, int]:
        """Height and width of the encoder's last level."""
        shrinks = 2 ** len(self.channels)
        return self.height_px // shrinks, self.width_px // shrinks

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
