"""Depth in heights against the plane of the ground: which wrong inputs show."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from perception.camera.ground_plane import CameraView, ground_depth
from perception.depth.confidence import Measure
from perception.depth.plane_check import agreement_with_plane
from tests.paper_lab import BACKGROUND, CARPET, paper_map
from tests.worlds import values
from uav_bt.testing import pinhole
from uav_bt.types import DepthMap

CAMERA = pinhole(640, 360)
SIZE = (224, 112)
HEIGHT_M = 1.5


def agreement(
    *,
    focal: float = 1.0,
    pitch_deg: float = -32.0,
    pitch_off_deg: float = 0.0,
    height_off_m: float = 0.0,
    in_heights: bool = True,
    shown: int = CARPET,
    wall: bool = False,
) -> Measure | None:
    """Return the agreement of exact depth in heights with telemetry and camera as given."""
    pitch_rad, said_rad = math.radians(pitch_deg), math.radians(pitch_deg + pitch_off_deg)
    view = CameraView(camera=CAMERA.resized(*SIZE), pitch_rad=pitch_rad, height_m=HEIGHT_M)
    depth = np.nan_to_num(ground_depth(view), nan=50.0) / np.float32(HEIGHT_M)
    if wall:
        depth = np.full_like(depth, 2.0)
    frame = values.frame((360, 640), said_rad, HEIGHT_M + height_off_m)
    ids = np.full(SIZE[::-1], shown, np.uint8)
    camera = replace(CAMERA, fx_px=focal * CAMERA.fx_px, fy_px=focal * CAMERA.fy_px)
    relative = DepthMap(depth=depth, metric=False, captured_s=0.0, in_heights=in_heights)
    return agreement_with_plane(
        relative, paper_map(ids=ids, captured_s=0.0), frame, camera, np.random.default_rng(1)
    )


@pytest.mark.parametrize(
    ("least", "most", "how"),
    [
        pytest.param(0.9, 1.0, {}, id="right inputs"),
        pytest.param(0.0, 0.3, {"focal": 0.5}, id="half the focal length"),
        pytest.param(0.0, 0.3, {"focal": 2.0}, id="twice the focal length"),
        pytest.param(0.0, 0.15, {"wall": True}, id="a wall that counts as ground"),
        pytest.param(0.0, 0.4, {"pitch_off_deg": 10.0}, id="pitch"),
        pytest.param(0.9, 1.0, {"height_off_m": 0.5}, id="a wrong height does not show"),
    ],
)
def test_what_is_wrong_shows(least: float, most: float, how: dict[str, Any]) -> None:
    found = agreement(**how)
    assert least < found[0] <= most
    assert found[1]


@pytest.mark.parametrize(
    "how",
    [
        pytest.param({"in_heights": False}, id="another unit"),
        pytest.param({"shown": BACKGROUND}, id="no ground"),
        pytest.param({"focal": 0.5, "pitch_deg": -65.0}, id="a steep view"),
        pytest.param({"focal": 0.5, "pitch_deg": -90.0}, id="straight down"),
    ],
)
def test_some_views_say_nothing(how: dict[str, Any]) -> None:
    assert agreement(**how) is None
