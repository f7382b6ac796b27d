"""Where the camera looks on the way to the mark."""

from __future__ import annotations

import math

import numpy as np
import pytest

from behaviours.path.gimbal_pointing import (
    LookingDown,
    ground_pitch_rad,
    ground_share,
    mark_pitch_rad,
    mover_pitch_rad,
)
from tests.behaviours.path.test_movers import mover, with_movers
from tests.behaviours.policies.cast_world import CAMERA
from uav_bt.testing.world import drawn_map
from uav_bt.types import NearObstacles

FLIGHT_RAD = math.radians(-30)
LOWEST_RAD = math.radians(-50)


def known(**bearings_deg: list[float]) -> NearObstacles:
    return NearObstacles(
        points_m=np.empty((0, 2)),
        captured_s=0.0,
        **{f"{name}_rad": np.radians(degrees) for name, degrees in bearings_deg.items()},
    )


@pytest.mark.parametrize(
    ("range_m", "expected_rad"),
    [(3.0, FLIGHT_RAD), (1.5, -math.atan2(1.1, 1.5)), (0.2, LOWEST_RAD)],
)
def test_the_camera_follows_the_mark_down(range_m: float, expected_rad: float) -> None:
    assert mark_pitch_rad(range_m, 1.1, FLIGHT_RAD) == pytest.approx(expected_rad)


@pytest.mark.parametrize(("range_m", "base_deg"), [(2.0, 40.6), (1.25, 56.3), (0.6, 76.9)])
def test_the_base_of_the_nearest_mover_stays_in_view(range_m: float, base_deg: float) -> None:
    near = with_movers(mover(0.0, range_m), mover(-3.0, 0.0))
    pitch_deg = math.degrees(mover_pitch_rad(near, FLIGHT_RAD, 1.5))
    assert -56.0 <= pitch_deg <= -30.0
    assert -base_deg > pitch_deg - 21.0  # half of the view is 20 degrees high


@pytest.mark.parametrize("what", ["unplaced", "unplaced_edges"])
def test_what_has_no_range_ahead_is_looked_at_from_above_for_a_while(what: str) -> None:
    looking = LookingDown()
    assert looking.pitch_rad(known(**{what: [-40.0, 44.0]}), 0.0) == LOWEST_RAD
    assert looking.pitch_rad(known(), 0.9) == LOWEST_RAD
    assert looking.pitch_rad(known(), 1.1) is None


@pytest.mark.parametrize("what", ["unplaced", "unplaced_edges"])
@pytest.mark.parametrize("degrees", [[10.0], [-60.0, 50.0, 70.0]])
def test_specks_and_what_is_beside_are_not(what: str, degrees: list[float]) -> None:
    assert LookingDown().pitch_rad(known(**{what: degrees}), 0.0) is None


def test_in_the_open_the_camera_looks_ahead() -> None:
    inside = drawn_map(pose=(-1.5, 0.0, 0.0))
    assert ground_pitch_rad(inside, CAMERA, FLIGHT_RAD, 1.5) == FLIGHT_RAD


@pytest.mark.parametrize("yaw_deg", [60, 90, 120])
def test_at_the_edge_it_looks_down_to_the_ground_before_it(yaw_deg: float) -> None:
    """0.6 m from the edge, where the view in flight begins more than a metre ahead."""
    edge = drawn_map(pose=(0.0, 1.4, math.radians(yaw_deg)))
    pitch_rad = ground_pitch_rad(edge, CAMERA, FLIGHT_RAD, 1.5)
    assert pitch_rad == pytest.approx(math.radians(-56))
    before = ground_share(edge, CAMERA, FLIGHT_RAD, 1.5)
    assert ground_share(edge, CAMERA, pitch_rad, 1.5) > before


def test_a_camera_that_looks_down_further_in_flight_stays() -> None:
    edge = drawn_map(pose=(0.0, 1.8, math.radians(90)))
    assert ground_pitch_rad(edge, CAMERA, math.radians(-70), 1.5) == math.radians(-70)


def test_beyond_the_edge_it_looks_ahead_to_the_ground() -> None:
    """It lies further away than the lowered camera shows."""
    beyond = drawn_map(pose=(0.0, 4.0, math.radians(-90)))
    assert ground_share(beyond, CAMERA, FLIGHT_RAD, 1.5) < 0.35
    assert ground_pitch_rad(beyond, CAMERA, FLIGHT_RAD, 1.5) == FLIGHT_RAD


@pytest.mark.parametrize("height_m", [0.8, 1.5])
def test_in_the_open_it_looks_ahead_at_any_height(height_m: float) -> None:
    inside = drawn_map(pose=(-1.8, 0.0, 0.0))
    assert ground_pitch_rad(inside, CAMERA, FLIGHT_RAD, height_m) == FLIGHT_RAD
