"""What films and views show of a flight, of its path and of a tick."""

from __future__ import annotations

import colorsys
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from uav_bt.board import CLASS_MAP, CORRIDOR, ELAPSED, MARK, METRIC_DEPTH, SITE_MAP
from uav_bt.board.blackboard import Blackboard
from uav_bt.display.canvas import Colour, Point
from uav_bt.display.lab_map import LabMap
from uav_bt.lab.classes import LabClasses
from uav_bt.mission.tick import TickRecord
from uav_bt.types import CameraModel, ClassMap, DepthMap, Frame, MoverState, Pose
from uav_bt.types.dead_reckoning import Odometry, OdometryPose

Intruding = Callable[[Frame, ClassMap, DepthMap], NDArray[np.bool_]]
"""Returns which pixels of a depth map are inside the corridor, (H, W)."""

_UNNAMED: Final[Colour] = (150, 156, 166)  # colour before the first phase


def phase_colours(phases: Sequence[str]) -> dict[str, Colour]:
    """Return a bright colour for each phase, in the order of first appearance."""
    colours = {"": _UNNAMED}
    for number, phase in enumerate(filter(None, dict.fromkeys(phases))):
        hue = (0.55 + 0.382 * number) % 1.0  # the golden ratio
        red, green, blue = (round(255 * part) for part in colorsys.hsv_to_rgb(hue, 0.5, 1.0))
        colours[phase] = (red, green, blue)
    return colours


@dataclass(frozen=True, kw_only=True, eq=False)
class FlightFacts:
    """What does not change during a flight."""

    camera: CameraModel  # intrinsics at the size of the frames
    classes: LabClasses
    title: str = ""  # mission, scene and seed
    lab_map: LabMap | None = None  # None: unknown
    nodes: tuple[tuple[str, str], ...] = ()  # path and name, in the order of the tree file
    limit_s: float = math.inf  # of the flight's time
    makes_depth: bool = False  # whether the mission makes metric depth
    start_s: float | None = None  # start of a view's timeline; None: the first tick
    intruding: Intruding | None = None  # None: no pixel is marked


class FlownPath:
    """Tracks the pose, the path and the travelled distance of a flight.

    Without a referee the pose is dead-reckoned from the telemetry. The origin is then the position
    at the first tick, and x points along the heading at that tick.
    """

    def __init__(self) -> None:
        self.points: list[tuple[Point, str]] = []  # world x and y, and the mission's phase
        self.phases: list[str] = []  # in the order of their first appearance
        self.distance_m = 0.0
        self.pose: Pose | None = None  # None before the first tick
        self.movers: tuple[MoverState, ...] = ()  # ground truth
        self._odometry = Odometry()
        self._first: OdometryPose | None = None

    def add(self, record: TickRecord) -> Pose:
        """Add a tick and return the present pose."""
        truth = record.truth
        self.movers = () if truth is None else truth.movers
        pose = truth.pose if truth is not None else self._reckoned(record)
        if self.pose is not None:
            self.distance_m += math.hypot(pose.x_m - self.pose.x_m, pose.y_m - self.pose.y_m)
        self.pose = pose
        self.points.append(((pose.x_m, pose.y_m), record.phase))
        if record.phase not in self.phases:
            self.phases.append(record.phase)
        return pose

    def _reckoned(self, record: TickRecord) -> Pose:
        state = record.observation.state
        now = self._odometry.update(state, record.time_s)
        first = self._first = self._first or now
        forward_m, right_m = first.to_body(now.x_m, now.y_m)
        # The drone's yaw is clockwise, the world's counter-clockwise.
        yaw_rad = first.yaw_rad - now.yaw_rad
        return Pose(x_m=forward_m, y_m=-right_m, z_m=state.height_above_ground_m, yaw_rad=yaw_rad)


class Shown:
    """What is shown of a tick; stale values are None."""

    def __init__(self, record: TickRecord, flown: FlownPath, board: Blackboard) -> None:
        self.record = record
        self.flown = flown
        self.frame = record.observation.frame
        self.elapsed_s = board.read(ELAPSED).value or 0.0  # since the take-off command
        self.fix = board.read(MARK)
        self.class_map = board.read(CLASS_MAP).value
        self.depth = board.read(METRIC_DEPTH)
        self.corridor = board.read(CORRIDOR).value
        self.site_map = board.read(SITE_MAP).value

    def intruding_pixels(self, facts: FlightFacts) -> NDArray[np.bool_] | None:
        """Return which pixels of the depth map are inside the corridor, (H, W).

        None if an input is missing, or the three have different capture times.
        """
        frame, class_map, depth = self.frame, self.class_map, self.depth.value
        if facts.intruding is None or frame is None or class_map is None or depth is None:
            return None
        together = depth.captured_s == class_map.captured_s == frame.captured_s
        return facts.intruding(frame, class_map, depth) if together else None
