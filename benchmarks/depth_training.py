"""How good the depth network, its labels and its camera movements are, against the twin's truth.

python benchmarks/depth_training.py fly flights/train-a-101.mcap --scene train-a --seed 101
python benchmarks/depth_training.py networks                        # the shipped one
python benchmarks/depth_training.py networks runs/a.onnx runs/b.onnx --scene val-a
python benchmarks/depth_training.py flight runs/a.onnx flights/train-a-101.mcap
python benchmarks/depth_training.py labels flights/train-a-101.mcap
python benchmarks/depth_training.py motion flights/train-a-101.mcap

`fly` writes the flight's record and, beside it, the truth: exact depth and ids of its frames.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import cast

import cv2
import numpy as np
import torch
from numpy.typing import NDArray

from perception.camera.ground_plane import ground_depth, view_of
from perception.depth.evaluation.scores import DepthSample, score_depth
from perception.depth.runtime import OnnxDepthEstimator
from perception.depth.training.clips import ClipConfig, ClipSource, DepthLabels, Flight
from perception.depth.training.labelling import (
    LABEL_SIZE_PX,
    add_parallax,
    contact_labels,
    exact_labels,
    frames_of,
)
from perception.depth.training.losses import photometric_error, warp
from perception.networks.weights_file import SHIPPED_WEIGHTS
from perception.odometry.camera_track import FOOTAGE_SIZE_PX, Footage, camera_track, measured_motion
from perception.segmentation.runtime import shipped_unet
from uav_bt import app
from uav_bt.classes import CARPET, CLASS_TO_GROUP, GROUP_NAMES, HELIPAD_BOX
from uav_bt.learning.dataset import footage_of
from uav_bt.learning.training import score_depth_on
from uav_bt.learning.views import VALIDATION_SCENES, DepthViewPlan, depth_views
from uav_bt.mission.tick import TickListener, TickRecord
from uav_bt.protocols import Drone, Referee

_SHIPPED = SHIPPED_WEIGHTS / "depth.onnx"


@dataclass(frozen=True)
class Truth:
    """What the simulator knows about the frames of a footage."""

    depth_m: NDArray[np.float16]  # (N, 256, 320) along the optical axis; 2 mm fine at 4 m
    ids: NDArray[np.uint8]  # (N, 256, 320)


class _TruthKeeper:
    """A tick listener that keeps exact depth and ids of every frame."""

    def __init__(self) -> None:
        self.kept: dict[int, tuple[NDArray[np.float16], NDArray[np.uint8]]] = {}  # by frame number

    def __call__(self, flight: app.Flight[Drone]) -> Sequence[TickListener]:
        self._referee = cast("Referee", flight.drone.referee)  # the twin has one
        return [self]

    def on_tick(self, record: TickRecord) -> None:
        frame = record.observation.frame
        if frame is not None and frame.index not in self.kept:
            depth = self._referee.depth(frame, *FOOTAGE_SIZE_PX).astype(np.float16)
            self.kept[frame.index] = depth, self._referee.class_ids(frame, *FOOTAGE_SIZE_PX)


def fly(path: Path, scene: str, seed: int) -> None:
    """Fly a mission; keep its record, and exact depth and ids of its footage's frames."""
    keeper = _TruthKeeper()
    path.parent.mkdir(parents=True, exist_ok=True)
    options = app.FlightOptions(scene=scene, seed=seed, record=path)
    flown = app.fly("explore_and_land_segmentation", options, listeners=[keeper])
    depth, ids = zip(*(keeper.kept[int(at)] for at in footage_of(path).index), strict=True)
    np.savez_compressed(truth_path(path), depth_m=np.stack(depth), ids=np.stack(ids))
    print(f"{flown.outcome}: {path} and {truth_path(path)}")


def truth_path(record: Path) -> Path:
    """Return where the truth about a record's frames is kept."""
    return record.with_suffix(".truth.npz")


def read_truth(record: Path) -> Truth:
    """Read the truth about a record's frames."""
    with np.load(truth_path(record), allow_pickle=False) as arrays:
        return Truth(depth_m=arrays["depth_m"], ids=arrays["ids"])


def networks(paths: list[Path], scenes: tuple[str, ...], views: int) -> None:
    """Print one row a network."""
    images = depth_views(DepthViewPlan(scenes=scenes, views=views))
    print(f"{len(images.rgb)} images of {', '.join(scenes)}")
    for path in paths or [_SHIPPED]:
        estimator = OnnxDepthEstimator(path)
        predicted = np.stack([estimator.depth(rgb) for rgb in images.rgb])
        score = asdict(score_depth_on(images, predicted))
        print(f"{path}: " + ", ".join(f"{name} {value:.4f}" for name, value in score.items()))


def flight(path: Path, footage: Footage, truth: Truth, every: int) -> None:
    """Print how far a network is from the truth on the frames of a flight, by distance."""
    estimator = OnnxDepthEstimator(path)
    exact = exact_labels(truth.depth_m).depth_m.astype(np.float32)
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


def labels(footage: Footage, truth: Truth, every: int) -> None:
    """Print how far labels are from the truth, by group and source."""
    exact = exact_labels(truth.depth_m).depth_m.astype(np.float32)
    by_contact = contact_labels(footage, shipped_unet())
    both = add_parallax(footage, by_contact)
    groups = CLASS_TO_GROUP[truth.ids[:, 1::2, 1::2]]
    for source, depth_m in (
        ("contact", by_contact.depth_m),
        ("parallax, where contact is silent", _without(both, by_contact)),
    ):
        picked = slice(0, None, every)
        for group, name in enumerate(GROUP_NAMES):
            within = (groups[picked] == group) & (exact[picked] < 5.0)
            known = within & np.isfinite(depth_m[picked])
            if not known.any():
                continue
            error = np.abs(depth_m[picked][known] - exact[picked][known]) / exact[picked][known]
            print(
                f"{source}, {name}: {known.sum() / max(within.sum(), 1):.3f} labelled, relative "
                f"error median {np.median(error):.4f}, mean {error.mean():.4f}, "
                f"beyond a fifth {(error > 0.2).mean():.4f}"
            )


def _without(all_: DepthLabels, some: DepthLabels) -> NDArray[np.float32]:
    rest = np.where(np.isfinite(some.depth_m), np.nan, all_.depth_m)
    return np.asarray(rest, dtype=np.float32)


def _motion(footage: Footage, truth: Truth, pairs: int) -> None:
    """Print how well frames match when warped with exact depth and each kind of movement."""
    track = camera_track(footage)
    source = ClipSource(
        [Flight(footage=footage, labels=exact_labels(truth.depth_m))],
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
    still, telemetry, seen = np.mean(rows, axis=0)
    print(
        f"photometric error of {pairs} pairs with exact depth: not moved {still:.4f}, telemetry "
        f"{telemetry:.4f}, measured on the carpet {seen:.4f} "
        f"({silent} pairs showed too little of it)"
    )


def main() -> None:
    """Run the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("fly", "networks", "flight", "labels", "motion"))
    parser.add_argument("files", nargs="*", type=Path)
    parser.add_argument("--scene", action="append", default=None)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--views", type=int, default=40)
    parser.add_argument("--threads", type=int, default=2)
    parser.add_argument("--count", type=int, default=60)
    given = parser.parse_args()
    cv2.setNumThreads(given.threads)
    if given.what == "networks":
        networks(given.files, tuple(given.scene or VALIDATION_SCENES), given.views)
        return
    if len(given.files) != (2 if given.what == "flight" else 1):
        parser.error("give the flight's record, and before it a network for `flight`")
    record = given.files[-1]
    if given.what == "fly":
        fly(record, (given.scene or ["train-a"])[0], given.seed)
        return
    footage, truth = footage_of(record), read_truth(record)
    if given.what == "flight":
        flight(given.files[0], footage, truth, every=10)
    elif given.what == "labels":
        labels(footage, truth, every=3)
    else:
        _motion(footage, truth, given.count)


if __name__ == "__main__":
    main()
