"""Networks made ready to fly: weights in, ONNX files out, in floats or in 8-bit integers."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from uav_bt.errors import UnknownNameError
from uav_bt.learning.views import ViewPlan, twin_views
from uav_bt.progress import Advance, silent

__all__ = [
    "CALIBRATION_VIEWS",
    "PRECISIONS",
    "Precision",
    "export_depth",
    "export_segmentation",
    "export_student",
]

Precision = Literal["int8", "fp32"]
PRECISIONS: Final[tuple[Precision, ...]] = ("int8", "fp32")

CALIBRATION_VIEWS: Final = ViewPlan(views=50, size_px=(640, 360), truth_size_px=(32, 18), seed=5)
"""What is looked at to see what numbers a network meets: 200 pictures of the training scenes."""


def export_segmentation(
    weights: Path,
    out: Path,
    *,
    precision: Precision = "int8",
    views: ViewPlan = CALIBRATION_VIEWS,
    advance: Advance = silent,
) -> None:
    """Write the ONNX file of a segmentation U-Net.

    Args:
        weights: the safetensors file.
        out: the ONNX file.
        precision: what the network computes in.
        views: the pictures that 8-bit integers are calibrated on.
        advance: told after every picture.

    Raises:
        WeightsError: the weights cannot be used.
        SceneError: a scene is missing or malformed.
        UnknownNameError: there is no such precision.
        MissingDependencyError: onnx is absent, or OpenGL does not work here.
    """
    # Imported here, as below: who asks for help need not wait for it.
    from perception.segmentation.training.export import export_onnx  # noqa: PLC0415

    export_onnx(weights, out, calibration=_calibration(precision, views, advance))


def export_depth(
    weights: Path,
    out: Path,
    *,
    precision: Precision = "int8",
    views: ViewPlan = CALIBRATION_VIEWS,
    advance: Advance = silent,
) -> None:
    """Write the ONNX file of a depth network; as `export_segmentation` does."""
    from perception.depth.training.export import export_depth_onnx  # noqa: PLC0415

    export_depth_onnx(weights, out, calibration=_calibration(precision, views, advance))


def export_student(
    weights: Path,
    out: Path,
    *,
    precision: Precision = "int8",
    views: ViewPlan = CALIBRATION_VIEWS,
    advance: Advance = silent,
) -> None:
    """Write the ONNX file of a control student; as `export_segmentation` does."""
    from perception.control.export import export_control_onnx  # noqa: PLC0415

    export_control_onnx(weights, out, calibration=_calibration(precision, views, advance))


def _calibration(
    precision: str, views: ViewPlan, advance: Advance
) -> Iterator[NDArray[np.uint8]] | None:
    if precision not in PRECISIONS:
        raise UnknownNameError("precision", precision, PRECISIONS)
    return None if precision == "fp32" else _pictures(views, advance)


def _pictures(views: ViewPlan, advance: Advance) -> Iterator[Any]:
    total = views.views * len(views.scenes)
    for done, (_, rgb, _) in enumerate(twin_views(views), start=1):
        yield rgb
        advance("calibration", done, total)
