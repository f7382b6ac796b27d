"""Where the camera looks: at the ground, the mark and movers."""

import math

import pytest

from behaviours.path.gimbal_pointing import (
    ground_pitch_rad,
    ground_share,
    mark_pitch_rad,
    mover_pitch_rad,
)
from tests.behaviours.path.test_movers import mover, with_movers
from tests.behaviours.policies.cast_world import CAMERA
from uav_bt.testing.world import drawn_map

FLIGHT_RAD = math.radians(-30)
LOWEST_RAD = math.radians(-50)


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


def test_at_the_edge_the_camera_looks_down_to_the_ground_before_it() -> None:
    for x_m, y_m, yaw_deg, flight_deg, pitch_deg in (
        (-1.5, 0.0, 0, -30, -30),
        (0.0, 1.4, 60, -30, -56),  # 0.6 m from the edge the view in flight begins beyond it
        (0.0, 1.4, 90, -30, -56),
        (0.0, 1.4, 120, -30, -56),
        (0.0, 1.8, 90, -70, -70),  # it looks down further in flight
        (0.0, 4.0, -90, -30, -30),  # the ground lies further away than a lowered camera shows,
    ):
        site_map = drawn_map(pose=(x_m, y_m, math.radians(yaw_deg)))
        flight_rad, expected_rad = math.radians(flight_deg), math.radians(pitch_deg)
        pitch_rad = ground_pitch_rad(site_map, CAMERA, flight_rad, 1.5)
        assert pitch_rad == pytest.approx(expected_rad)
        before, after = (
            ground_share(site_map, CAMERA, rad, 1.5) for rad in (flight_rad, pitch_rad)
        )
        assert after > before or pitch_rad == flight_rad


@pytest.mark.parametrize("height_m", [0.8, 1.5])
def test_in_the_open_it_looks_ahead_at_any_height(height_m: float) -> None:
    inside = drawn_map(pose=(-1.8, 0.0, 0.0))
    assert ground_pitch_rad(inside, CAMERA, FLIGHT_RAD, height_m) == FLIGHT_RAD
