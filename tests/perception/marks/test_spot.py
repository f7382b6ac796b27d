"""The take-off spot: found on textured ground, and only there."""

import math
from dataclasses import replace

import numpy as np
import pytest

from perception.marks.spot import SpotFinder
from tests.perception.marks.ground_views import AT_THE_SPOT, SIDE_PX, texture, view
from uav_bt.landing_marks import MarkSighting
from uav_bt.types import LandingMark, Pose2D
from uav_bt.types.arrays import Image

MARK = LandingMark(kind="spot", length_m=0.5, width_m=0.5, height_m=0.0)
AWAY = Pose2D(x_m=2.0, y_m=0.0, yaw_rad=0.0)
GROUND, PLAIN = texture(), np.full((SIDE_PX, SIDE_PX), 120, dtype=np.uint8)
Error = tuple[float, float, float]  # m, m, degrees


def back(
    ground: Image, body: Pose2D, off: Error, *, left: Image | None = None, pitch_deg: float = -90.0
) -> MarkSighting | None:
    """Return the sighting of a finder after five views at the take-off, and two at the return."""
    finder = SpotFinder(MARK)
    for index in range(5):
        place = Pose2D(x_m=0.02 * index - 0.04, y_m=0.01 * index, yaw_rad=0.0)
        seen = view(ground if left is None else left, place, at_s=0.1 * index)
        tilted = replace(seen.frame, gimbal_pitch_rad=math.radians(pitch_deg))
        assert finder.find(replace(seen, frame=tilted)) is None
    assert finder.find(view(ground, AWAY, at_s=5.0)) is None
    assert finder.find(view(ground, body, off=off, at_s=10.0)) is None  # one view is not enough
    return finder.find(view(ground, body, off=off, at_s=10.1))


@pytest.mark.parametrize("yaw_deg", [0.0, 80.0, -170.0])
@pytest.mark.parametrize("off", [(0.0, 0.0, 0.0), (0.3, -0.2, 2.0), (-0.4, 0.1, -3.0)])
def test_on_textured_ground_the_spot_is_found(yaw_deg: float, off: Error) -> None:
    body = Pose2D(x_m=0.1, y_m=-0.15, yaw_rad=math.radians(yaw_deg))
    found = back(GROUND, body, off)
    assert found is not None
    true = body.pose_to_body(AT_THE_SPOT)
    assert math.hypot(found.forward_m - true.x_m, found.right_m - true.y_m) < 0.03
    assert found.height_m == 0.0


def test_plain_or_other_ground_and_a_spot_not_seen_from_above_are_not_found() -> None:
    assert back(PLAIN, AT_THE_SPOT, (0.1, 0.0, 0.0)) is None
    other = np.ascontiguousarray(GROUND.T[::-1])
    assert back(other, AT_THE_SPOT, (0.0, 0.0, 0.0), left=GROUND) is None
    assert back(GROUND, AT_THE_SPOT, (0.0, 0.0, 0.0), pitch_deg=-42.0) is None


@pytest.mark.parametrize("off_m", [0.05, 0.1, 0.2, 0.25, 0.3, 0.4, 0.45])
def test_on_repeated_tiles_only_the_right_one_is_believed(off_m: float) -> None:
    """Tiles of half a metre: the estimate must leave no doubt which of them is meant."""
    found = back(np.tile(texture(50), (16, 16)), AT_THE_SPOT, (off_m, 0.0, 0.0))
    if off_m <= 0.1:
        assert found is not None
        assert math.hypot(found.forward_m, found.right_m) < 0.03
    elif off_m < 0.4:
        assert found is None
    elif found is not None:  # the next tile looks like the right one: off by a tile at most
        assert math.hypot(found.forward_m, found.right_m) < 0.55
