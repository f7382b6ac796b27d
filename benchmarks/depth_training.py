"""How good the depth network, its labels and its camera movements are, against the twin's truth.

python benchmarks/depth_training.py networks                        # the shipped one
python benchmarks/depth_training.py networks runs/a.onnx runs/b.onnx --scene val-a
python benchmarks/depth_training.py flight runs/a.onnx flight.npz flight.truth.npz
python benchmarks/depth_training.py labels flight.npz flight.truth.npz
python benchmarks/depth_training.py motion flight.npz flight.truth.npz
python benchmarks/depth_training.py speed --threads 2

Footage comes from `uav-bt fly explore_and_land_segmentation --footage flight.npz
--truth flight.truth.npz`.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import asdict
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera.ground_plane import ground_depth, view_of
from perception.depth.evaluation.scores import DepthSample, score_depth
from perception.depth.runtime import OnnxDepthEstimator
from perception.depth.training.clips import ClipConfig, ClipSource, DepthLabels, Flight
from perception.depth.training.labelling import (
    LABEL_SIZE_PX,
    add_parallax,
    exact_labels,
    footing_labels,
    frames_of,
)
from perception.footage.file import Footage, FootageTruth, read_footage, read_truth
from perception.networks.weights_file import SHIPPED_WEIGHTS
from perception.odometry.camera_track import camera_track, measured_motion
from perception.segmentation.runtime import shipped_unet
from uav_bt.classes import CARPET, CLASS_TO_GROUP, GROUP_NAMES, HELIPAD_BOX
from uav_bt.learning.depth import DepthViewPlan, depth_views, score_depth_on
from uav_bt.learning.scenes import VALIDATION_SCENES

_SHIPPED = SHIPPED_WEIGHTS / "depth.onnx"


def networks(paths: list[Path], scenes: tuple[str, ...], views: int) -> None:
    """Print one row a network."""
    pictures = depth_views(DepthViewPlan(scenes=scenes, views=views))
    print(f"{len(pictures.rgb)} pictures of {', '.join(scenes)}")
    for path in paths or [_SHIPPED]:
        estimator = OnnxDepthEstimator(path)
        predicted = np.stack([estimator.depth(rgb) for rgb in pictures.rgb])
        score = asdict(score_depth_on(pictures, predicted))
        print(f"{path}: " + ", ".join(f"{name} {value:.4f}" for name, value in score.items()))


def flight(path: Path, footage: Footage, truth: FootageTruth, every: int) -> None:
    """Print how far a network is from the truth on the frames of a flight, by distance."""
    estimator = OnnxDepthEstimator(path)
    exact = exact_labels(footage, truth).depth_m.astype(np.float32)
    camera = footage.camera.resized(*LABEL_SIZE_PX)
    ids = truth.ids[:, 1::2, 1::2]
    samples, rows = [], []
    for place, frame in enumerate(frames_of(footage)):
        level = view_of(frame, camera, LABEL_SIZE_PX)
        if place % every or frame.gimbal_pitch_rad < -0.8 or level.height_m < 0.8:
            continue
        ground = ground_depth(level)
        predicted = estimator.depth(frame.image)
        samples.append(
            DepthSample(predicted=predicted, truth_m=exact[place], ids=ids[place], ground_m=ground)
        )
        carpet = (ids[place] == CARPET) & np.isfinite(ground)
        if np.count_nonzero(carpet) >= 50:
            scale = np.median(ground[carpet] / predicted[carpet])
            things = ids[place] > HELIPAD_BOX
            off = scale * predicted[things] - exact[place][things]
            rows.append(np.stack([exact[place][things], off]))
    score = asdict(score_depth(samples))
    print(", ".join(f"{name} {value:.4f}" for name, value in score.items()))
    truth_m, off_m = np.concatenate(rows, axis=1)
    for nearest, furthest in ((0.3, 1.0), (1.0, 2.0), (2.0, 3.0), (3.0, 5.0)):
        within = (truth_m >= nearest) & (truth_m < furthest)
        if within.any():
            error = np.abs(off_m[within])
            print(
                f"obstacles at {nearest} to {furthest} m, carpet's scale: mean {error.mean():.3f} "
                f"m, median {np.median(error):.3f} m, signed {off_m[within].mean():.3f} m, "
                f"{within.sum()} pixels"
            )


def labels(footage: Footage, truth: FootageTruth, every: int) -> None:
    """Print how far labels are from the truth, by group and source."""
    exact = exact_labels(footage, truth).depth_m.astype(np.float32)
    by_footing = footing_labels(footage, shipped_unet())
    both = add_parallax(footage, by_footing)
    groups = CLASS_TO_GROUP[truth.ids[:, 1::2, 1::2]]
    for source, told in (
        ("footing", by_footing.depth_m),
        ("parallax, where footing is silent", _without(both, by_footing)),
    ):
        picked = slice(0, None, every)
        for group, name in enumerate(GROUP_NAMES):
            within = (groups[picked] == group) & (exact[picked] < 5.0)
            known = within & np.isfinite(told[picked])
            if not known.any():
                continue
            error = np.abs(told[picked][known] - exact[picked][known]) / exact[picked][known]
            print(
                f"{source}, {name}: {known.sum() / max(within.sum(), 1):.3f} labelled, relative "
                f"error median {np.median(error):.4f}, mean {error.mean():.4f}, "
                f"beyond a fifth {(error > 0.2).mean():.4f}"
            )


def _without(all_: DepthLabels, some: DepthLabels) -> NDArray[np.float32]:
    rest = np.where(np.isfinite(some.depth_m), np.nan, all_.depth_m)
    return np.asarray(rest, dtype=np.float32)


def motion(footage: Footage, truth: FootageTruth, pairs: int) -> None:
    """Print how well frames match when warped with exact depth and each kind of movement."""
    import torch  # noqa: PLC0415 - only this needs it

    from perception.depth.training.losses import photometric_error  # noqa: PLC0415
    from perception.depth.training.warping import warp  # noqa: PLC0415

    track = camera_track(footage)
    source = ClipSource(
        [Flight(footage=footage, labels=exact_labels(footage, truth))],
        ClipConfig(odometry=False, pitch_rad=0.0, roll_rad=0.0, flip=0.0, brightness=0.0, tint=0.0),
    )
    rng = np.random.default_rng(0)
    camera = footage.camera
    intrinsics = torch.tensor([[camera.fx_px, camera.fy_px, camera.cx_px, camera.cy_px]]).float()
    rows: list[tuple[float, float, float]] = []
    silent = 0
    while len(rows) < pairs:
        origin, target = source.draw_pair(rng)
        things = torch.from_numpy(truth.ids[origin] > 0)[None, None]
        if things.float().mean() < 0.1:
            continue
        measured = measured_motion(footage, track, origin, target)
        if measured is None:
            silent += 1
            continue
        first, second = (
            torch.from_numpy(footage.frames[place]).permute(2, 0, 1)[None].float() / 255.0
            for place in (origin, target)
        )
        depth = torch.from_numpy(truth.depth_m[origin].astype(np.float32))[None, None]
        errors = []
        for found in (np.eye(3, 4), track.motion(origin, target), measured):
            moved = torch.from_numpy(found.astype(np.float32))[None]
            warped = warp(second, depth, moved, intrinsics)
            counts = (warped.valid & things).float()
            error = photometric_error(first, warped.values)
            errors.append(float((error * counts).sum() / counts.sum().clamp(min=1.0)))
        rows.append((errors[0], errors[1], errors[2]))
    still, told, seen = np.mean(rows, axis=0)
    print(
        f"photometric error of {pairs} pairs with exact depth: not moved {still:.4f}, telemetry "
        f"{told:.4f}, measured on the carpet {seen:.4f} ({silent} pairs showed too little of it)"
    )


def speed(path: Path, threads: int, rounds: int) -> None:
    """Print milliseconds a frame, picture in and depth out."""
    estimator = OnnxDepthEstimator(path, threads=threads)
    rgb = np.random.default_rng(0).integers(0, 255, (360, 640, 3), dtype=np.uint8)
    for _ in range(10):
        estimator.depth(rgb)
    times = []
    for _ in range(rounds):
        began = time.perf_counter()
        estimator.depth(rgb)
        times.append(1e3 * (time.perf_counter() - began))
    print(
        f"{path.name}, {threads} threads: {np.median(times):.2f} ms median, {min(times):.2f} least"
    )


def main() -> None:
    """Run what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("networks", "flight", "labels", "motion", "speed"))
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--scene", action="append", default=None)
    parser.add_argument("--views", type=int, default=40)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--count", type=int, default=60)
    given = parser.parse_args()
    cv2.setNumThreads(given.threads)
    if given.what == "networks":
        networks(given.files, tuple(given.scene or VALIDATION_SCENES), given.views)
    elif given.what == "speed":
        speed(given.files[0] if given.files else _SHIPPED, given.threads, given.count)
    elif given.what == "flight":
        if len(given.files) != 3:
            parser.error("give a network, the footage and its truth")
        network, *films = given.files
        flight(network, read_footage(films[0]), read_truth(films[1]), every=10)
    elif len(given.files) != 2:
        parser.error("give the footage and its truth")
    else:
        footage, truth = read_footage(given.files[0]), read_truth(given.files[1])
        if given.what == "labels":
            labels(footage, truth, every=3)
        else:
            motion(footage, truth, given.count)


if __name__ == "__main__":
    main()
