"""Sizes that several rooms need: the airframe's, the landing mark's."""

from __future__ import annotations

from typing import Final

BODY_SIZE_M: Final = (0.24, 0.32, 0.10)
"""The ANAFI's body: forward, sideways, up."""

PAD_SIZE_M: Final = (0.5, 0.5, 0.4)
"""The landing box, whose top carries the H: along its own x and y, and upwards."""

PAD_HEIGHT_M: Final = PAD_SIZE_M[2]
