"""Input format of a foreign network's image, as in mapping files."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from uav_bt.errors import ValueRangeError

_Triple = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class InputFormat:
    """Format of the image that a network takes."""

    mean: _Triple = (0.0, 0.0, 0.0)  # subtracted from the 0..255 colours, red green blue
    # Divides the difference. None: 255 for an input of floats, 1 for one of whole numbers.
    scale: _Triple | None = None
    colours: Literal["rgb", "bgr"] = "rgb"
    layout: Literal["nchw", "nhwc"] = "nchw"
    size: tuple[int, int] | None = None  # width and height in px, if the ONNX file leaves them open

    def __post_init__(self) -> None:
        if len(self.mean) != 3 or (
            self.scale is not None and (len(self.scale) != 3 or 0.0 in self.scale)
        ):
            raise ValueRangeError(
                f"mean and scale need three numbers, scale none of them zero, got {self.mean}, "
                f"{self.scale}"
            )
        if self.colours not in ("rgb", "bgr") or self.layout not in ("nchw", "nhwc"):
            raise ValueRangeError(
                "colours must be rgb or bgr and layout nchw or nhwc, "
                f"got {self.colours}, {self.layout}"
            )
        if self.size is not None and (len(self.size) != 2 or min(self.size) < 1):
            raise ValueRangeError(f"size must be a width and a height in px, got {self.size}")
