"""A drone in flight around one steering leaf, and maps that are drawn as text."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from uav_bt.answers import Answer
from uav_bt.board import CLASS_MAP, SITE_MAP
from uav_bt.errors import ShapeError, ValueRangeError
from uav_bt.lab.shipped import load_lab
from uav_bt.protocols import PolicyView
from uav_bt.testing.bench import LeafBench
from uav_bt.tree import Status
from uav_bt.types import ClassMap, FlyingState, MovementStatus, Pose2D, SiteMap
from uav_bt.types.arrays import Flags, Floats, Image
from uav_bt.types.drone_state import Attitude, BodyVelocity


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


Wall = tuple[tuple[float, float], tuple[float, float]]
"""A wall: its two ends, x and y in metres in the frame of the map."""

_CELL_M: Final = 0.1  # of a flight's map
_AROUND_M: Final = 1.0  # of the grid beyond the ground; chosen
_STEP_M: Final = 0.05  # between two points of a wall; chosen


def drawn_map(
    *,
    ground_m: float = 4.0,
    walls: Sequence[Wall] = (),
    obstacles: Floats | None = None,
    pose: tuple[float, float, float] = (0.0, 0.0, 0.0),
    known: Flags | None = None,
    passed: Flags | None = None,
) -> SiteMap:
    """Return the map of a square of ground around the origin; beyond it is the outside.

        site_map = drawn_map(walls=[((0.8, -2.0), (0.8, 2.0))], pose=(-1.0, 0.0, 0.0))

    The frame is that of a `SiteMap`. Its take-off pose is the origin with heading 0, so x is ahead
    of it and y to its right. Objects, mark, movers and another `start` are added with
    `dataclasses.replace`.

    Args:
        ground_m: side of the ground.
        walls: obstacles along straight lines.
        obstacles: (N, 2) further points of obstacles, m.
        pose: x and y of the drone, m, and its heading, rad, from x towards y.
        known: cells in which ground was seen. Default: all of the ground. Grids have cells of
            0.1 m and reach 1 m beyond the ground; `drawn_map().places_m()` has the places of the
            cells.
        passed: cells near the flown path. Default: none.
    """
    if not 0.0 < ground_m < math.inf:
        raise ValueRangeError(f"ground_m must be positive, got {ground_m}")
    half = round((ground_m / 2 + _AROUND_M) / _CELL_M)
    places = (np.moveaxis(np.indices((2 * half + 1, 2 * half + 1)), 0, -1) - half) * _CELL_M
    ground = np.abs(places).max(axis=-1) <= ground_m / 2 + 1e-9
    for name, grid in (("known", known), ("passed", passed)):
        if grid is not None and grid.shape != ground.shape:
            raise ShapeError(name, expected=str(ground.shape), actual=grid.shape)
    given = np.empty((0, 2)) if obstacles is None else obstacles
    if given.ndim != 2 or given.shape[1] != 2:
        raise ShapeError("obstacles", expected="(N, 2)", actual=given.shape)
    steps = [(wall, math.ceil(math.dist(*wall) / _STEP_M)) for wall in walls]
    lines = [np.linspace(*wall, max(2, count + 1)) for wall, count in steps]
    seen = ground if known is None else ground & known
    return SiteMap(
        classes=load_lab().classes,
        pose=Pose2D(x_m=pose[0], y_m=pose[1], yaw_rad=pose[2]),
        corner_m=(-half * _CELL_M, -half * _CELL_M),
        cell_m=_CELL_M,
        seen_s=np.where(seen, 1.0, -math.inf),
        free=seen,
        outside=~ground,
        passed=np.zeros_like(ground) if passed is None else passed,
        obstacles_m=np.vstack([given, *lines]),
        edges_m=np.empty((0, 2)),
        captured_s=1.0,
    )
