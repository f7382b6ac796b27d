"""Helpers for the leaves' tests: a policy with given answers, and a world that moves."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uav_bt.answers import Advance, Answer, Blocked
from uav_bt.board import CLASS_MAP, STATE
from uav_bt.classes import CARPET
from uav_bt.protocols import PolicyView
from uav_bt.testing import LeafBench
from uav_bt.tree import Leaf, MissionTree, Status
from uav_bt.types import (
    Attitude,
    BodyVelocity,
    ClassMap,
    DroneState,
    FlyingState,
    MovementStatus,
    NearObstacles,
    Pose2D,
    SiteMap,
)

ADVANCE = Advance(forward_m=0.3, reason="clear")
TURN_RIGHT = Blocked(yaw_rad=0.5, reason="obstacle")
TURN_LEFT = Blocked(yaw_rad=-0.5, reason="obstacle")


class Says:
    """A policy that gives its decisions in turn, the last one for ever, and keeps the views."""

    def __init__(self, *decisions: Answer) -> None:
        self.decisions = list(decisions)
        self.views: list[PolicyView] = []

    def decide(self, view: PolicyView) -> Answer:
        """Return the next decision."""
        self.views.append(view)
        return self.decisions.pop(0) if len(self.decisions) > 1 else self.decisions[0]


def carpet() -> NDArray[np.uint8]:
    """Return a class map of nothing but carpet."""
    return np.full((18, 32), CARPET, dtype=np.uint8)


def steering_bench(leaf: type[Leaf], policy: Says, **attributes: object) -> LeafBench:
    """Return a bench for a leaf that moves under this policy."""
    bench = LeafBench(leaf, policy="says", **attributes)
    bench.policies["says"] = policy
    return bench


def show(
    bench: LeafBench,
    *,
    seconds: float = 0.1,
    flying: FlyingState = FlyingState.HOVERING,
    height_m: float = 1.5,
    yaw_rad: float = 0.0,
    gimbal_deg: float = -30.0,
    movement: MovementStatus | None = None,
    velocity: BodyVelocity | None = None,
    ids: NDArray[np.uint8] | None = None,
) -> None:
    """Let time pass and write a world of now on the board, all of it fresh."""
    bench.clock.advance(seconds)
    bench.observe(
        DroneState(
            captured_s=bench.clock.now(),
            flying=flying,
            attitude=Attitude(yaw_rad=yaw_rad),
            altitude_m=height_m,
            height_m=height_m,
            height_above_carpet_m=height_m,
            gimbal_pitch_rad=math.radians(gimbal_deg),
            movement=movement,
            velocity=velocity or BodyVelocity(),
        )
    )
    shown = carpet() if ids is None else ids
    bench.board[CLASS_MAP] = ClassMap(ids=shown, captured_s=bench.clock.now())


def live(bench: LeafBench, **world: Any) -> Status:
    """Show the leaf a world of now, and tick it."""
    show(bench, **world)
    return bench.tick()


def wait(bench: LeafBench, seconds: float, **world: Any) -> Status:
    """Let a leaf run for a while, in ticks of half a second at most, until it ends."""
    status = Status.RUNNING
    while seconds > 1e-9 and status is Status.RUNNING:
        status = live(bench, seconds=min(0.5, seconds), **world)
        seconds -= 0.5
    return status


def halted_proposals(bench: LeafBench) -> tuple[object, object]:
    """Halt the leaf at the start of a tick; return the proposals of the halt."""
    assert STATE in bench.board
    bench.proposals.clear()
    bench.halt()
    return bench.proposed, bench.pointed


def replace_tree(bench: LeafBench, leaf: Leaf) -> None:
    """Let another tree take over the bench's mission, as the runner does."""
    tree = MissionTree(leaf)
    tree.setup(bench.leaf.mission)
    bench.halt()
    tree.inherit(bench.tree)
    bench.tree = tree


def map_with(near: NearObstacles) -> SiteMap:
    """Return a map that views contradict: only its near obstacles are used."""
    nothing, cells = np.empty((0, 2)), np.zeros((3, 3), dtype=bool)
    return SiteMap(
        pose=Pose2D(x_m=0.0, y_m=0.0, yaw_rad=0.0),
        corner_m=(-0.1, -0.1),
        cell_m=0.1,
        seen_s=np.full((3, 3), -math.inf),
        free=cells,
        outside=cells,
        passed=cells,
        obstacles_m=nothing,
        edges_m=nothing,
        captured_s=near.captured_s,
        contradicted_s=9.0,
        near=near,
    )
