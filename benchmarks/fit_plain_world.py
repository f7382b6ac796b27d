"""Compare the errors of the drone without images with those of the twin's perception, and fit them.

    python -m benchmarks.fit_plain_world --jitter 0 0.2 0.4
    python -m benchmarks.fit_plain_world --network any --scenes ROOM/scenes/ROOM.yaml ...

Bases of obstacles and edges of the ground are compared, bearing by bearing, with those in an exact
class map of four times the resolution.
"""

from __future__ import annotations

import argparse
import math
from collections import defaultdict
from typing import Final

import numpy as np

from benchmarks.lab_views import frame_of
from benchmarks.segmentation import load_network
from perception.mapping.contact_scan import find_bases, scan_ground
from perception.networks.weights_file import SHIPPED_UNET
from sim_bridge.anafi import anafi_camera
from sim_bridge.plain.caster import Caster
from sim_bridge.plain.sight import SIZE_PX, SightErrors
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.views import render_views, sample_flight_poses
from uav_bt.learning.views import VALIDATION_SCENES
from uav_bt.types import ClassMap
from uav_bt.types.arrays import Floats

EXACT_PX: Final = (896, 448)
ENDS_M: Final = (1.0, 1.5, 2.0, 3.0, math.inf)  # of bands of ranges
SAME_RAD: Final = math.radians(0.6)  # bearings nearer than this are one
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
    bands = np.digitize(errors[:, 0], ENDS_M)
    for band in np.unique(bands):
        middle, most = 100 * np.percentile(np.abs(errors[bands == band, 1]), [50, 90])
        cells.append(f"to {ENDS_M[band]} m {middle:.1f} {most:.1f}")
    missed, false = (sum(pair[index] for pair in pairs) for index in (1, 2))
    total = max(len(errors) + missed, 1)
    return f"{', '.join(cells)}; missed {missed / total:.1%}, false {false / total:.1%}"


def main() -> None:
    """Print the errors of the twin's ranges, and of those without images by jitter."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--jitter", type=float, nargs="*", default=[SightErrors.jitter_px])
    parser.add_argument("--views", type=int, default=60, help="in each scene")
    parser.add_argument("--scenes", nargs="+", default=VALIDATION_SCENES)
    parser.add_argument("--network", default=SHIPPED_UNET, help="any, unet, or an ONNX file")
    given = parser.parse_args()
    found: defaultdict[str, list[Compared]] = defaultdict(list)
    generator, profile = np.random.default_rng(5), Profile.named("lab")
    for scene in map(load_scene, given.scenes):
        segmenter = load_network(given.network, scene.classes)
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
                lens = anafi_camera(640, 360).resized(*ids.shape[::-1])
                bases[name] = find_bases(scan_ground(seen, frame, lens))
            exact = bases.pop("exact")
            for name, contacts in bases.items():
                found[f"bases, {name}"].append(errors_of(contacts.placed.xy_m, exact.placed.xy_m))
                found[f"edges, {name}"].append(errors_of(contacts.edges_m, exact.edges_m))
    print("median and 90 % of the absolute range error in cm")
    print("\n".join(f"  {name}: {row(found[name])}" for name in sorted(found)))


if __name__ == "__main__":
    main()
