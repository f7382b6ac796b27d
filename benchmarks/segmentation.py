"""Score a segmentation network against the twin's exact class ids.

    python -m benchmarks.segmentation                                   # the shipped U-Net
    python -m benchmarks.segmentation --lab depot --scenes "depot-val-*" --model net.onnx

The score is the intersection over union over all pixels, by class and by role. Without `--model`
the network is that of the lab, in the paper's lab the shipped U-Net. `--model` is an ONNX file with
the classes of the lab, `unet`, or the weights of a teacher (safetensors).
"""

from __future__ import annotations

import argparse
import fnmatch
import json
from collections.abc import Callable, Sequence
from pathlib import Path

from perception.networks.weights_file import SHIPPED_UNET, segmentation_file
from perception.segmentation.evaluation import SegmentationScore, score_segmentation
from perception.segmentation.runtime import OnnxSegmenter, load_segmenter, shipped_unet
from sim_bridge.twin.scene_file import load_scene, shipped_scenes
from uav_bt.errors import InputError
from uav_bt.lab.classes import LabClasses
from uav_bt.lab.lab import Lab
from uav_bt.lab.shipped import DEFAULT_LAB, load_lab
from uav_bt.learning.lab_data import MaskSource
from uav_bt.learning.pick_scores import network_of_lab
from uav_bt.learning.views import ViewPlan, twin_views
from uav_bt.protocols import Segmenter
from uav_bt.types.arrays import Image


def scenes_of(lab: Lab, pattern: str) -> tuple[str, ...]:
    """Return the scenes of a lab that match a pattern such as `test-*`, as names or files."""
    own = {name: str(file) for name, file in lab.scenes.items()}
    known = own or {name: name for name in shipped_scenes() if load_scene(name).lab == lab.name}
    found = tuple(known[name] for name in fnmatch.filter(known, pattern))
    if not found:
        names = ", ".join(known)
        raise InputError(f"no scene of the lab '{lab.name}' matches '{pattern}': {names}")
    return found


def load_network(model: str, classes: LabClasses) -> Segmenter:
    """Return the segmenter of a network by its name, `any` or `unet`, or of an ONNX file."""
    if (file := segmentation_file(model)) is None:
        raise SystemExit(f"{model} is no network: expected any, unet, or an ONNX file")
    return load_segmenter(file, classes, threads=2)


def evaluate_segmentation(
    segment: Callable[[Image], Image], plan: ViewPlan, classes: LabClasses
) -> SegmentationScore:
    """Score a segmentation, (H, W, 3) RGB to (h, w) class ids, on images of the twin."""
    return score_segmentation(((segment(rgb), ids) for _, rgb, ids in twin_views(plan)), classes)


def segmenter(model: str | None, lab: Lab) -> Callable[[Image], Image]:
    """Return the segmentation that `--model` names."""
    if model is None and not lab.network and lab.classes == load_lab().classes:
        model = SHIPPED_UNET
    if model is None:
        return network_of_lab(lab).ids
    if model == SHIPPED_UNET:
        return shipped_unet(threads=2).ids
    if model.endswith(".safetensors"):
        return MaskSource(file=Path(model), classes=lab.classes).load()
    return OnnxSegmenter(Path(model), lab.classes, threads=2).ids


def main(arguments: Sequence[str] | None = None) -> None:
    """Print the scores as JSON."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--lab", default=DEFAULT_LAB)
    parser.add_argument("--scenes", default="*test-*", help="pattern of names")
    parser.add_argument("--views", type=int, default=100, help="images of each scene")
    parser.add_argument("--model")
    given = parser.parse_args(arguments)
    lab = load_lab(given.lab)
    plan = ViewPlan(
        scenes=scenes_of(lab, given.scenes),
        views=given.views,
        size_px=(640, 360),
        seed=2,
    )
    score = evaluate_segmentation(segmenter(given.model, lab), plan, lab.classes)
    print(json.dumps(vars(given) | score.to_json(), indent=2))


if __name__ == "__main__":
    main()
