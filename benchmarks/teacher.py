"""Time the teacher's dense inference against scikit-learn patch by patch, and compare their scores.

    python benchmarks/teacher.py --frames 5

Both see the same 1152x648 pictures in the same run. "Patch by patch" is the paper's way: every
fifth pixel, cut the patch out, make its histograms, ask the classifier. "Batched" gives
scikit-learn all patches of a picture in one call, which is the best it can do. Dense inference
answers for every pixel, 25 times as many windows.
"""

from __future__ import annotations

import argparse
import platform
import time
from collections.abc import Callable
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray
from sklearn.multiclass import OneVsRestClassifier
from sklearn.svm import LinearSVC

from perception.segmentation.features import hsv_of, patch_features
from perception.segmentation.refine import RefineConfig, refined_ids
from perception.segmentation.teacher import TeacherConfig, fit_teacher
from perception.segmentation.training.picks import PickedPatches, gather_patches
from uav_bt.learning import segmentation as training
from uav_bt.learning.scenes import VALIDATION_SCENES
from uav_bt.learning.views import ViewPlan, twin_views


def timed(work: Callable[[], object], repeats: int) -> float:
    """Return the median seconds of some work."""
    times = []
    for _ in range(repeats):
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
    return float(np.median(times))


def learn(plan: ViewPlan, config: TeacherConfig) -> PickedPatches:
    """Return what the twin's picks show."""
    picks = training.draw_twin_picks(plan, config)
    wanted = {pick.image for pick in picks}
    pictures = ((name, rgb) for name, rgb, _ in twin_views(plan) if name in wanted)
    return gather_patches(picks, pictures, config.patch_px)


def grid(width: int, height: int, step: int = 5) -> NDArray[np.int64]:
    """Return the paper's grid points, (N, 2)."""
    x, y = np.meshgrid(np.arange(step // 2, width, step), np.arange(step // 2, height, step))
    return np.stack([x.ravel(), y.ravel()], axis=1)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--frames", type=int, default=5, help="pictures the fast ways are timed on")
    parser.add_argument(
        "--patches", type=int, default=1000, help="patches whose scores are compared"
    )
    parser.add_argument(
        "--share", type=float, default=0.1, help="of the grid walked patch by patch"
    )
    arguments = parser.parse_args()

    config = TeacherConfig()
    patches = learn(ViewPlan(), config)
    teacher = fit_teacher(patches, config)
    svm = LinearSVC(C=config.cost, max_iter=config.max_iterations, random_state=0)
    model = OneVsRestClassifier(svm).fit(patches.features, patches.labels)
    plan = ViewPlan(scenes=VALIDATION_SCENES[:1], views=arguments.frames, seed=9)
    pictures = [rgb for _, rgb, _ in twin_views(plan)]

    rng = np.random.default_rng(0)
    points = np.stack(
        [
            rng.integers(config.width_px, size=arguments.patches),
            rng.integers(config.height_px, size=arguments.patches),
        ],
        axis=1,
    )
    hsv = hsv_of(pictures[0])
    expected = model.decision_function(patch_features(hsv, points, config.patch_px))
    scores = dict(teacher.scores(hsv))
    dense = np.stack([scores[c][points[:, 1], points[:, 0]] for c in model.classes_], axis=1)
    relative = np.abs(dense - expected) / np.abs(expected)

    dots = grid(config.width_px, config.height_px)
    some = rng.permutation(dots)[: max(1, int(arguments.share * len(dots)))]

    def one_by_one() -> None:
        for point in some:
            model.predict(patch_features(hsv, point[None], config.patch_px))

    walked = timed(one_by_one, 1) * len(dots) / len(some)
    batched = timed(
        lambda: model.predict(patch_features(hsv_of(pictures[0]), dots, config.patch_px)), 1
    )
    fast = {
        "dense, every pixel": teacher.window_ids,
        "dense, then the paper's dots and components": teacher.paper_ids,
        "dense, then sharp borders": lambda rgb: refined_ids(teacher, rgb, RefineConfig()),
    }
    print(f"{platform.processor() or platform.machine()}, {cv2.getNumThreads()} threads of OpenCV")
    print(
        f"scores of {arguments.patches} random patches, {len(model.classes_)} classes: largest "
        f"relative difference {relative.max():.1e}"
    )
    print(
        f"scikit-learn patch by patch, {len(dots)} patches: {walked:8.2f} s a frame "
        f"(walked {len(some)})"
    )
    print(f"scikit-learn batched:                     {batched:8.2f} s a frame")
    for name, work in fast.items():
        work(pictures[0])
        seconds = float(np.median([timed(partial(work, rgb), 1) for rgb in pictures]))
        print(
            f"{name + ':':46s}{seconds:6.3f} s a frame, {walked / seconds:6.0f} times faster than "
            f"patch by patch, {batched / seconds:4.0f} than batched"
        )


if __name__ == "__main__":
    main()
