"""Time networks and perception as they fly, and the teacher.

    python benchmarks/timing.py segmenter --model unet --model runs/floats.onnx
    python benchmarks/timing.py student --model runs/student.onnx
    python benchmarks/timing.py pipeline --segmentation runs/floats.onnx --depth contact
    python benchmarks/timing.py teacher --share 0.004 --count 2

Contestants take turns, so that other work on the machine slows all of them. The processor's own
time, which other work does not stretch, is that of all threads. `segmenter` and `student` see
640x360 frames of noise: resizing, inference and decoding are in the time. `pipeline` is the second
level's perception on 640x360 frames of the twin with noise and blur, stage by stage. `teacher`
compares dense inference with scikit-learn patch by patch (the paper: every fifth pixel) on the same
1152x648 images.
"""

from __future__ import annotations

import argparse
import math
import os
import platform
import resource
import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import onnx
from numpy.typing import NDArray
from sklearn.multiclass import OneVsRestClassifier
from sklearn.svm import LinearSVC

from benchmarks.lab_views import draw_twin_picks
from perception.control.ego_state import state_size
from perception.control.runtime import SHIPPED_STUDENT, OnnxControlStudent
from perception.depth.runtime import load_depth_estimator
from perception.networks.named import SHIPPED_UNET, segmentation_file
from perception.segmentation.clean import RefineConfig
from perception.segmentation.features import hsv_of, patch_features
from perception.segmentation.runtime import OnnxSegmenter
from perception.segmentation.teacher import TeacherConfig, fit_teacher
from perception.segmentation.training.picks import gather_patches
from sim_bridge.anafi import anafi_camera
from sim_bridge.twin.profile import Profile
from sim_bridge.twin.scene_file import load_scene
from sim_bridge.twin.views import render_views, sample_flight_poses
from uav_bt.app.perceive.pipeline import STAGES, Pipeline
from uav_bt.errors import UnknownNameError
from uav_bt.lab.shipped import load_lab
from uav_bt.learning.views import VALIDATION_SCENES, ViewPlan, twin_views
from uav_bt.types import Frame

WARM_UP = 10  # turns that are not counted
GIMBAL_RAD = math.radians(-28.0)  # where a mission holds it
Options = argparse.Namespace


def _in_turns(
    work: Mapping[str, Callable[[int], object]], count: int
) -> dict[str, NDArray[np.float64]]:
    """Run contestants in turns; return wall and processor time of each, (2, count) milliseconds."""
    taken: dict[str, list[tuple[float, float]]] = {name: [] for name in work}
    for index in range(WARM_UP + count):
        for name, run in work.items():
            began = time.perf_counter(), time.process_time()
            run(index)
            taken[name].append((time.perf_counter() - began[0], time.process_time() - began[1]))
    return {name: 1e3 * np.array(rows[WARM_UP:]).T for name, rows in taken.items()}


def memory_mib() -> float:
    """Return the peak memory of this process."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def noise() -> NDArray[np.uint8]:
    """Return eight 640x360 frames."""
    return np.random.default_rng(0).integers(256, size=(8, 360, 640, 3), dtype=np.uint8)


# --- networks -------------------------------------------------------------------------------------


def segmenter_of(model: str, threads: int) -> OnnxSegmenter:
    """Return the shipped U-Net by its name, or a network with its classes from an ONNX file."""
    path = segmentation_file(model)
    if path is None:
        raise UnknownNameError("network to time", model, (SHIPPED_UNET, "FILE.onnx"))
    return OnnxSegmenter(path, load_lab().classes, threads=threads)


def segmenter(given: Options) -> None:
    """Print a line a network and number of threads."""
    frames = noise()

    def contestant(name: str, threads: int) -> Callable[[int], object]:
        net = segmenter_of(name, threads)
        return lambda index: net.ids(frames[index % len(frames)])

    for threads in given.threads:
        cv2.setNumThreads(threads)
        nets = {name: contestant(name, threads) for name in given.model or [SHIPPED_UNET]}
        for name, (wall, processor) in _in_turns(nets, given.count or 300).items():
            p50, p99 = np.percentile(wall, [50, 99])
            print(
                f"{name}, {threads} thread(s): median {p50:.1f} ms, p99 {p99:.1f} ms, processor "
                f"{np.median(processor):.1f} ms"
            )
    print(f"peak memory of this process {memory_mib():.0f} MiB")


def multiplications(path: Path) -> int:
    """Return how many products of convolutions and dense layers one decision takes."""
    graph = onnx.shape_inference.infer_shapes(onnx.load(path)).graph
    shapes = {
        value.name: tuple(size.dim_value for size in value.type.tensor_type.shape.dim)
        for value in (*graph.input, *graph.value_info, *graph.output)
    }
    shapes |= {constant.name: tuple(constant.dims) for constant in graph.initializer}
    total = 0
    for node in graph.node:
        if node.op_type == "Conv":
            total += math.prod(shapes[node.output[0]]) * math.prod(shapes[node.input[1]][1:])
        elif node.op_type == "Gemm":
            total += shapes[node.output[0]][0] * math.prod(shapes[node.input[1]])
    return total


def parameters(path: Path) -> int:
    """Return how many numbers the network learnt, its batch norms folded in."""
    arrays = (constant for constant in onnx.load(path).graph.initializer)
    kinds = (onnx.TensorProto.FLOAT, onnx.TensorProto.INT8)
    return sum(math.prod(one.dims) for one in arrays if one.data_type in kinds and one.dims)


def student(given: Options) -> None:
    """Print a table: a decision on a new frame, size, and memory that the first one took."""
    frames = noise()

    def contestant(path: Path, threads: int) -> tuple[Callable[[int], object], float]:
        before = memory_mib()
        net = OnnxControlStudent(path, threads=threads)
        numbers = np.zeros(state_size(net.config.views), dtype=np.float32)
        views = [net.preprocess(frame) for frame in frames[: net.config.views]]

        def decide(index: int) -> None:
            views[:] = [net.preprocess(frames[index % len(frames)]), *views[:-1]]
            net.estimate(views, numbers)

        decide(0)
        return decide, memory_mib() - before

    print("| network | parameters | MB | million products | threads | ms, median | p99 |", end="")
    print(" processor ms | MiB more |\n|---|---|---|---|---|---|---|---|---|")
    for threads in given.threads:
        cv2.setNumThreads(threads)
        paths = [Path(name) for name in given.model or [SHIPPED_STUDENT]]
        made = {str(path): contestant(path, threads) for path in paths}
        times = _in_turns({name: run for name, (run, _) in made.items()}, given.count or 300)
        for path in paths:
            wall, processor = times[str(path)]
            p50, p99 = np.percentile(wall, [50, 99])
            print(
                f"| {path.stem} | {parameters(path):,} | {path.stat().st_size / 1e6:.2f} | "
                f"{multiplications(path) / 1e6:.0f} | {threads} | {p50:.1f} | {p99:.1f} | "
                f"{np.median(processor):.1f} | {made[str(path)][1]:.0f} |"
            )


def pipeline(given: Options) -> None:
    """Print a row a number of threads: median and 95th percentile by stage, milliseconds."""
    frames = []
    for name in VALIDATION_SCENES:
        scene = load_scene(name)
        each = -(-(given.count or 120) // len(VALIDATION_SCENES))
        poses = [
            replace(pose, pitch_rad=GIMBAL_RAD)
            for pose in sample_flight_poses(scene, np.random.default_rng(7), each)
        ]
        for view in render_views(scene, poses, profile=Profile.named("lab"), seed=7):
            number = len(frames) + 1
            frames.append(
                Frame(
                    image=view.image,
                    index=number,
                    captured_s=0.1 * number,
                    gimbal_pitch_rad=GIMBAL_RAD,
                    height_above_ground_m=view.pose.z_m,
                )
            )
    print(f"{len(frames)} frames of 640x360, depth '{given.depth}'; median (p95), ms")
    print(f"{'threads':<9}" + "".join(f"{stage:>16}" for stage in (*STAGES, "whole")))
    for threads in given.threads:
        cv2.setNumThreads(threads)
        none = given.depth == "contact"
        perception = Pipeline(
            segmenter_of(given.segmentation, threads),
            None if none else load_depth_estimator(given.depth, threads=threads),
            anafi_camera(640, 360),
            generator=np.random.default_rng(0),
        )
        spent = [perception.perceive(frame).stage_s for frame in frames][WARM_UP:]
        times = np.array([[1e3 * row.get(stage, 0.0) for stage in STAGES] for row in spent])
        whole = np.column_stack([times, times.sum(axis=1)])
        cells = (f"{p50:.2f} ({p95:.2f})" for p50, p95 in np.percentile(whole, [50, 95], axis=0).T)
        print(f"{threads:<9}" + "".join(f"{cell:>16}" for cell in cells))


# --- the teacher ----------------------------------------------------------------------------------


def seconds(work: Callable[[], object]) -> float:
    """Return how long some work takes."""
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


def teacher(given: Options) -> None:
    """Print how much faster dense inference is, and how far its scores are off."""
    config, plan = TeacherConfig(), ViewPlan()
    picks = draw_twin_picks(plan, config)
    wanted = {pick.image for pick in picks}
    shown = ((name, rgb) for name, rgb, _ in twin_views(plan) if name in wanted)
    patches = gather_patches(picks, shown, config.patch_px, load_lab().classes)
    fast = fit_teacher(patches, config)
    svm = LinearSVC(C=config.cost, max_iter=config.max_iterations, random_state=0)
    model = OneVsRestClassifier(svm).fit(patches.features, patches.labels)
    views = ViewPlan(scenes=VALIDATION_SCENES[:1], views=given.count or 5, seed=9)
    images = [rgb for _, rgb, _ in twin_views(views)]

    rng = np.random.default_rng(0)
    x, y = rng.integers(config.width_px, size=1000), rng.integers(config.height_px, size=1000)
    hsv = hsv_of(images[0])
    expected = model.decision_function(
        patch_features(hsv, np.stack([x, y], axis=1), config.patch_px)
    )
    scores = dict(fast.scores(hsv))
    dense = np.stack([scores[one][y, x] for one in model.classes_], axis=1)
    off = (np.abs(dense - expected) / np.abs(expected)).max()
    print(f"scores of {len(x)} random patches: largest relative difference {off:.1e}")

    grid = np.meshgrid(np.arange(2, config.width_px, 5), np.arange(2, config.height_px, 5))
    dots = np.stack([axis.ravel() for axis in grid], axis=1)
    some = rng.permutation(dots)[: max(1, int(given.share * len(dots)))]

    def predict(points: NDArray[np.int64], rgb: NDArray[np.uint8]) -> None:
        model.predict(patch_features(rgb, points, config.patch_px))

    walked = sum(seconds(partial(predict, dot[None], hsv)) for dot in some) * len(dots) / len(some)
    batched = seconds(lambda: predict(dots, hsv_of(images[0])))
    print(
        f"scikit-learn, {len(dots)} patches one by one (walked {len(some)}): {walked:.2f} s a frame"
    )
    print(f"scikit-learn, all patches in one call: {batched:.2f} s a frame")
    for name, work in {
        "dense, every pixel": fast.window_ids,
        "dense, then the paper's dots and components": fast.paper_ids,
        "dense, then sharp borders": lambda rgb: fast.refined_ids(rgb, RefineConfig()),
    }.items():
        work(images[0])
        took = float(np.median([seconds(partial(work, rgb)) for rgb in images]))
        print(
            f"{name + ':':46s}{took:6.3f} s a frame, {walked / took:6.0f} times faster than patch "
            f"by patch, {batched / took:4.0f} than batched"
        )


TIMED = {
    "segmenter": segmenter,
    "student": student,
    "pipeline": pipeline,
    "teacher": teacher,
}


def main() -> None:
    """Read the command line and measure."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=TIMED)
    parser.add_argument("--model", action="append", help="'unet' or an ONNX file")
    parser.add_argument("--count", type=int, help="frames, decisions or images that are timed")
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--segmentation", default=SHIPPED_UNET, help="'unet' or an ONNX file")
    parser.add_argument("--depth", default="depth", help="a shipped one, an ONNX file, 'contact'")
    parser.add_argument("--share", type=float, default=0.1, help="of the grid, patch by patch")
    given = parser.parse_args()
    name = platform.processor() or platform.machine()
    print(f"{name}, {os.cpu_count()} cores, load {os.getloadavg()[0]:.1f}")
    TIMED[given.what](given)


if __name__ == "__main__":
    main()
