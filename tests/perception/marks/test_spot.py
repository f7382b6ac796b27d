"""The take-off spot: found on textured ground, and only there."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from perception.marks.spot import SpotFinder
from tests.perception.marks.ground_views import AT_THE_SPOT, SIDE_PX, texture, view
from uav_bt.errors import InputError
from uav_bt.landing_marks import MarkSighting
from uav_bt.types import LandingMark, Pose2D
from uav_bt.types.arrays import Image

MARK = LandingMark(kind="spot", length_m=0.5, width_m=0.5, height_m=0.0)


def after_take_off(ground: Image) -> SpotFinder:
    """Return a finder that has seen the spot from above and flown away."""
    finder = SpotFinder(MARK)
    for index in range(5):
        place = Pose2D(x_m=0.02 * index - 0.04, y_m=0.01 * index, yaw_rad=0.0)
        assert finder.find(view(ground, place, at_s=0.1 * index)) is None
    assert finder.find(view(ground, Pose2D(x_m=2.0, y_m=0.0, yaw_rad=0.0), at_s=5.0)) is None
    return finder


def back(
    finder: SpotFinder, ground: Image, body: Pose2D, off: tuple[float, float, float]
) -> MarkSighting | None:
    """Return the sighting of the second of two views from a pose."""
    assert finder.find(view(ground, body, off=off, at_s=10.0)) is None  # one view is not enough
    return finder.find(view(ground, body, off=off, at_s=10.1))


@pytest.mark.parametrize("yaw_deg", [0.0, 80.0, -170.0])
@pytest.mark.parametrize("off", [(0.0, 0.0, 0.0), (0.3, -0.2, 2.0), (-0.4, 0.1, -3.0)])
def test_on_textured_ground_the_spot_is_found(
    yaw_deg: float, off: tuple[float, float, float]
) -> None:
    ground, body = texture(), Pose2D(x_m=0.1, y_m=-0.15, yaw_rad=math.radians(yaw_deg))
    found = back(after_take_off(ground), ground, body, off)

    assert found is not None
    true = body.pose_to_body(AT_THE_SPOT)
    assert math.hypot(found.forward_m - true.x_m, found.right_m - true.y_m) < 0.03
    assert found.height_m == 0.0


def test_ground_without_texture_shows_no_spot() -> None:
    plain = np.full((SIDE_PX, SIDE_PX), 120, dtype=np.uint8)

    assert back(after_take_off(plain), plain, AT_THE_SPOT, (0.1, 0.0, 0.0)) is None


def test_other_ground_shows_no_spot() -> None:
    ground = texture()
    elsewhere = np.ascontiguousarray(ground.T[::-1])

    assert back(after_take_off(ground), elsewhere, AT_THE_SPOT, (0.0, 0.0, 0.0)) is None


@pytest.mark.parametrize("off_m", [0.05, 0.1, 0.2, 0.25, 0.3, 0.4, 0.45])
def test_on_repeated_tiles_only_the_right_one_is_believed(off_m: float) -> None:
    """Tiles of half a metre: the estimate must leave no doubt which of them is meant."""
    tiles = np.tile(texture(50), (16, 16))
    found = back(after_take_off(tiles), tiles, AT_THE_SPOT, (off_m, 0.0, 0.0))

    if off_m <= 0.1:
        assert found is not None
        assert math.hypot(found.forward_m, found.right_m) < 0.03
    elif off_m < 0.4:
        assert found is None
    elif found is not None:  # the next tile looks like the right one: off by a tile at most
        assert math.hypot(found.forward_m, found.right_m) < 0.55


def test_a_spot_that_was_not_seen_from_above_is_not_found() -> None:
    ground, finder = texture(), SpotFinder(MARK)
    finder.find(view(ground, Pose2D(x_m=2.0, y_m=0.0, yaw_rad=0.0), at_s=5.0))

    assert back(finder, ground, AT_THE_SPOT, (0.0, 0.0, 0.0)) is None


def test_an_oblique_view_shows_no_spot() -> None:
    """It was not compared with the picture, and it is not collected."""
    ground, finder = texture(), SpotFinder(MARK)
    for index in range(5):
        seen = view(ground, AT_THE_SPOT, at_s=0.1 * index)
        oblique = replace(seen.frame, gimbal_pitch_rad=math.radians(-42.0))
        assert finder.find(replace(seen, frame=oblique)) is None
    finder.find(view(ground, Pose2D(x_m=2.0, y_m=0.0, yaw_rad=0.0), at_s=5.0))

    assert back(finder, ground, AT_THE_SPOT, (0.0, 0.0, 0.0)) is None


def test_an_option_is_refused() -> None:
    with pytest.raises(InputError, match="landing mark 'spot' has no option 'size_m'"):
        SpotFinder(replace(MARK, options={"size_m": 1.0}))
