"""What 8-bit integers cost: each shipped network against itself in floats, on validation views.

    python benchmarks/integers.py

Of depth the relative difference, of the U-Net the share of equal classes, of the student how far
its predictions lie apart and how often it would turn where it went on.
"""

from __future__ import annotations

import numpy as np

from perception.control.ego_state import state_size
from perception.control.runtime import OnnxControlStudent
from perception.depth.runtime import OnnxDepthEstimator
from perception.networks.weights_file import SHIPPED_WEIGHTS
from perception.segmentation.runtime import OnnxSegmenter
from uav_bt.learning.views import VALIDATION_SCENES, ViewPlan, twin_views

VIEWS = ViewPlan(
    scenes=VALIDATION_SCENES, views=40, size_px=(640, 360), truth_size_px=(32, 18), seed=5
)


def main() -> None:
    """Print a line for each network."""
    images = [rgb for _, rgb, _ in twin_views(VIEWS)]
    names = ("", "-fp32")

    depths = [OnnxDepthEstimator(SHIPPED_WEIGHTS / f"depth{name}.onnx") for name in names]
    integers, floats = (np.stack([net.depth(rgb) for rgb in images]) for net in depths)
    off = np.abs(integers / floats - 1.0)
    print(
        f"depth: off by {np.median(off):.2%} (median), {off.mean():.2%} (mean), "
        f"{np.quantile(off, 0.99):.2%} (99 %)"
    )

    unets = [OnnxSegmenter(SHIPPED_WEIGHTS / f"unet{name}.onnx") for name in names]
    integers, floats = (np.stack([net.ids(rgb) for rgb in images]) for net in unets)
    same = (integers == floats).mean(axis=(1, 2))
    print(f"U-Net: the same class on {same.mean():.3%} of the pixels, {same.min():.3%} (worst)")

    students = [OnnxControlStudent(SHIPPED_WEIGHTS / f"student{name}.onnx") for name in names]
    state = np.zeros(state_size(students[0].config.views), dtype=np.float32)
    advance, step_m = [], []
    for at in range(len(images)):
        views = [images[(at + k) % len(images)] for k in range(students[0].config.views)]
        small = [students[0].preprocess(rgb) for rgb in views]
        answers = [net.estimate(small, state) for net in students]
        advance.append([answer.advance for answer in answers])
        step_m.append([answer.step_m for answer in answers])
    goes = np.array(advance) > 0.5
    print(
        f"student: advance {np.ptp(advance, axis=1).mean():.4f} and step "
        f"{np.ptp(step_m, axis=1).mean():.4f} m apart (mean), another decision on "
        f"{(goes[:, 0] != goes[:, 1]).sum()} of {len(images)} views"
    )


if __name__ == "__main__":
    main()
