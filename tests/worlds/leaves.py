"""Helpers for the leaves' tests, besides those of the test kit."""

from __future__ import annotations

from functools import partial
from typing import Any

from tests.worlds import values
from uav_bt.answers import Advance, Blocked
from uav_bt.testing import LeafBench
from uav_bt.testing.world import Says, live
from uav_bt.tree import Leaf, MissionTree, Status, shipped_subtree
from uav_bt.types import (
    MoveBy,
    MovementState,
    MovementStatus,
    NearObstacles,
    SiteMap,
    Velocity,
)

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
