"""Values on the board, with what most tests do not care about filled in."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from tests.paper_lab import CLASSES
from uav_bt.mission.flight_log import FlightLog
from uav_bt.mission.flight_report import FlightReport
from uav_bt.mission.tick import TickRecord
from uav_bt.tree import Status
from uav_bt.types import (
    BodyVelocity,
    Command,
    Corridor,
    DroneState,
    Frame,
    Hover,
    MarkFix,
    Movement,
    Observation,
    Pose,
    Pose2D,
    SiteMap,
    Truth,
)
from uav_bt.types.arrays import Image
from uav_bt.types.dead_reckoning import MotionEstimate, OdometryPose

STILL = BodyVelocity()


def motion(
    pose: OdometryPose,
    *,
    velocity: BodyVelocity = STILL,
    error: BodyVelocity = STILL,
    tracked_s: float | None = None,
    **more: Any,
) -> MotionEstimate:
    """Return the motion of a drone at a pose, by default at rest on ground that is followed."""
    tracked_s = pose.time_s if tracked_s is None else tracked_s
    given = {"seen": pose, "velocity": velocity, "error": error, "tracked_s": tracked_s, **more}
    return MotionEstimate(pose=pose, **given)


def fix(
    captured_s: float, forward_m: float, right_m: float = 0.0, *, height_m: float = 0.4, **more: Any
) -> MarkFix:
    """Return a sight of the mark on a box of 0.4 m."""
    more = {"detected": True, **more}
    return MarkFix(
        captured_s=captured_s, forward_m=forward_m, right_m=right_m, height_m=height_m, **more
    )


def corridor(
    free_m: float = math.inf,
    side: Any = None,
    *,
    nearest_m: float | None = None,
    captured_s: float = 0.0,
    impact_s: float = math.inf,
) -> Corridor:
    """Return a corridor that is free for a distance, with the nearest obstacle on a side."""
    return Corridor(
        captured_s=captured_s,
        free_distance_m=free_m,
        nearest_m=free_m if nearest_m is None else nearest_m,
        nearest_side=side,
        time_to_impact_s=impact_s,
    )


def frame(
    image: Image | tuple[int, int],
    pitch_rad: float = -0.5,
    height_m: float = 1.5,
    *,
    captured_s: float = 0.0,
    index: int = 0,
    **more: Any,
) -> Frame:
    """Return a frame of an image, or of a black one with so many rows and columns."""
    return Frame(
        image=np.zeros((*image, 3), np.uint8) if isinstance(image, tuple) else image,
        index=index,
        captured_s=captured_s,
        gimbal_pitch_rad=pitch_rad,
        height_above_ground_m=height_m,
        **more,
    )


def site_map(cells: int, **changes: Any) -> SiteMap:
    """Return a map of so many cells a side around the origin, in which nothing was seen."""
    no = np.zeros((cells, cells), dtype=np.bool_)
    given: dict[str, Any] = {
        "classes": CLASSES,
        "pose": Pose2D(x_m=0.0, y_m=0.0, yaw_rad=0.0),
        "corner_m": (-0.05 * cells, -0.05 * cells),
        "cell_m": 0.1,
        "seen_s": np.full(no.shape, -math.inf),
        "free": no,
        "outside": no,
        "passed": no,
        "obstacles_m": np.empty((0, 2)),
        "edges_m": np.empty((0, 2)),
        "captured_s": 0.0,
    }
    return SiteMap(**{**given, **changes})


def truth(pose: Pose, time_s: float = 0.0, **more: Any) -> Truth:
    """Return the truth of a drone in flight over the ground, a metre away from everything."""
    given = {
        "contacts": (),
        "clearance_m": 1.0,
        "inside_ground": True,
        "on_mark": False,
        "landing_error_m": 1.0,
        "motors_on": True,
        **more,
    }
    return Truth(time_s=time_s, pose=pose, **given)


def tick(
    state: DroneState, movement: Movement | None = None, *, time_s: float | None = None, **more: Any
) -> TickRecord:
    """Return a tick in which a leaf hovers, at the time of the state."""
    given = {
        "index": 0,
        "tree_status": Status.RUNNING,
        "phase": "",
        "active": (),
        "proposed_by": None,
        "override": None,
        "compute_s": 0.001,
        "truth": None,
        **more,
    }
    return TickRecord(
        time_s=state.captured_s if time_s is None else time_s,
        observation=Observation(frame=None, state=state),
        command=Command(movement=movement or Hover()),
        **given,
    )


def report(log: FlightLog, **more: Any) -> FlightReport:
    """Return the report of a flight of the twin that was a success."""
    given = {
        "scene": "test-a",
        "seed": 7,
        "tree": "mission.xml",
        "policies": {},
        "drone": "twin",
        "profile": "lab",
        "outcome": "success",
        "reason": "landed",
        "warnings": list(log.warnings),
        **more,
    }
    return FlightReport(**given, **log.fields())
