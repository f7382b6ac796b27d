"""Helpers for the leaves' tests, besides those of the test kit."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from behaviours.fly.explore import Explore
from tests.worlds import values
from uav_bt.answers import Advance, Blocked
from uav_bt.board import SITE_MAP
from uav_bt.testing import LeafBench
from uav_bt.testing.world import Says, live, show
from uav_bt.tree import Leaf, MissionTree, Status, shipped_subtree
from uav_bt.types import MoveBy, MovementState, MovementStatus, NearObstacles, SiteMap, Velocity

ADVANCE = Advance(forward_m=0.3, reason="clear")
TURN_RIGHT = Blocked(yaw_rad=0.5, reason="obstacle")
TURN_LEFT = Blocked(yaw_rad=-0.5, reason="obstacle")


RETURN_TO_BASE: Any = partial(shipped_subtree, "ReturnToBase")


def steering_bench(leaf: type[Leaf], policy: Says, **attributes: object) -> LeafBench:
    """Return a bench for a leaf that moves under this policy."""
    bench = LeafBench(leaf, policy="says", **attributes)
    bench.policies["says"] = policy
    return bench


def wait(bench: LeafBench, seconds: float, **world: Any) -> Status:
    """Let a leaf run for a while, in ticks of half a second at most, until it ends."""
    status = Status.RUNNING
    while seconds > 1e-9 and status is Status.RUNNING:
        status = live(bench, **{**world, "seconds": min(0.5, seconds)})
        seconds -= 0.5
    return status


def velocity(bench: LeafBench) -> Velocity:
    """Return the velocity that a leaf proposes."""
    assert isinstance(bench.proposed, Velocity)
    return bench.proposed


def step(bench: LeafBench) -> MoveBy:
    """Return the movement that a leaf proposes."""
    assert isinstance(bench.proposed, MoveBy)
    return bench.proposed


def ended(bench: LeafBench, word: MovementState = MovementState.DONE) -> MovementStatus:
    """Return the telemetry of that movement, at its end."""
    return MovementStatus(id=step(bench).id, state=word)


def replace_tree(bench: LeafBench, leaf: Leaf) -> None:
    """Let another tree take over the bench's mission, as the runner does."""
    tree = MissionTree(leaf)
    tree.setup(bench.leaf.mission)
    bench.halt()
    tree.inherit(bench.tree)
    bench.tree = tree


def map_with(near: NearObstacles) -> SiteMap:
    """Return a map that views contradict: only its near obstacles are used."""
    return values.site_map(3, captured_s=near.captured_s, contradicted_s=9.0, near=near)


def begun(policy: Says, leaf: type[Leaf] = Explore, **attributes: object) -> LeafBench:
    """Return a bench whose leaf has settled, and acts by its first view."""
    bench = steering_bench(leaf, policy, **attributes)
    assert live(bench) is Status.RUNNING
    assert bench.proposed is None
    live(bench, seconds=0.3)
    return bench


def near(bench: LeafBench, *points: tuple[float, float], edge_m: float = 9.0) -> None:
    """Remember obstacles around the drone and an edge ahead, and tick."""
    show(bench, seconds=0.3)
    points_m = np.array(points, dtype=np.float64).reshape(-1, 2)
    edges_m, now_s = np.array([[edge_m, 0.0]]), bench.clock.now()
    seen = NearObstacles(points_m=points_m, edges_m=edges_m, captured_s=now_s)
    bench.board[SITE_MAP] = map_with(seen)
    assert bench.tick() is Status.RUNNING
