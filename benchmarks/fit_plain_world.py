"""Compare the errors of the drone without images with those of the twin's perception, and fit them.

    python -m benchmarks.fit_plain_world                     # ranges, with today's errors
    python -m benchmarks.fit_plain_world --jitter 0 0.2 0.4  # other sizes of the jitter
    python -m benchmarks.fit_plain_world --network any --scenes ROOM/scenes/ROOM.yaml ...
    python -m benchmarks.fit_plain_world --dropouts --profile harsh

Both look at the same poses. Bases of obstacles and edges of the ground are compared, bearing by
bearing, with those in an exact class map of four times the resolution. `--dropouts` flies surveys:
a frame drops out without a measured motion, or without the landing mark that is all in view.
"""

from __future__ import annotations

import argparse
import itertools
import math
from collections import defaultdict
from dataclasses import replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from benchmarks.lab_views import frame_of
from perception.mapping.contact_scan import find_bases, scan_ground
from perception.networks.weights_file import SHIPPED_UNET, segmentation_file
from perception.segmentation.runtime import load_segmenter
from sim_bridge.anafi import CAMERA_FORWARD_M, anafi_camera
from sim_bridge.plain.caster import Caster
from sim_bridge.plain.sight import SIZE_PX, SightErrors
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.views import render_views, sample_flight_poses
from uav_bt import app
from uav_bt.board import CLASS_MAP, MARK, ODOMETRY
from uav_bt.learning.views import VALIDATION_SCENES
from uav_bt.mission.tick import TickRecord
from uav_bt.types import ClassMap, Pose
from uav_bt.types.arrays import Floats
from uav_bt.types.dead_reckoning import PoseHistory
from uav_bt.types.projection import project

EXACT_PX: Final = (896, 448)
GROUND: Final = (0.0, 0.1, 0.2, 0.4, 1.0)  # edges of the shares of ground in the image
RANGES_M: Final = (0.0, 1.0, 1.5, 2.0, 3.0)
SAME_RAD: Final = math.radians(0.6)  # bearings nearer than this are one
LENS: Final = anafi_camera(640, 360)
Sample = tuple[float, bool]
Compared = tuple[Floats, int, int]


def errors_of(seen: Floats, exact: Floats) -> Compared:
    """Return true range and range error by common bearing, (N, 2); points missed, false points."""
    if not len(seen) or not len(exact):
        return np.empty((0, 2)), len(exact), len(seen)
    apart = np.abs(np.arctan2(*seen.T[::-1])[:, None] - np.arctan2(*exact.T[::-1]))
    same, nearest = apart.min(axis=1) < SAME_RAD, apart.argmin(axis=1)
    ranges, truth = np.hypot(*seen[same].T), np.hypot(*exact[nearest[same]].T)
    missed = int(np.sum(apart.min(axis=0) >= SAME_RAD))
    return np.column_stack([truth, ranges - truth]), missed, int(np.sum(~same))


def row(pairs: list[Compared]) -> str:
    """Return median and 90 % of the absolute range error by range, and shares."""
    errors, cells = np.concatenate([found for found, _, _ in pairs]), []
    for near, far in itertools.pairwise(RANGES_M):
        off_m = 100 * np.abs(errors[(errors[:, 0] >= near) & (errors[:, 0] < far), 1])
        cells.append("{:.1f} {:.1f}".format(*np.percentile(off_m, [50, 90])) if len(off_m) else "-")
    missed, false = (sum(pair[index] for pair in pairs) for index in (1, 2))
    total = max(len(errors) + missed, 1)
    return f"{', '.join(cells)}; missed {missed / total:.1%}, false {false / total:.1%}"


def compare_ranges(given: argparse.Namespace, network: Path) -> None:
    """Print the errors of the twin's ranges, and of those without images by jitter."""
    generator, profile = np.random.default_rng(5), Profile.named(given.profile)
    found: dict[str, list[Compared]] = defaultdict(list)
    for scene in map(load_scene, given.scenes):
        segmenter = load_segmenter(network, scene.classes)
        fine, coarse = Caster(scene, EXACT_PX), Caster(scene, SIZE_PX)
        pitch = coarse.rays[1, 1] - coarse.rays[0, 0]
        poses = sample_flight_poses(scene, np.random.default_rng(11), given.views, lowered=0.5)
        for number, view in enumerate(render_views(scene, poses, profile=profile, seed=11)):
            frame, bases = frame_of(view, number), {}
            maps = {"exact": fine.cast(view.pose)[0], given.network: segmenter.segment(frame).ids}
            for jitter_px in given.jitter:
                rays = coarse.rays + generator.normal(0.0, jitter_px, coarse.rays.shape) * pitch
                maps[f"jitter {jitter_px:g} px"] = coarse.cast(view.pose, rays=rays)[0]
            for name, ids in maps.items():
                seen = ClassMap(ids=ids, classes=scene.classes, captured_s=frame.captured_s)
                bases[name] = find_bases(scan_ground(seen, frame, LENS.resized(*ids.shape[::-1])))
            exact = bases.pop("exact")
            for name, contacts in bases.items():
                found[f"bases, {name}"].append(errors_of(contacts.placed_m, exact.placed_m))
                found[f"edges, {name}"].append(errors_of(contacts.edges_m, exact.edges_m))
    print(f"median and 90 % of the absolute range error in cm between {RANGES_M} m")
    print("\n".join(f"  {name}: {row(found[name])}" for name in sorted(found)))


class DropOuts:
    """Notes the drop-outs of a flight: share of ground or distance, and whether it dropped out."""

    def __init__(self, drone: str, scene: str, profile: str) -> None:
        self._pad, self._true = load_scene(scene).helipad, PoseHistory[Pose](memory_s=3.0)
        self.motion, self.mark = list[Sample](), list[Sample]()
        self._seen_s, ports = -math.inf, {"ExploreFor.duration_ms": "60000"}
        options = app.FlightOptions(drone=drone, scene=scene, profile=profile, ports=ports)
        if drone == "twin":
            options = replace(options, image_size_px=(320, 180))
        app.fly("survey_and_land", options, listeners=[self._follow])

    def _follow(self, flight: app.Flight[Any]) -> list[DropOuts]:
        self._board = flight.context.board
        return [self]

    def on_tick(self, record: TickRecord) -> None:
        """Note the newest frame, once."""
        if record.truth is not None:
            self._true.add(record.time_s, record.truth.pose)
        frame, fix = record.observation.frame, self._board.read(MARK).value
        motion, seen = self._board.read(ODOMETRY).value, self._board.read(CLASS_MAP).value
        if motion is None or seen is None or frame is None or frame.captured_s <= self._seen_s:
            return
        if seen.captured_s != frame.captured_s:
            return
        self._seen_s = frame.captured_s
        self.motion.append((float(seen.is_ground.mean()), motion.tracked_s < frame.captured_s))
        pose = self._true.at(frame.captured_s)
        if pose is None or self._pad is None:
            return
        cos, sin = math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)
        apart_m = np.array(self._pad.footprint.corners()) - (pose.x_m, pose.y_m)
        ahead_m, right_m = apart_m @ (cos, sin), apart_m @ (sin, -cos)
        down_m = np.full(4, pose.z_m - self._pad.size_m[2])
        points_m = np.column_stack([ahead_m - CAMERA_FORWARD_M, right_m, down_m])
        pixels = project(points_m, LENS, frame.gimbal_pitch_rad)
        if ((pixels >= 0.0) & (pixels <= (LENS.width_px - 1, LENS.height_px - 1))).all():
            lost = fix is None or fix.captured_s < frame.captured_s
            self.mark.append((float(np.hypot(ahead_m, right_m).mean()), lost))


def shares(samples: list[Sample], edges: tuple[float, ...]) -> str:
    """Return the share of drop-outs and the number of frames between each two edges."""
    values, dropped = np.array(samples, dtype=float).reshape(-1, 2).T
    parts = [dropped[(values >= a) & (values < b)] for a, b in itertools.pairwise(edges)]
    return ", ".join(f"{part.mean():.1%} of {len(part)}" if len(part) else "-" for part in parts)


def main() -> None:
    """Print the errors."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--dropouts", action="store_true", help="fly, and print the drop-outs")
    parser.add_argument("--jitter", type=float, nargs="*", default=[SightErrors.jitter_px])
    parser.add_argument("--profile", default="lab")
    parser.add_argument("--views", type=int, default=60, help="in each scene")
    parser.add_argument("--scenes", nargs="+", default=VALIDATION_SCENES)
    parser.add_argument("--network", default=SHIPPED_UNET, help="any, unet, or an ONNX file")
    given = parser.parse_args()
    if not given.dropouts:
        if (file := segmentation_file(given.network)) is None:
            parser.error("--network: expected any, unet, or an ONNX file")
        compare_ranges(given, file)
        return
    for drone in ("twin", "plain"):
        logs = [DropOuts(drone, scene, given.profile) for scene in given.scenes]
        for what, samples, edges in (
            ("motion, by ground", [one for log in logs for one in log.motion], GROUND),
            ("mark, by metres", [one for log in logs for one in log.mark], RANGES_M),
        ):
            print(f"{drone}: frames without {what} {edges}: {shares(samples, edges)}")


if __name__ == "__main__":
    main()
