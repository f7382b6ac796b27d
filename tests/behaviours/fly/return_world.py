"""A drone on its way back to the mark, as the tests of ReturnToBase fly it."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from tests.worlds.leaves import ADVANCE, RETURN_TO_BASE, map_with, steering_bench
from tests.worlds.values import fix
from uav_bt.answers import Answer
from uav_bt.board import FLIGHT_PITCH, MARK, PHASE, SITE_MAP
from uav_bt.testing import LeafBench
from uav_bt.testing.world import Says, drawn_map, show
from uav_bt.tree import Status
from uav_bt.types import GimbalTo, NearObstacles
from uav_bt.types.site_map import MapMark, SiteMap

SEARCH_GIMBAL = GimbalTo(pitch_rad=math.radians(-30))


def fly(
    bench: LeafBench,
    pad: tuple[float, float] | None = None,
    *,
    seconds: float = 0.1,
    unseen_s: float = 0.0,
    std_m: float = 0.0,
    height_m: float = 0.4,
    site_map: SiteMap | None = None,
    obstacles: Sequence[tuple[float, float]] = (),
    yaw_rad: float = 0.0,
) -> Status:
    """Tick with the pad ahead and right, seen some time ago; None: never seen."""
    show(bench, seconds=seconds, yaw_rad=yaw_rad)
    now_s = bench.clock.now()
    del bench.board[MARK]
    if pad is not None:
        seen = {"detected": unseen_s == 0.0, "std_m": std_m, "height_m": height_m}
        bench.board[MARK] = fix(now_s - unseen_s, *pad, **seen)
    points_m = np.array(obstacles, dtype=np.float64).reshape(-1, 2)
    near = NearObstacles(points_m=points_m, captured_s=now_s)
    if site_map is None and obstacles:
        site_map = map_with(near)
    del bench.board[SITE_MAP]
    if site_map is not None:
        bench.board[SITE_MAP] = replace(site_map, captured_s=now_s, near=near)
    return bench.tick()


def returning(answer: Answer | Says = ADVANCE, **attributes: object) -> LeafBench:
    policy = answer if isinstance(answer, Says) else Says(answer)
    bench = steering_bench(RETURN_TO_BASE, policy, gimbal_deg=-30.0, **attributes)
    bench.board[FLIGHT_PITCH] = math.radians(-30)
    return bench


def searching(answer: Answer | Says = ADVANCE) -> LeafBench:
    bench = returning(answer)
    assert fly(bench) is Status.RUNNING
    assert bench.proposed is None
    return bench


def approaching(
    pad: tuple[float, float] = (2.5, 0.0), answer: Answer | Says = ADVANCE, **seen: Any
) -> LeafBench:
    bench = searching(answer)
    assert fly(bench, pad, **seen) is Status.RUNNING
    assert bench.board[PHASE] == "approach"
    return bench


def marked(x_m: float, y_m: float, *, seen_s: float = 1.0, std_m: float = 0.03) -> SiteMap:
    """Return ground of 4 x 4 m with the landing mark on it; the drone is in the middle."""
    return replace(drawn_map(), mark=MapMark(x_m=x_m, y_m=y_m, std_m=std_m, seen_s=seen_s))


def boxed(*places_m: tuple[float, float], pad: tuple[float, float] = (2.5, 0.0)) -> SiteMap:
    """Return ground of 6 x 6 m with obstacles and the mark, relative to the drone, at one side."""
    return replace(
        drawn_map(ground_m=6.0, pose=(-1.5, 0.0, 0.0)),
        obstacles_m=np.array([(x_m - 1.5, y_m) for x_m, y_m in places_m]),
        mark=MapMark(x_m=pad[0] - 1.5, y_m=pad[1], std_m=0.03, seen_s=0.1),
    )


def unseen(site_map: SiteMap, hidden: Any) -> SiteMap:
    """Return the map without the ground of these cells."""
    seen_s = np.where(hidden, -math.inf, site_map.seen_s)
    return replace(site_map, free=site_map.free & ~hidden, seen_s=seen_s)
