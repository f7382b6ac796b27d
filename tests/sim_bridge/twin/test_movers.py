"""Movers: positions over time, and contacts with a drone."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from sim_bridge.twin.movers import MoverSpec, Traffic
from sim_bridge.twin.objects import Helipad
from sim_bridge.twin.scene import Scene, TakeOffSpec
from tests.paper_lab import BOXES
from tests.sim_bridge.twin.lab_world import MakeTwin, fly, truth
from uav_bt.types import MoverState, Velocity

WALK = MoverSpec(path_m=((0.0, -1.0), (0.0, 1.0)), speed_mps=0.5)
ROUND = MoverSpec(path_m=((0.0, 0.0), (2.0, 0.0), (2.0, 1.0)), speed_mps=1.0, loop=True)
ROOT = math.sqrt(5.0)


def at(spec: MoverSpec, time_s: float, seed: int = 0) -> MoverState:
    (state,) = Traffic([spec], seed).at(time_s)
    return state


@pytest.mark.parametrize(
    ("spec", "time_s", "place_m", "velocity_mps"),
    [
        (WALK, 0.0, (0.0, -1.0), (0.0, 0.5)),
        (WALK, 3.0, (0.0, 0.5), (0.0, 0.5)),
        (WALK, 5.0, (0.0, 0.5), (0.0, -0.5)),
        (WALK, 9.0, (0.0, -0.5), (0.0, 0.5)),
        (ROUND, 2.5, (2.0, 0.5), (0.0, 1.0)),
        (ROUND, 3.0 + ROOT / 2, (1.0, 0.5), (-2.0 / ROOT, -1.0 / ROOT)),
        (ROUND, 3.5 + ROOT, (0.5, 0.0), (1.0, 0.0)),
    ],
)
def test_paths_are_followed_at_a_constant_speed(
    spec: MoverSpec,
    time_s: float,
    place_m: tuple[float, float],
    velocity_mps: tuple[float, float],
) -> None:
    state = at(spec, time_s)
    assert (state.pose.x_m, state.pose.y_m) == pytest.approx(place_m)
    assert (state.vx_mps, state.vy_mps) == pytest.approx(velocity_mps)
    assert (state.name, state.pose.z_m) == ("mover-1", 0.85)


def test_pauses_come_from_the_seed_and_last_as_long_as_the_file_says() -> None:
    spec = replace(WALK, pauses_s=(2.0, 3.0))
    traffic, times = Traffic([spec], 7), np.arange(0.0, 40.0, 0.01)
    states = [traffic.at(float(time_s))[0] for time_s in times]
    rests = np.array([state.vy_mps == 0.0 for state in states])
    starts = np.flatnonzero(np.diff(rests.astype(int)) == 1)
    ends = np.flatnonzero(np.diff(rests.astype(int)) == -1)
    assert rests[0], "it stands before the first way, too"
    lengths = (ends[1:] - starts[: len(ends) - 1]) * 0.01
    assert len(lengths) >= 4
    assert (lengths.min() >= 1.98, lengths.max() <= 3.02) == (True, True)
    assert len(set(np.round(lengths, 2))) > 1
    assert (at(spec, 3.1, 7), at(spec, 12.0, 7)) == (states[310], states[1200])
    assert at(spec, 12.0, 8) != states[1200]


def meeting(*path_m: tuple[float, float], **options: Any) -> Scene:
    """Return a scene in which a drone meets a mover on a path."""
    mover = MoverSpec(**{"path_m": path_m, "speed_mps": 0.5, "pattern": 3} | options)
    pad, start = Helipad(position_m=(-1.5, -1.5)), TakeOffSpec(position_m=(-1.0, 0.0))
    return Scene(name="meeting", helipad=pad, movers=(mover,), take_off=start)


def test_truth_and_images_show_movers_where_they_are_and_were(make_twin: MakeTwin) -> None:
    """The frame is delivered late, and its masks and depth are requested even later."""
    drone = make_twin(scene=meeting((1.0, 0.0), (2.0, 0.0)), image_size_px=(320, 180))
    drone.clock.sleep_until(1.0)
    (mover,) = truth(drone).movers
    assert (mover.pose.x_m, mover.pose.y_m) == pytest.approx((1.5, 0.0))
    assert (mover.vx_mps, mover.vy_mps) == pytest.approx((0.5, 0.0))
    gap_m = 2.5 - 0.2 - 0.12  # from the mover's side to the front of the hull
    assert truth(drone).clearance_m == pytest.approx(gap_m, abs=0.007)
    frame = drone.observe().frame
    drone.clock.sleep_until(3.0)
    depth = drone.referee.depth(frame, 320, 180)
    gone_m, lens_x_m = 0.5 * frame.captured_s, -1.0 + 0.15
    assert drone.referee.class_ids(frame, 320, 180)[90, 160] == BOXES[2]
    assert depth[90, 160] == pytest.approx(1.0 + gone_m - 0.2 - lens_x_m, abs=0.003)


def test_the_height_above_what_lies_below_counts_a_cart(make_twin: MakeTwin) -> None:
    cart = meeting((0.8, 0.0), (1.0, 0.0), shape="box", size_m=(0.6, 0.6, 0.5))
    drone = make_twin(scene=cart, airborne=True)
    fly(drone, Velocity(forward_mps=0.4), 5.0)
    state, end = drone.observe().state, truth(drone)
    (mover,) = end.movers
    assert abs(end.pose.x_m - mover.pose.x_m) < 0.3, "the drone is above the cart"
    assert state.height_above_ground_m - state.height_m == pytest.approx(0.5, abs=0.05)
