"""Training and export of depth network and control student. Needs the extra `train`."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final, Literal

import numpy as np
from numpy.typing import NDArray

from perception.control.ego_state import ControlNetConfig
from perception.control.training.network import STUDENT_FILES
from perception.control.training.run import ControlTrainingConfig, train_control
from perception.control.training.samples import ControlFlight, ControlSamples
from perception.depth.training import run
from perception.depth.training.clips import ClipSource
from perception.depth.training.footage import Flight
from perception.depth.training.network import DEPTH_FILES, DepthNetConfig
from perception.networks.training.loop import LoopConfig, Progress
from perception.networks.training.network_files import NetworkFiles, parameter_count
from perception.segmentation.training.unet import UNET_FILES
from uav_bt.errors import WeightsError
from uav_bt.learning.views import ViewPlan, twin_views
from uav_bt.progress import Advance, silent
from uav_bt.types.arrays import Image

Network = Literal["depth", "student"]
Precision = Literal["int8", "fp32"]

CALIBRATION_VIEWS: Final = ViewPlan(
    views=50, size_px=(640, 360), lowered=0.25, truth_size_px=(32, 18), seed=5
)
"""Images for the calibration: 200 images of the training scenes."""


def train_depth(
    flights: Sequence[Flight],
    weights: Path,
    *,
    config: run.DepthTrainingConfig,
    start: Path | None = None,
    checkpoint: Path | None = None,
    advance: Advance = silent,
) -> None:
    """Train the depth network and write its safetensors and ONNX files of one name.

    `start` has the weights to begin with, and `checkpoint` the state to continue from.
    """
    clips = ClipSource(flights)
    net = run.train_depth(
        clips,
        config,
        DepthNetConfig(),
        start=start,
        checkpoint=checkpoint,
        progress=_shown(advance),
    )
    notes = {**_about(config, start), "frames": clips.frame_count}
    _save(DEPTH_FILES, net, weights, notes)


def train_student(
    flights: Sequence[ControlFlight],
    weights: Path,
    *,
    config: ControlTrainingConfig,
    net_config: ControlNetConfig,
    start: Path | None = None,
    checkpoint: Path | None = None,
    advance: Advance = silent,
) -> None:
    """Train the control student and write its safetensors and ONNX files of one name.

    `start` has the weights to begin with, and `checkpoint` the state to continue from.
    """
    samples = ControlSamples(flights, net_config, config.near_weight)
    net = train_control(
        samples,
        config,
        net_config,
        start=None if start is None else first_weights(start),
        checkpoint=checkpoint,
        progress=_shown(advance),
    )
    notes = {
        **_about(config, start),
        "flights": len(flights),
        "windows": len(samples),
        "near_share": round(samples.near_share, 4),
        "parameters": parameter_count(net),
    }
    _save(STUDENT_FILES, net, weights, notes)


def _shown(advance: Advance) -> Callable[[Progress, object], None]:
    return lambda now, _net: advance(f"training, loss {now.loss:.3f}", now.step, now.steps)


def _about(config: LoopConfig, start: Path | None) -> dict[str, Any]:
    return {"training": asdict(config), "start": None if start is None else start.name}


def _save(files: NetworkFiles[Any], net: Any, weights: Path, notes: Mapping[str, Any]) -> None:
    files.save(weights, net, notes=notes)
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
