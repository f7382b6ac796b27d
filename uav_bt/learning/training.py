"""Files and export of depth network and control student. Needs the extra `train`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from perception.control.training.network import STUDENT_FILES
from perception.depth.training.network import DEPTH_FILES
from perception.networks.training.loop import LoopConfig, Progress
from perception.networks.training.network_files import NetworkFiles
from perception.segmentation.training.unet import UNET_FILES
from uav_bt.errors import WeightsError
from uav_bt.learning.views import ViewPlan, twin_views
from uav_bt.protocols import Advance, silent
from uav_bt.types.arrays import Image

Network = Literal["depth", "student"]
Precision = Literal["int8", "fp32"]

CALIBRATION_VIEWS: Final = ViewPlan(
    views=50, size_px=(640, 360), lowered=0.25, truth_size_px=(32, 18), seed=5
)
"""Images for the calibration: 200 images of the training scenes."""


def shown(advance: Advance) -> Callable[[Progress, object], None]:
    """Return a function that shows the progress of a training."""
    return lambda now, _net: advance(f"training, loss {now.loss:.3f}", now.step, now.steps)


def save_trained(
    files: NetworkFiles[Any], net: Any, weights: Path, config: LoopConfig, notes: Mapping[str, Any]
) -> None:
    """Write the safetensors file of a network with notes about its training, and its ONNX file."""
    files.save(weights, net, notes={"training": asdict(config), **notes})
    files.export(weights, weights.with_suffix(".onnx"))


def first_weights(path: Path) -> Mapping[str, NDArray[np.float32]]:
    """Return the weights of a control student, or of a segmentation U-Net's encoder."""
    try:
        state = STUDENT_FILES.load(path)[0].state_dict()
    except WeightsError as no_student:
        try:
            unet = UNET_FILES.load(path)[0].state_dict()
        except WeightsError:
            raise no_student from None
        state = {name: value for name, value in unet.items() if name.startswith("down.")}
    return {name: value.numpy() for name, value in state.items()}


def export_network(
    network: Network,
    weights: Path,
    out: Path,
    *,
    precision: Precision = "int8",
    views: ViewPlan = CALIBRATION_VIEWS,
    advance: Advance = silent,
) -> None:
    """Write the ONNX file of a network: with floats, or 8-bit integers calibrated on images."""
    calibration = None if precision == "fp32" else _images(views, advance)
    files: NetworkFiles[Any] = DEPTH_FILES if network == "depth" else STUDENT_FILES
    files.export(weights, out, calibration=calibration)


def _images(views: ViewPlan, advance: Advance) -> Iterator[Image]:
    total = views.views * len(views.scenes)
    for done, (_, rgb, _) in enumerate(twin_views(views), start=1):
        yield rgb
        advance("calibration", done, total)
