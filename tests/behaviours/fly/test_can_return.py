"""CanReturn: the charge against the need of the way home."""

from dataclasses import replace

from behaviours.fly.look import CanReturn
from uav_bt.board import SITE_MAP
from uav_bt.board.keys import BATTERY_PER_MIN, BATTERY_SHARE, FLYING, HOME, UNKNOWN
from uav_bt.testing import LeafBench
from uav_bt.testing.world import drawn_map
from uav_bt.tree import Status


def bench_with(charge: float, per_min: float = 0.06, home_m: float = 4.0) -> LeafBench:
    bench = LeafBench(CanReturn, reserve=0.15)
    bench.board[FLYING] = 1.0
    bench.board[BATTERY_SHARE], bench.board[BATTERY_PER_MIN] = charge, per_min
    bench.board[HOME] = home_m
    return bench


def test_the_way_home_must_leave_the_reserve() -> None:
    for charge, per_min, home_m, status in (
        (0.20, 0.06, 4.0, Status.SUCCESS),  # 6 m at 0.4 m/s and 30 s: 45 s take 4.5 %
        (0.19, 0.06, 4.0, Status.FAILURE),
        (0.19, 0.04, 4.0, Status.SUCCESS),  # 3 %
        (0.20, 0.06, 8.0, Status.FAILURE),  # 60 s: 6 %
        (0.20, UNKNOWN, 4.0, Status.SUCCESS),  # 5 % a minute: 3.8 %
        (0.18, UNKNOWN, 4.0, Status.FAILURE),
        (UNKNOWN, 0.06, 4.0, Status.FAILURE),
    ):
        bench = bench_with(charge, per_min, home_m)
        assert bench.tick() is status
        assert (bench.feedback == "the battery is unknown") == (charge == UNKNOWN)


def test_in_a_gap_of_the_odometry_the_last_distance_counts() -> None:
    bench = bench_with(0.5, home_m=UNKNOWN)
    assert bench.tick() is Status.FAILURE, "the distance was never known"
    bench.board[HOME] = 4.0
    assert bench.tick() is Status.SUCCESS
    bench.board[HOME] = UNKNOWN
    assert bench.tick() is Status.SUCCESS
    bench.board[BATTERY_SHARE] = 0.19
    assert bench.tick() is Status.FAILURE
    bench.board[FLYING] = 0.0
    assert bench.tick() is Status.SUCCESS, "on the ground it is at home"


def test_a_route_of_the_map_replaces_the_estimated_detour() -> None:
    """In an empty hall the way is straight: 4 m and the last metre, not 6 m."""
    site_map = drawn_map(ground_m=10.0, pose=(4.0, 0.0, 0.0))
    bench = bench_with(0.194)  # 5 m: 4.25 %, and 6 m would take 4.5 %
    assert bench.tick() is Status.FAILURE
    bench.clock.advance(3.0)
    bench.board[SITE_MAP] = replace(site_map, captured_s=bench.clock.now())
    assert bench.tick() is Status.SUCCESS
