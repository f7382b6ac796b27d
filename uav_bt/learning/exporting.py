"""Export of networks: from weights to ONNX files with floats or 8-bit integers."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from perception.control.training.network import STUDENT_FILES
from perception.depth.training.network import DEPTH_FILES
from perception.networks.training.network_files import NetworkFiles
from perception.segmentation.training.unet import UNET_FILES
from uav_bt.errors import UnknownNameError
from uav_bt.learning.views import ViewPlan, twin_views
from uav_bt.progress import Advance, silent

Network = Literal["segmentation", "depth", "student"]
Precision = Literal["int8", "fp32"]
PRECISIONS: Final[tuple[Precision, ...]] = ("int8", "fp32")

NETWORKS: Final[dict[Network, NetworkFiles[Any]]] = {
    "segmentation": UNET_FILES,
    "depth": DEPTH_FILES,
    "student": STUDENT_FILES,
}

CALIBRATION_VIEWS: Final = ViewPlan(
    views=50, size_px=(640, 360), lowered=0.25, truth_size_px=(32, 18), seed=5
)
"""Images for the calibration: 200 images of the training scenes."""


def export_network(
    network: Network,
    weights: Path,
    out: Path,
    *,
    precision: Precision = "int8",
    views: ViewPlan = CALIBRATION_VIEWS,
    advance: Advance = silent,
) -> None:
    """Write the ONNX file of a network."""
    if precision not in PRECISIONS:
        raise UnknownNameError("precision", precision, PRECISIONS)
    calibration = None if precision == "fp32" else _images(views, advance)
    NETWORKS[network].export(weights, out, calibration=calibration)


def _images(views: ViewPlan, advance: Advance) -> Iterator[NDArray[np.uint8]]:
    total = views.views * len(views.scenes)
    for done, (_, rgb, _) in enumerate(twin_views(views), start=1):
        yield rgb
        advance("calibration", done, total)
