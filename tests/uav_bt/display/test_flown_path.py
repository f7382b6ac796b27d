"""The flown path, with a referee and without."""

import math

import pytest

from tests.uav_bt.display.display_world import World
from uav_bt.display.flown_path import FlownPath
from uav_bt.types import Pose


def test_with_a_referee_the_path_is_the_true_one() -> None:
    world, flown = World(), FlownPath()
    for x in (0.0, 0.3, 0.6):
        flown.add(world.tick(pose=Pose(x_m=x, y_m=1.0, z_m=1.5, yaw_rad=0.2), forward_mps=9.0))
    assert [(point.x_m, point.y_m) for point in flown.points] == [(0, 1), (0.3, 1), (0.6, 1)]
    assert flown.distance_m == pytest.approx(0.6)
    assert flown.pose == Pose(x_m=0.6, y_m=1.0, z_m=1.5, yaw_rad=0.2)


def test_without_one_the_telemetry_is_added_up_from_where_it_looked_first() -> None:
    world, flown = World(), FlownPath()
    flown.add(world.tick(yaw_rad=1.0, forward_mps=2.0))
    flown.add(world.tick(yaw_rad=1.0, forward_mps=2.0))
    # Between two ticks it flies at their mean speed on their mean heading. The drone's yaw is
    # clockwise: an eighth to the right is an eighth towards the world's -y.
    pose = flown.add(world.tick(yaw_rad=1.0 + math.pi / 2, forward_mps=0.0))
    eighth_m = 0.1 * math.sqrt(0.5)
    assert (pose.x_m, pose.y_m) == (pytest.approx(0.2 + eighth_m), pytest.approx(-eighth_m))
    assert pose.yaw_rad == pytest.approx(-math.pi / 2)
    assert flown.distance_m == pytest.approx(0.3)
