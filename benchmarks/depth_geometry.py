"""Measure depth geometry against the twin's exact truth: ground plane, contact, scales, speed.

    python benchmarks/depth_geometry.py                    # exact masks
    python benchmarks/depth_geometry.py --masks unet
    python benchmarks/depth_geometry.py --network depth    # the scales of a depth network, too

On the validation scenes by default. Poses are those of flights; "standing" counts only boxes whose
lower end the image does not cut off.
"""

from __future__ import annotations

import argparse
import math
import time
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera.ground_plane import CameraView, ground_depth, level_rays, ray_lengths
from perception.depth.contact.depth import ContactDepth, contact_depth
from perception.depth.corridor import CorridorBuilder
from perception.depth.scale import AdaptiveScale, sample_carpet
from perception.segmentation.runtime import shipped_unet
from sim_bridge.anafi import anafi_camera
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.views import View, render_views, sample_flight_poses
from uav_bt.classes import BOXES, CARPET, HELIPAD_BOX, HELIPAD_H, ROOFS, is_above_ground
from uav_bt.learning.depth_tables.methods import CollectedScale
from uav_bt.types import DepthMap

SIZE = (224, 112)
CAMERA = anafi_camera(640, 360).resized(*SIZE)
NEAR_M = 5.0
ROOF_PX = 40  # of a roof; smaller ones are not counted
LACKING = 0.9  # share of a roof that contact must not know


@dataclass
class Tally:
    """Absolute errors, and of how many pixels they are known."""

    errors: list[NDArray[Any]] = field(default_factory=list)
    pixels: int = 0

    def add(self, estimate: NDArray[Any], truth: NDArray[Any], where: NDArray[np.bool_]) -> None:
        """Take in the pixels of a view."""
        error = np.abs(estimate - truth)[where]
        self.pixels += error.size
        self.errors.append(error[np.isfinite(error)])

    def row(self) -> str:
        """Return the figures of a table's row."""
        error = np.concatenate(self.errors) if self.errors else np.empty(0)
        if not error.size:
            return "nothing"
        p95 = float(np.percentile(error, 95))
        return (
            f"median {np.median(error):.4f} m  mean {error.mean():.4f} m  p95 {p95:.3f} m  "
            f"known {error.size / self.pixels:6.1%} of {self.pixels} px"
        )


class Stopwatch:
    """Wall time of the wrapped functions, by name."""

    def __init__(self) -> None:
        self.times: dict[str, list[float]] = defaultdict(list)

    def run(self, name: str, work: Callable[[], Any]) -> Any:
        """Do something and note how long it took."""
        began = time.perf_counter()
        result = work()
        self.times[name].append(1e3 * (time.perf_counter() - began))
        return result

    def show(self) -> None:
        """Print percentiles."""
        for name, times in self.times.items():
            p50, p99 = np.percentile(times[5:] or times, [50, 99])
            print(f"  {name:<22} median {p50:6.2f} ms   p99 {p99:6.2f} ms")


def drawn_views(arguments: argparse.Namespace) -> Iterator[tuple[View, CameraView]]:
    """Draw the views of all scenes."""
    size = (640, 360) if arguments.masks == "unet" or arguments.network else (320, 180)
    for name in arguments.scene:
        scene = load_scene(name)
        generator = np.random.default_rng(arguments.seed)
        poses = sample_flight_poses(scene, generator, arguments.views)
        profile = Profile.named("lab")
        for view in render_views(
            scene, poses, size_px=size, truth_size_px=SIZE, profile=profile, seed=arguments.seed
        ):
            yield (
                view,
                CameraView(camera=CAMERA, pitch_rad=view.pose.pitch_rad, height_m=view.pose.z_m),
            )


def _check_ground(view: View, seen: CameraView, generator: np.random.Generator) -> NDArray[Any]:
    """Return the distances between carpet points as drawn and as cast back."""
    places = np.flatnonzero(view.ids == CARPET)
    if places.size < 100:
        return np.empty(0)
    rows, columns = np.divmod(generator.choice(places, 100, replace=False), SIZE[0])
    error = (ground_depth(seen) - view.depth) * ray_lengths(CAMERA)
    return np.abs(error[rows, columns])


def _tally_contact(tallies: dict[str, Tally], found: ContactDepth, view: View) -> None:
    """Add a view's errors by kind of surface."""
    near, ids = view.depth < NEAR_M, view.ids
    cut = np.isin(ids, [box for box in BOXES if (ids[-1] == box).any()])
    sides = np.isin(ids, BOXES) & near
    tallies["carpet"].add(found.depth, view.depth, ids == CARPET)
    tallies["sides, standing"].add(found.depth, view.depth, sides & ~cut)
    tallies["sides, cut off"].add(found.depth, view.depth, sides & cut)
    tallies["roofs"].add(found.depth, view.depth, np.isin(ids, ROOFS) & near)
    tallies["helipad"].add(found.depth, view.depth, np.isin(ids, (HELIPAD_H, HELIPAD_BOX)) & near)


def _roof_levels(
    found: ContactDepth, metres: NDArray[Any], view: View, seen: CameraView
) -> Iterator[float]:
    """Give how far below the lens a network puts roofs without a known base, over the truth."""
    down = level_rays(seen)[2]
    for roof in ROOFS:
        where = (view.ids == roof) & (down > 0.0)
        if np.count_nonzero(where) >= ROOF_PX and np.isnan(found.depth[where]).mean() > LACKING:
            yield float(np.median((metres * down)[where]) / np.median((view.depth * down)[where]))


def _show_levels(levels: Sequence[float]) -> None:
    if levels:
        low, middle, high = np.percentile(levels, [25, 50, 75])
        print(f"{len(levels)} roofs that contact lacks, below the lens as the network has them")
        print(f"  median {middle:.3f} times the truth, half of them {low:.3f} to {high:.3f}")


def _tally_fused(
    tallies: dict[str, Tally],
    found: ContactDepth,
    *,
    both: ContactDepth,
    metres: NDArray[Any],
    truth: NDArray[Any],
    counts: NDArray[np.bool_],
) -> None:
    fused = np.minimum(np.where(np.isnan(both.depth), metres, both.depth), both.at_most)
    tallies["fused, things"].add(fused, truth, counts)
    tallies["what contact lacks, fused"].add(fused, truth, counts & np.isnan(found.depth))


def load_network(name: str) -> Any:
    """Return the depth network to measure."""
    from perception.depth.runtime import load_depth_estimator  # noqa: PLC0415 - only where asked

    return load_depth_estimator(name if name == "depth" else Path(name), threads=2)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scene", nargs="+", default=["val-a", "val-b"])
    parser.add_argument("--views", type=int, default=100, help="of each scene")
    parser.add_argument("--masks", choices=("exact", "unet"), default="exact")
    parser.add_argument("--network", help="'depth' or an ONNX file")
    parser.add_argument("--seed", type=int, default=5)
    arguments = parser.parse_args()

    unet = shipped_unet(threads=2) if arguments.masks == "unet" else None
    network = load_network(arguments.network) if arguments.network else None
    generator = np.random.default_rng(arguments.seed)
    corridors, watch = CorridorBuilder(), Stopwatch()
    contact: dict[str, Tally] = defaultdict(Tally)
    scaled: dict[str, Tally] = defaultdict(Tally)
    scales = {
        "adaptive": AdaptiveScale(),
        "constant": CollectedScale("constant"),
        "least_squares": CollectedScale("least_squares"),
    }
    points, levels = list[NDArray[Any]](), list[float]()
    for index, (view, seen) in enumerate(drawn_views(arguments)):
        ids = view.ids
        if unet is not None:
            ids = watch.run("segmentation U-Net", lambda: unet.ids(view.image))  # noqa: B023 - at once
        points.append(_check_ground(view, seen, generator))
        found = watch.run("contact", lambda: contact_depth(ids, seen))  # noqa: B023
        _tally_contact(contact, found, view)
        metric = DepthMap(depth=found.depth, metric=True, captured_s=0.0, at_most=found.at_most)
        watch.run("corridor", lambda: corridors.build(metric, seen, things=is_above_ground(ids)))  # noqa: B023
        if network is None:
            continue
        relative = watch.run("depth network", lambda: network.depth(view.image))  # noqa: B023
        fitting = cv2.resize(relative, SIZE)
        sample = watch.run(
            "scale",
            lambda: sample_carpet(fitting, ids, ground_depth(seen), generator),  # noqa: B023
        )
        counts = is_above_ground(ids) & (view.depth < NEAR_M)
        metres = np.full_like(fitting, math.nan)
        for name, scale in scales.items():
            # Views are not a flight: each stands ten seconds from the next, so nothing is smoothed.
            fitted = scale.update(sample, 10.0 * index)
            applied = np.full_like(fitting, math.nan) if fitted is None else fitted.apply(fitting)
            metres = applied if name == "adaptive" else metres
            scaled[f"{name}, things"].add(applied, view.depth, counts)
            scaled[f"{name}, carpet"].add(applied, view.depth, view.ids == CARPET)
        if np.isnan(metres).all():
            continue
        both = watch.run(
            "contact and network",
            lambda: contact_depth(ids, seen, network_m=metres),  # noqa: B023
        )
        levels.extend(_roof_levels(found, metres, view, seen))
        _tally_fused(scaled, found, both=both, metres=metres, truth=view.depth, counts=counts)

    error = np.concatenate(points)
    print(f"{', '.join(arguments.scene)}; {arguments.views} views each; {arguments.masks} masks")
    print(f"carpet points cast back: {error.size}, worst {1e3 * error.max():.3f} mm")
    for title, tallies in (("contact", contact), ("network times scale", scaled)):
        if tallies:
            print(title)
        for name, tally in tallies.items():
            print(f"  {name:<30} {tally.row()}")
    _show_levels(levels)
    print("speed")
    watch.show()


if __name__ == "__main__":
    main()
