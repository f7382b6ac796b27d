"""Time perception as it flies the second level: a 640x360 frame in, everything else out.

    python benchmarks/depth_pipeline.py
    python benchmarks/depth_pipeline.py --depth footing --frames 200 --json pipeline.json
    python benchmarks/depth_pipeline.py --segmentation unet-fp32 --depth depth-fp32

Class map, relative depth, metric depth (footing and scale), corridor and helipad of every frame,
one after the other as the leaves ask for them; `whole` is their sum, frame by frame. The frames are
pictures of the twin with noise and blur, the gimbal where a mission holds it.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import platform
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np

from perception.camera.ground_plane import view_of
from perception.depth.metric import MetricDepthMaker
from perception.depth.runtime import load_depth_estimator
from perception.landing.detector import HelipadDetector, locate
from perception.obstacles.corridor import CorridorBuilder
from perception.segmentation.runtime import SHIPPED_UNETS, shipped_unet
from sim_bridge.anafi import anafi_camera
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.views import render_views, sample_flight_poses
from uav_bt.classes import CARPET
from uav_bt.learning.scenes import VALIDATION_SCENES
from uav_bt.types import PAD_HEIGHT_M, Frame

STAGES = ("segmentation", "network", "metric", "corridor", "helipad")
GIMBAL_RAD = math.radians(-28.0)
WARM_UP = 5  # frames that are not counted

Result = TypeVar("Result")


def frames(count: int) -> Iterator[Frame]:
    """Take pictures, evenly from the validation scenes, with their true telemetry."""
    each = -(-count // len(VALIDATION_SCENES))
    index = 0
    for name in VALIDATION_SCENES:
        scene = load_scene(name)
        poses = [
            replace(pose, pitch_rad=GIMBAL_RAD)
            for pose in sample_flight_poses(scene, np.random.default_rng(7), each)
        ]
        for view in render_views(scene, poses, profile=Profile.named("lab"), seed=7):
            index += 1
            yield Frame(
                image=view.image,
                index=index,
                captured_s=0.1 * index,
                gimbal_pitch_rad=GIMBAL_RAD,
                height_above_carpet_m=view.pose.z_m,
            )


class Pipeline:
    """The stages as the leaves of a mission run them, with a stop-watch."""

    def __init__(self, segmentation: str, depth: str, source: str, threads: int) -> None:
        self._camera = anafi_camera(640, 360)
        self._segmenter = shipped_unet(segmentation, threads=threads)
        footing = depth == "footing"
        self._network = None if footing else load_depth_estimator(depth, threads=threads)
        self._maker = MetricDepthMaker(
            source="footing" if footing else source, generator=np.random.default_rng(0)
        )
        self._corridor = CorridorBuilder()
        self._helipad = HelipadDetector()
        self.times_ms: dict[str, list[float]] = {stage: [] for stage in STAGES}

    def see(self, frame: Frame) -> None:
        """Run all stages on a frame."""
        class_map = self._timed("segmentation", lambda: self._segmenter.segment(frame))
        network = self._network
        relative = self._timed("network", lambda: network.estimate(frame) if network else None)
        metric = self._timed(
            "metric", lambda: self._maker.make(frame, class_map, self._camera, relative)
        )
        depth, ids = metric.depth, class_map.ids
        size = (ids.shape[1], ids.shape[0])
        self._timed(
            "corridor",
            lambda: (
                self._corridor.build(depth, view_of(frame, self._camera, size), things=ids > CARPET)
                if depth is not None
                else None
            ),
        )

        def find() -> None:
            found = self._helipad.detect(class_map)
            if found is not None:
                above_m = frame.height_above_carpet_m - PAD_HEIGHT_M
                locate(found, self._camera.resized(*size), frame.gimbal_pitch_rad, above_m)

        self._timed("helipad", find)

    def _timed(self, stage: str, work: Callable[[], Result]) -> Result:
        began = time.perf_counter()
        result = work()
        self.times_ms[stage].append(1e3 * (time.perf_counter() - began))
        return result


def measure(
    pictures: list[Frame], options: argparse.Namespace, threads: int
) -> dict[str, list[float]]:
    """Return median and 95th percentile by stage, milliseconds."""
    cv2.setNumThreads(threads)
    pipeline = Pipeline(options.segmentation, options.depth, options.source, threads)
    for frame in pictures:
        pipeline.see(frame)
    times = {stage: np.array(ms[WARM_UP:]) for stage, ms in pipeline.times_ms.items()}
    times["whole"] = np.sum(list(times.values()), axis=0)
    return {
        stage: [round(float(value), 2) for value in np.percentile(ms, [50, 95])]
        for stage, ms in times.items()
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--segmentation", default="unet", choices=SHIPPED_UNETS)
    parser.add_argument(
        "--depth", default="depth", help="'depth', 'depth-fp32', an ONNX file, or 'footing'"
    )
    parser.add_argument("--source", default="fused", choices=("fused", "network"))
    parser.add_argument("--frames", type=int, default=120)
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    if arguments.frames <= WARM_UP:
        parser.error(f"--frames must be more than {WARM_UP}, which are not counted")
    pictures = list(frames(arguments.frames))
    load = os.getloadavg()[0]
    print(f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores, load {load:.1f}")
    print(f"{len(pictures)} frames of 640x360, depth '{arguments.depth}'; median (p95), ms")
    print(f"{'threads':<9}" + "".join(f"{stage:>16}" for stage in (*STAGES, "whole")))
    results = {}
    for threads in arguments.threads:
        figures = measure(pictures, arguments, threads)
        results[str(threads)] = figures
        cells = (f"{p50:.2f} ({p95:.2f})" for p50, p95 in figures.values())
        print(f"{threads:<9}" + "".join(f"{cell:>16}" for cell in cells))
    if arguments.json is not None:
        arguments.json.write_text(json.dumps(results, indent=2) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
