"""The amount of data that is recorded."""

from __future__ import annotations

from typing import Literal

Quality = Literal["lossless", "high", "small"]
"""Of camera images; only lossless ones replay exactly. A small record has images 320 pixels wide
and no maps, for networks with a smaller input."""
