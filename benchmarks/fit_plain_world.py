"""Compare the errors of the drone without images with those of the twin's perception, and fit them.

    python benchmarks/fit_plain_world.py                     # the table, with today's errors
    python benchmarks/fit_plain_world.py --jitter 0 0.2 0.4  # other sizes of the jitter
    python benchmarks/fit_plain_world.py --profile harsh
    python benchmarks/fit_plain_world.py --network any --scenes ROOM/scenes/ROOM.yaml ...

Both look at the same poses, by default in the validation scenes: the twin with its images and a
network, the drone without images by ray casting. The map's own scan finds bases of obstacles and
edges of the ground. Each is compared with the border that the scan finds on the exact class map of
four times the resolution on the same bearing.
"""

from __future__ import annotations

import argparse
import itertools
import math
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from perception.mapping.contact_scan import find_bases, scan_ground
from perception.networks.weights_file import SHIPPED_UNET, segmentation_file
from perception.segmentation.runtime import load_segmenter
from sim_bridge.anafi import anafi_camera
from sim_bridge.plain.caster import Caster
from sim_bridge.plain.sight import SIZE_PX, SightErrors
from sim_bridge.twin.camera import CameraPose
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene import Scene
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.views import render_views, sample_flight_poses
from uav_bt.lab.classes import LabClasses
from uav_bt.learning.views import VALIDATION_SCENES
from uav_bt.protocols import Segmenter
from uav_bt.types import ClassMap, Frame

EXACT_PX: Final = (896, 448)
RANGES_M: Final = (0.0, 1.0, 1.5, 2.0, 3.0)
SAME_RAD: Final = math.radians(0.6)  # bearings nearer than this are one
Points = NDArray[np.float64]


def points_of(ids: NDArray[np.uint8], classes: LabClasses, frame: Frame) -> tuple[Points, Points]:
    """Return the bases of obstacles and the edges of the ground in a class map, (N, 2) m each."""
    camera = anafi_camera(640, 360).resized(*ids.shape[::-1])
    class_map = ClassMap(ids=ids, classes=classes, captured_s=frame.captured_s)
    found = find_bases(scan_ground(class_map, frame, camera))
    return found.placed_m, found.edges_m


def errors_of(seen: Points, exact: Points) -> tuple[Points, int, int]:
    """Return true range and range error by common bearing, (N, 2); points missed, false points."""
    if not len(seen) or not len(exact):
        return np.empty((0, 2)), len(exact), len(seen)
    bearings, true = np.arctan2(seen[:, 1], seen[:, 0]), np.arctan2(exact[:, 1], exact[:, 0])
    apart = np.abs(bearings[:, None] - true)
    nearest = apart.argmin(axis=1)
    same = apart[np.arange(len(seen)), nearest] < SAME_RAD
    ranges, truth = np.hypot(*seen[same].T), np.hypot(*exact[nearest[same]].T)
    missed = int(np.sum(apart.min(axis=0) >= SAME_RAD))
    return np.column_stack([truth, ranges - truth]), missed, int(np.sum(~same))


def views(
    names: Sequence[str], profile: Profile, count: int
) -> Iterator[tuple[Scene, CameraPose, Frame]]:
    """Yield poses of scenes with the images of a profile."""
    for name in names:
        scene = load_scene(name)
        poses = sample_flight_poses(scene, np.random.default_rng(11), count, lowered=0.5)
        for number, view in enumerate(render_views(scene, poses, profile=profile, seed=11)):
            frame = Frame(
                image=view.image,
                index=number,
                captured_s=0.1 * number,
                gimbal_pitch_rad=view.pose.pitch_rad,
                height_above_ground_m=view.pose.z_m,
            )
            yield scene, view.pose, frame


def row(name: str, pairs: Sequence[tuple[Points, int, int]]) -> str:
    """Return a line: median and 90 % of the absolute range error by range, and shares."""
    errors = np.concatenate([found for found, _, _ in pairs])
    cells = []
    for near, far in itertools.pairwise(RANGES_M):
        off_m = 100 * np.abs(errors[(errors[:, 0] >= near) & (errors[:, 0] < far), 1])
        cells.append("{:.1f} {:.1f}".format(*np.percentile(off_m, [50, 90])) if len(off_m) else "-")
    missed, false = (sum(pair[index] for pair in pairs) for index in (1, 2))
    total = max(len(errors) + missed, 1)
    return f"  {name}: {', '.join(cells)}; missed {missed / total:.1%}, false {false / total:.1%}"


def main() -> None:
    """Print the errors."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--jitter", type=float, nargs="*", default=[SightErrors.jitter_px])
    parser.add_argument("--profile", default="lab")
    parser.add_argument("--views", type=int, default=60, help="in each scene")
    parser.add_argument("--scenes", nargs="+", default=VALIDATION_SCENES)
    parser.add_argument("--network", default=SHIPPED_UNET, help="any, unet, or an ONNX file")
    given = parser.parse_args()
    file = segmentation_file(given.network)
    if file is None:
        parser.error("--network: expected any, unet, or an ONNX file")
    generator = np.random.default_rng(5)
    kinds = ("bases", "edges")
    found: dict[str, dict[str, list[tuple[Points, int, int]]]] = {kind: {} for kind in kinds}
    looks: dict[str, tuple[Caster, Caster, Segmenter]] = {}
    for scene, pose, frame in views(given.scenes, Profile.named(given.profile), given.views):
        classes = scene.classes
        if scene.name not in looks:
            network = load_segmenter(file, classes)
            looks[scene.name] = Caster(scene, EXACT_PX), Caster(scene, SIZE_PX), network
        fine, coarse, network = looks[scene.name]
        exact = points_of(fine.cast(pose)[0], classes, frame)
        maps = {given.network: network.segment(frame).ids}
        pitch = coarse.rays[1, 1] - coarse.rays[0, 0]
        for jitter_px in given.jitter:
            shift = generator.normal(0.0, jitter_px, coarse.rays.shape) * pitch
            name = f"without images, jitter {jitter_px:g} px"
            maps[name] = coarse.cast(pose, rays=coarse.rays + shift)[0]
        for name, ids in maps.items():
            for kind, seen, true in zip(kinds, points_of(ids, classes, frame), exact, strict=True):
                found[kind].setdefault(name, []).append(errors_of(seen, true))
    for kind in kinds:
        print(f"{kind}: median and 90 % of the absolute range error in cm between {RANGES_M} m")
        for name, pairs in found[kind].items():
            print(row(name, pairs))


if __name__ == "__main__":
    main()
