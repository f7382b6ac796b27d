"""A drone in flight around one steering leaf: its state, its views and its policy's answers."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from uav_bt.answers import Answer
from uav_bt.board import CLASS_MAP, SITE_MAP
from uav_bt.lab.shipped import load_lab
from uav_bt.protocols import PolicyView
from uav_bt.testing.bench import LeafBench
from uav_bt.tree import Status
from uav_bt.types import Attitude, BodyVelocity, ClassMap, FlyingState, MovementStatus, SiteMap
from uav_bt.types.arrays import Image


class Says:
    """A policy that gives its answers in turn, the last one for ever.

        bench = LeafBench(Explore, policy="says")
        bench.policies["says"] = Says(Advance(forward_m=0.3, reason="clear"))

    `answers` are still to come; `views` are those that the policy was asked about, in order.
    """

    def __init__(self, first: Answer, *others: Answer) -> None:
        self.answers = [first, *others]
        self.views: list[PolicyView] = []

    def decide(self, view: PolicyView) -> Answer:
        """Return the next answer."""
        self.views.append(view)
        return self.answers.pop(0) if len(self.answers) > 1 else self.answers[0]


def ground() -> Image:
    """Return class ids of nothing but ground, (18, 32) uint8, of the paper's lab."""
    return np.full((18, 32), load_lab().classes.ground, dtype=np.uint8)


def show(
    bench: LeafBench,
    *,
    seconds: float = 0.1,
    site_map: SiteMap | None = None,
    ids: Image | None = None,
    flying: FlyingState = FlyingState.HOVERING,
    height_m: float = 1.5,
    yaw_rad: float | None = None,
    gimbal_deg: float = -30.0,
    movement: MovementStatus | None = None,
    velocity: BodyVelocity | None = None,
) -> None:
    """Let time pass, then write telemetry, a black frame, a class map and a site map of now.

    Args:
        bench: the bench of the leaf.
        seconds: time that passes before.
        site_map: the map, such as a `drawn_map`. Default: the board's map stays as it is.
        ids: (H, W) uint8 class ids of the paper's lab. Default: `ground()`.
        flying: flying state in the telemetry.
        height_m: above the ground and above the take-off point.
        yaw_rad: heading in the telemetry. Default: that of the map's pose, 0 without a map.
        gimbal_deg: pitch of the camera, 0 level, negative down.
        movement: state of the last movement, as the drone reports it.
        velocity: in the body frame. Default: 0.
    """
    bench.clock.advance(seconds)
    now_s = bench.clock.now()
    if yaw_rad is None:
        yaw_rad = 0.0 if site_map is None else site_map.pose.yaw_rad
    bench.hover(
        height_m=height_m,
        flying=flying,
        attitude=Attitude(yaw_rad=yaw_rad),
        gimbal_pitch_rad=math.radians(gimbal_deg),
        movement=movement,
        velocity=velocity or BodyVelocity(),
    )
    bench.board[CLASS_MAP] = ClassMap(
        ids=ground() if ids is None else ids, classes=load_lab().classes, captured_s=now_s
    )
    if site_map is not None:
        bench.board[SITE_MAP] = replace(site_map, captured_s=now_s)


def live(bench: LeafBench, **world: Any) -> Status:
    """Show the leaf the drone in flight (see `show`), tick it once and return its answer."""
    show(bench, **world)
    return bench.tick()
