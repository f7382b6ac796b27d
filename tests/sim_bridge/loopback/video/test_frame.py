"""The frame that a source gives."""

from __future__ import annotations

import numpy as np
import pytest

from sim_bridge.loopback.video.frame import VideoFrame
from uav_bt.errors import ShapeError, ValueRangeError


@pytest.mark.parametrize("shape", [(4, 4), (4, 4, 4), (0, 4, 3)])
def test_an_image_has_rows_columns_and_three_colours(shape: tuple[int, ...]) -> None:
    with pytest.raises(ShapeError, match="video image must be HxWx3"):
        VideoFrame(image=np.zeros(shape, np.uint8), captured_s=0.0)


def test_an_image_holds_bytes() -> None:
    with pytest.raises(ValueRangeError, match="uint8, got float32"):
        VideoFrame(image=np.zeros((4, 4, 3), np.float32), captured_s=0.0)  # type: ignore[arg-type]


@pytest.mark.parametrize("battery", [-0.1, 87.0])
def test_the_battery_is_a_share(battery: float) -> None:
    with pytest.raises(ValueRangeError, match="within 0 and 1"):
        VideoFrame(image=np.zeros((4, 4, 3), np.uint8), captured_s=0.0, battery=battery)
