"""How often perception fails in flight, for the drone without images to fail as often.

    python benchmarks/fit_dropouts.py --profile lab          # also: harsh

Surveys of the twin with networks and of the drone without images fly the same scenes and seeds. A
frame drops out if the odometry measured no motion in it, or if the landing mark was not detected
although all of its top was in view. Both depend on the view, so the shares are by the ground in
view and by the distance of the mark. Things that hide the mark count as drop-outs of both drones.
"""

from __future__ import annotations

import argparse
import itertools
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from sim_bridge.anafi import CAMERA_FORWARD_M, anafi_camera
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.scene_file import load_scene
from uav_bt import app
from uav_bt.app.assembly import Flight
from uav_bt.board import CLASS_MAP, MARK, ODOMETRY
from uav_bt.mission.tick import TickListener, TickRecord
from uav_bt.protocols import Drone
from uav_bt.types import Frame, Pose
from uav_bt.types.dead_reckoning import PoseHistory
from uav_bt.types.projection import project

GROUND: Final = (0.0, 0.1, 0.2, 0.4, 1.0)  # edges of the shares of ground in the image
RANGES_M: Final = (0.0, 1.0, 1.5, 2.0, 3.0)  # edges of the distances of the mark
Sample = tuple[float, bool]  # share or distance, and whether the frame dropped out


class DropOuts:
    """Notes the drop-outs of flights in a scene with a landing mark."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._true: PoseHistory[Pose] = PoseHistory(memory_s=3.0)
        self._seen_s = -math.inf
        self.motion: list[Sample] = []
        self.mark: list[Sample] = []

    def follow(self, flight: Flight[Drone]) -> list[TickListener]:
        """Become a listener of a flight."""
        self._board = flight.context.board
        return [self]

    def on_tick(self, record: TickRecord) -> None:
        """Note the newest frame, once."""
        if record.truth is not None:
            self._true.add(record.time_s, record.truth.pose)
        motion, class_map = self._board.read(ODOMETRY).value, self._board.read(CLASS_MAP).value
        frame = record.observation.frame
        if motion is None or class_map is None or frame is None:
            return
        if frame.captured_s <= self._seen_s or class_map.captured_s != frame.captured_s:
            return
        self._seen_s = frame.captured_s
        ground = float(np.mean(class_map.is_ground))
        self.motion.append((ground, motion.tracked_s < frame.captured_s))
        away_m = self._mark_in_view_m(frame)
        if away_m is not None:
            fix = self._board.read(MARK).value
            self.mark.append((away_m, fix is None or fix.captured_s < frame.captured_s))

    def _mark_in_view_m(self, frame: Frame) -> float | None:
        """Return the distance of a mark whose top is in view as a whole; None without one."""
        pose, pad = self._true.at(frame.captured_s), self._scene.helipad
        if pose is None or pad is None:
            return None
        lens = anafi_camera(640, 360)
        cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        apart_m = np.array(pad.footprint.corners()) - (pose.x_m, pose.y_m)
        ahead_m, right_m = apart_m @ (cos, sin), apart_m @ (sin, -cos)
        down_m = np.full(4, pose.z_m - pad.size_m[2])
        points_m = np.column_stack([ahead_m - CAMERA_FORWARD_M, right_m, down_m])
        pixels = project(points_m, lens, frame.gimbal_pitch_rad)
        inside = (pixels >= 0.0) & (pixels <= (lens.width_px - 1, lens.height_px - 1))
        return float(np.hypot(ahead_m, right_m).mean()) if inside.all() else None


def fly(drone: str, scene: str, profile: str) -> DropOuts:
    """Fly a survey and return its drop-outs."""
    log = DropOuts(load_scene(scene))
    ports = {"ExploreFor.duration_ms": "60000"}
    options = app.FlightOptions(drone=drone, scene=scene, profile=profile, ports=ports)
    if drone == "twin":
        options = replace(options, image_size_px=(320, 180))
    app.fly("survey_and_land", options, listeners=[log.follow])
    return log


def shares(samples: Sequence[Sample], edges: tuple[float, ...]) -> str:
    """Return the share of drop-outs and the number of frames between each two edges."""
    values, dropped = np.array(samples, dtype=float).reshape(-1, 2).T
    cells = []
    for low, high in itertools.pairwise(edges):
        rows = (values >= low) & (values < high)
        cells.append(f"{dropped[rows].mean():.1%} of {rows.sum()}" if rows.any() else "-")
    return ", ".join(cells)


def main() -> None:
    """Fly, and print the shares."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--profile", default="lab")
    parser.add_argument("--scenes", default="val-a,val-b")
    given = parser.parse_args()
    for drone in ("twin", "plain"):
        logs = [fly(drone, scene, given.profile) for scene in given.scenes.split(",")]
        motion = [sample for log in logs for sample in log.motion]
        mark = [sample for log in logs for sample in log.mark]
        print(f"{drone}: frames without motion, by ground {GROUND}: {shares(motion, GROUND)}")
        print(f"{drone}: frames without mark, by metres {RANGES_M}: {shares(mark, RANGES_M)}")


if __name__ == "__main__":
    main()
