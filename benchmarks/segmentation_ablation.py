"""The paper's two ablations of the first level, in small.

    python benchmarks/segmentation_ablation.py scenes
    python benchmarks/segmentation_ablation.py losses --masks runs/segmentation/masks-0123456789ab

`scenes` trains teachers on the points of the first one, two, three and four training scenes and
scores each: windows alone, as the paper has it (dots, dilation, largest components), and with sharp
borders. `losses` trains the U-Net with each loss for equally many steps on the masks that
`uav-bt net train segmentation` left in its run folder.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from perception.segmentation.clean import RefineConfig
from perception.segmentation.evaluation import score_segmentation
from perception.segmentation.runtime import OnnxSegmenter
from perception.segmentation.teacher import TeacherConfig
from perception.segmentation.training.run import LOSSES, TrainingConfig
from uav_bt.learning.teacher import draw_twin_picks, train_teacher
from uav_bt.learning.training import train_segmentation
from uav_bt.learning.views import TESTING_SCENES, Image, ViewPlan, twin_views


def ablate_scenes(arguments: argparse.Namespace) -> None:
    """Print the scores of teachers that learnt from more and more scenes."""
    config, plan = TeacherConfig(), ViewPlan()
    picks = draw_twin_picks(plan, config)
    exam = ViewPlan(scenes=tuple(arguments.on), views=arguments.views, seed=2)
    views = [(rgb, ids) for _, rgb, ids in twin_views(exam)]
    heads = f"{'scenes':>6s} {'points':>6s} {'classes':>7s} {'method':>14s}"
    print(f"{heads} {'mIoU 17':>8s} {'mIoU 4':>7s}")
    for count in range(1, len(plan.scenes) + 1):
        scenes = plan.scenes[:count]
        mine = [pick for pick in picks if pick.image.startswith(scenes)]
        few = ViewPlan(scenes=scenes)
        teacher = train_teacher(mine, few, config)
        methods: dict[str, Callable[[Image], Image]] = {
            "windows": teacher.window_ids,
            "paper": teacher.paper_ids,
            "sharp borders": lambda rgb, t=teacher: t.refined_ids(rgb, RefineConfig()),
        }
        for name, method in methods.items():
            score = score_segmentation((method(rgb), ids) for rgb, ids in views)
            print(
                f"{count:6d} {len(mine):6d} {len(teacher.known):7d} {name:>14s} "
                f"{score.miou:8.4f} {score.group_miou:7.4f}",
                flush=True,
            )


def ablate_losses(arguments: argparse.Namespace) -> None:
    """Print the scores of U-Nets that learnt with different losses."""
    parts = [np.load(file, allow_pickle=False) for file in sorted(arguments.masks.glob("*.npz"))]
    images = tuple(np.concatenate([part[key] for part in parts]) for key in ("rgb", "ids"))
    exam = ViewPlan(
        scenes=tuple(arguments.on),
        views=arguments.views,
        size_px=(640, 360),
        truth_size_px=(224, 112),
        seed=2,
    )
    views = [(rgb, ids) for _, rgb, ids in twin_views(exam)]
    print(f"{len(images[0])} masks, {arguments.steps} steps of {arguments.batch}")
    for loss in LOSSES:
        with tempfile.TemporaryDirectory() as folder:
            weights = Path(folder) / "unet.safetensors"
            config = TrainingConfig(steps=arguments.steps, batch=arguments.batch, loss=loss)
            train_segmentation(images, weights, config=config)
            net = OnnxSegmenter(weights.with_suffix(".onnx"))
            score = score_segmentation((net.ids(rgb), ids) for rgb, ids in views)
        print(f"{loss:>14s} mIoU 17 {score.miou:.4f}  mIoU 4 {score.group_miou:.4f}", flush=True)


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("which", choices=["scenes", "losses"])
    parser.add_argument("--on", nargs="+", default=list(TESTING_SCENES))
    parser.add_argument("--views", type=int, default=50, help="images a scene to score on")
    parser.add_argument("--masks", type=Path, help="folder of the teacher's masks, for losses")
    parser.add_argument("--steps", type=int, default=800)
    parser.add_argument("--batch", type=int, default=8)
    arguments = parser.parse_args()
    if arguments.which == "losses" and arguments.masks is None:
        parser.error("losses needs --masks")
    (ablate_scenes if arguments.which == "scenes" else ablate_losses)(arguments)


if __name__ == "__main__":
    main()
