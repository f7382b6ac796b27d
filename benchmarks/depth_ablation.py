r"""What teaches the depth network: telemetry, a pose network, labels without truth, or exact depth.

    python benchmarks/depth_training.py fly F/train-a-101.mcap --scene train-a --seed 101
    python -m benchmarks.depth_ablation F/train-?-10[12].mcap --steps 300 --run runs/ablation

Every variant begins with the same random weights and sees the same clips for equally many steps;
each is scored on images of the validation scenes. Exact depth is the upper bound: nothing else
sees the truth (`FLIGHT.truth.npz` beside the flight). Stopped, it goes on with the same command.
"""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import torch

from benchmarks.depth_training import read_truth
from perception.depth.evaluation.scores import DepthScore
from perception.depth.runtime import OnnxDepthEstimator
from perception.depth.training.clips import ClipConfig, Flight
from perception.depth.training.labelling import exact_labels
from perception.depth.training.network import DepthNetConfig
from perception.depth.training.run import DepthTrainingConfig
from perception.segmentation.runtime import shipped_unet
from uav_bt.learning.dataset import read_flights
from uav_bt.learning.training import score_depth_on, train_depth
from uav_bt.learning.views import DepthViewPlan, DepthViews, depth_views


@dataclass(frozen=True, kw_only=True)
class Variant:
    """One way to teach."""

    title: str
    labels: Literal["none", "contact", "exact"] = "none"
    pose: Literal["telemetry", "network"] = "telemetry"
    frames: bool = True  # whether neighbouring frames teach
    carpet: bool = True  # whether telemetry's movement is measured again on the carpet
    # A pose network knows no metres: the first depths must suit the movements that it begins with.
    first_depth_m: float = 2.0


VARIANTS = {
    "network": Variant(title="frames, pose network", pose="network", first_depth_m=0.2),
    "raw": Variant(title="frames, telemetry as it is", carpet=False),
    "telemetry": Variant(title="frames, telemetry and carpet"),
    "labels": Variant(title="labels by ground contact", labels="contact", frames=False),
    "both": Variant(title="labels by ground contact, frames with telemetry", labels="contact"),
    "exact": Variant(title="exact depth (upper bound)", labels="exact", frames=False),
}


def _teach(
    name: str, paths: Sequence[Path], steps: int, run: Path, views: DepthViews
) -> DepthScore:
    """Train a variant, or go on with it, and return its score."""
    variant, folder = VARIANTS[name], run / name
    folder.mkdir(parents=True, exist_ok=True)
    segmenter = shipped_unet() if variant.labels == "contact" else None
    flights = read_flights(paths, segmenter, run / "labels")
    if variant.labels == "exact":
        flights = [_exact(path, flight) for path, flight in zip(paths, flights, strict=True)]
    weight = 1.0 if variant.frames else 0.0
    config = DepthTrainingConfig(
        steps=steps,
        pose=variant.pose,
        photometric=weight,
        geometry=0.1 * weight,
        labels=0.0 if variant.labels == "none" else 1.0,
        clips=ClipConfig(odometry=variant.carpet),
        checkpoint_every=50,
    )
    weights = folder / "depth.safetensors"
    train_depth(
        flights,
        weights,
        config=config,
        net_config=DepthNetConfig(initial_depth=variant.first_depth_m),
        checkpoint=folder / "checkpoint.safetensors",
    )
    estimator = OnnxDepthEstimator(weights.with_suffix(".onnx"))
    return score_depth_on(views, np.stack([estimator.depth(rgb) for rgb in views.rgb]))


def _exact(path: Path, flight: Flight) -> Flight:
    return Flight(footage=flight.footage, labels=exact_labels(read_truth(path).depth_m))


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("flights", nargs="+", type=Path)
    parser.add_argument("--steps", type=int, default=300)
    parser.add_argument("--run", type=Path, default=Path("runs/depth_ablation"))
    parser.add_argument("--variants", nargs="+", choices=list(VARIANTS), default=list(VARIANTS))
    parser.add_argument("--threads", type=int, default=torch.get_num_threads())
    arguments = parser.parse_args()
    torch.set_num_threads(arguments.threads)
    views = depth_views(DepthViewPlan())
    print(f"{arguments.steps} steps each; {len(views.rgb)} images of the validation scenes")
    for name in arguments.variants:
        score = _teach(name, arguments.flights, arguments.steps, arguments.run, views)
        print(
            f"{VARIANTS[name].title:<42}relative error {score.abs_rel:.3f}  "
            f"obstacles {score.obstacle_error_m:.3f} m  carpet {score.carpet_error_m:.3f} m",
            flush=True,
        )


if __name__ == "__main__":
    main()
