"""How wrong height, dead reckoning and map are while the survey flies, by the truth.

    python benchmarks/map_error.py --profile harsh --flights 2 --out runs/map-error

Exact masks at 320x180 and no depth: the errors left are those of telemetry and of the mapping.
Each flight is a line of DIR/flights.jsonl, and those that are there are not flown again.

height       of the body above the ground, as it is flown by, root mean square
turn, way    of dead reckoning from one frame to the next, where it followed the ground
untracked    share of the time in which it has followed no ground for a second and longer
drift        of the drone's place on the map, mean
distance     to the nearest object nearer than 0.7 m, on the map less the true one, 95th percentile:
             so much further away than it is the map believes it
nearest      the smallest clearance
passed_90s   the share of the ground that was passed
"""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path

import numpy as np
from mission_text import cover_or_turn, explore_and_come_home

from uav_bt import app
from uav_bt.app.assembly import Flight
from uav_bt.board import ODOMETRY, SITE_MAP
from uav_bt.errors import UavBtError
from uav_bt.mission.map_alignment import MapAlignment
from uav_bt.mission.tick import TickListener, TickRecord
from uav_bt.protocols import Drone
from uav_bt.types import Pose, Pose2D, wrap_angle
from uav_bt.types.dead_reckoning import MotionEstimate, OdometryPose, PoseHistory
from uav_bt.types.ground import Ground

FLIGHTS = "flights.jsonl"
SURVEY_S = 180
FIRST_S = 15.0  # of the flight: the map begins
NEAR_M = 0.7
UNTRACKED_S = 1.0
COLUMNS = (
    *("height_m", "turn_rad", "way_m", "untracked", "drift_m"),
    *("distance_m", "nearest_m", "passed_90s"),
)


class ErrorLog:
    """Notes the errors of the mission's estimates in every tick."""

    def __init__(self, flight: Flight[Drone]) -> None:
        referee = flight.drone.referee
        self._ground = None if referee is None else referee.ground()
        self._board = flight.context.board
        self._alignment = MapAlignment()
        self._true: PoseHistory[Pose2D] = PoseHistory(memory_s=3.0)  # in the odometry's convention
        self._seen: tuple[OdometryPose, Pose2D] | None = None  # the last frame's pose and the true
        self._height_m: list[float] = []
        self._turn_rad: list[float] = []
        self._way_m: list[float] = []
        self._untracked: list[bool] = []
        self._drift_m: list[float] = []
        self._distance_m: list[float] = []

    def on_tick(self, record: TickRecord) -> None:
        """Take note of a tick."""
        if record.truth is None or self._ground is None:
            return
        pose, state = record.truth.pose, record.observation.state
        self._true.add(record.time_s, Pose2D(x_m=pose.x_m, y_m=-pose.y_m, yaw_rad=-pose.yaw_rad))
        site_map, motion = self._board.read(SITE_MAP).value, self._board.read(ODOMETRY).value
        self._alignment.add(record.time_s, pose, state.attitude.yaw_rad, site_map)
        placement = self._alignment.placement
        if record.time_s < FIRST_S or site_map is None or motion is None or placement is None:
            return
        self._height_m.append(state.height_above_ground_m - pose.z_m)
        self._add_step(motion)
        self._untracked.append(motion.untracked_s > UNTRACKED_S)
        believed = placement.pose_to_world(site_map.pose)
        self._drift_m.append(math.hypot(believed.x_m - pose.x_m, believed.y_m - pose.y_m))
        true_m = nearest_object_m(self._ground, pose)
        if true_m < NEAR_M and len(site_map.obstacles_m):
            mapped_m = np.hypot(*site_map.pose.points_to_body(site_map.obstacles_m).T).min()
            self._distance_m.append(float(mapped_m) - true_m)

    def _add_step(self, motion: MotionEstimate) -> None:
        seen, true = motion.seen, self._true.at(motion.seen.time_s)
        if true is None or (self._seen is not None and seen.time_s <= self._seen[0].time_s):
            return
        before, self._seen = self._seen, (seen, true)
        if before is None or motion.tracked_s < seen.time_s:
            return
        reckoned_m = before[0].to_body(seen.x_m, seen.y_m)
        self._way_m.append(math.dist(reckoned_m, before[1].to_body(true.x_m, true.y_m)))
        turns_rad = seen.yaw_rad - before[0].yaw_rad, true.yaw_rad - before[1].yaw_rad
        self._turn_rad.append(wrap_angle(turns_rad[0] - turns_rad[1]))

    def fields(self) -> dict[str, float | None]:
        """Return the errors of the flight; None for what never came up."""
        return {
            "height_m": _rms(self._height_m),
            "turn_rad": _rms(self._turn_rad),
            "way_m": _rms(self._way_m),
            "untracked": float(np.mean(self._untracked)) if self._untracked else None,
            "drift_m": float(np.mean(self._drift_m)) if self._drift_m else None,
            "distance_m": float(np.percentile(self._distance_m, 95)) if self._distance_m else None,
        }


def _rms(errors: list[float]) -> float | None:
    return float(np.sqrt(np.mean(np.square(errors)))) if errors else None


def nearest_object_m(ground: Ground, pose: Pose) -> float:
    """Return the distance from a pose's place to the nearest object's side, seen from above."""
    nearest_m = math.inf
    for each in ground.standing:
        if each.class_id is None:  # the landing box
            continue
        along_m, across_m = each.footprint.to_body(pose.x_m, pose.y_m)
        apart_m = (
            max(abs(along_m) - each.footprint.half_x_m, 0.0),
            max(abs(across_m) - each.footprint.half_y_m, 0.0),
        )
        nearest_m = min(nearest_m, math.hypot(*apart_m))
    return nearest_m


def fly(scene: str, seed: int, profile: str) -> dict[str, object]:
    """Fly the survey once and return its line."""
    text = explore_and_come_home(
        explore=cover_or_turn(),
        explore_s=SURVEY_S,
        home='<ReturnToBase gives_way="true"/>',
        gimbal_deg=-42,
    )
    options = app.FlightOptions(
        scene=scene, seed=seed, profile=profile, exact_masks=True, image_size_px=(320, 180)
    )
    logs: list[ErrorLog] = []

    def listen(flight: Flight[Drone]) -> list[TickListener]:
        logs.append(ErrorLog(flight))
        return [logs[0]]

    report = app.fly(text, options, listeners=[listen])
    return {
        "scene": scene,
        "seed": seed,
        "profile": profile,
        "outcome": report.outcome,
        **logs[0].fields(),
        "nearest_m": report.min_clearance_m,
        "passed_90s": report.coverage_passed_90s,
    }


def main() -> None:
    """Fly the missing flights, then print the means."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenes", default="val-a,val-b,train-a,train-b")
    parser.add_argument("--flights", type=int, default=2)
    parser.add_argument("--seed-from", type=int, default=0)
    parser.add_argument("--profile", default="harsh")
    parser.add_argument("--out", type=Path, required=True)
    given = parser.parse_args()
    given.out.mkdir(parents=True, exist_ok=True)
    file = given.out / FLIGHTS
    text = file.read_text(encoding="utf-8") if file.is_file() else ""
    flights = [json.loads(line) for line in text.splitlines()]
    done = {(each["scene"], each["seed"], each["profile"]) for each in flights}
    for seed in range(given.seed_from, given.seed_from + given.flights):
        for scene in given.scenes.split(","):
            if (scene, seed, given.profile) in done:
                continue
            try:
                flights.append(fly(scene, seed, given.profile))
            except UavBtError as error:
                parser.exit(2, f"{error}\n")
            with file.open("a", encoding="utf-8") as kept:
                kept.write(json.dumps(flights[-1]) + "\n")
    mine = [each for each in flights if each["profile"] == given.profile]
    landed = sum(each["outcome"] == "success" for each in mine)
    print(f"{len(mine)} flights, {landed} landed; mean (largest, smallest)")
    for name in COLUMNS:
        values = [each[name] for each in mine if each[name] is not None] or [math.nan]
        print(f"{name:12s} {np.mean(values):8.4f} ({max(values):.4f}, {min(values):.4f})")


if __name__ == "__main__":
    main()
