"""Training of the networks from flights and labels. Needs the extra `train`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from perception.control.ego_state import ControlNetConfig
from perception.control.training.network import STUDENT_FILES
from perception.control.training.run import ControlTrainingConfig, predict_control, train_control
from perception.control.training.samples import (
    ControlFlight,
    ControlSamples,
    ControlScore,
    score_control,
)
from perception.depth.training.clips import ClipSource
from perception.depth.training.footage import Flight
from perception.depth.training.network import DEPTH_FILES, DepthNetConfig
from perception.depth.training.run import DepthTrainingConfig, predict_depth
from perception.depth.training.run import train_depth as run_depth_training
from perception.networks.training.network_files import NetworkFiles, parameter_count
from perception.segmentation.training.unet import UNET_FILES
from uav_bt.errors import WeightsError
from uav_bt.lab.shipped import load_lab
from uav_bt.learning.depth_scores import DepthScore, score_depth
from uav_bt.learning.diary import Diary, write_depth_sheet
from uav_bt.learning.views import DepthViews
from uav_bt.progress import Advance, silent
from uav_bt.types.arrays import Image

# Curves in the diary of a run.
DEPTH_CURVES: Final = ("loss", "abs_rel", "obstacle_error_m", "ground_error_m")
STUDENT_CURVES: Final = (
    *("loss", "missed", "stopped", "wrong_side", "step_error_m", "free_error_m"),
)


def _save(files: NetworkFiles[Any], net: Any, weights: Path, notes: Mapping[str, Any]) -> None:
    files.save(weights, net, notes=notes)
    files.export(weights, weights.with_suffix(".onnx"))


# --- depth ----------------------------------------------------------------------------------------


def score_depth_on(views: DepthViews, predicted: NDArray[np.float32]) -> DepthScore:
    """Score predictions, (N, 128, 160) float32, on their images."""
    classes = load_lab().classes
    return score_depth(
        (mine, truth, classes.roles(ids), ground)
        for mine, truth, ids, ground in zip(
            predicted, views.depth_m, views.ids, views.ground_m, strict=True
        )
    )


def train_depth(
    flights: Sequence[Flight],
    weights: Path,
    *,
    config: DepthTrainingConfig | None = None,
    net_config: DepthNetConfig | None = None,
    start: Path | None = None,
    checkpoint: Path | None = None,
    views: DepthViews | None = None,
    validate_every: int = 200,
    advance: Advance = silent,
    diary: Diary | None = None,
) -> DepthScore | None:
    """Train the depth network and write its safetensors and ONNX files of one name.

    `checkpoint` is the training state, to continue from and to update; `views` are images with
    ground truth for the validation, whose score and images the diary keeps. Returns the score at
    the end; None without views.
    """
    settings = config or DepthTrainingConfig()

    def predictions(net: Any, images: Image) -> NDArray[np.float32]:
        parts = [predict_depth(net, images[at : at + 8]) for at in range(0, len(images), 8)]
        return np.concatenate(parts)

    def validate(now: Any, net: Any) -> None:
        advance(f"training, loss {now.loss:.3f}", now.step, now.steps)
        due = now.step % validate_every == 0 or now.step == now.steps
        if due and views is not None and diary is not None:
            predicted = predictions(net, views.rgb)
            score = asdict(score_depth_on(views, predicted))
            diary.note(now.step, {"loss": now.loss, "terms": dict(now.terms), **score})
            write_depth_sheet(diary.folder / f"step-{now.step:06d}.png", views, predicted)

    clips = ClipSource(flights)
    net = run_depth_training(
        clips,
        settings,
        net_config or DepthNetConfig(),
        start=start,
        checkpoint=checkpoint,
        progress=validate,
    )
    final = score_depth_on(views, predictions(net, views.rgb)) if views is not None else None
    notes = {
        "training": asdict(settings),
        "start": start.name if start is not None else None,
        "frames": clips.frame_count,
        "validation": asdict(final) if final is not None else None,
    }
    _save(DEPTH_FILES, net, weights, notes)
    return final


# --- the control student --------------------------------------------------------------------------


def first_weights(path: Path) -> Mapping[str, NDArray[np.float32]]:
    """Return initial weights: of a control student, or of a segmentation U-Net's encoder."""
    try:
        state = STUDENT_FILES.load(path)[0].state_dict()
    except WeightsError as no_student:
        try:
            unet, _ = UNET_FILES.load(path)
        except WeightsError:
            raise no_student from None
        state = {
            name: value for name, value in unet.state_dict().items() if name.startswith("down.")
        }
    return {name: value.numpy() for name, value in state.items()}


def train_student(
    flights: Sequence[ControlFlight],
    weights: Path,
    *,
    config: ControlTrainingConfig | None = None,
    net_config: ControlNetConfig | None = None,
    start: Path | None = None,
    checkpoint: Path | None = None,
    held_out: Sequence[ControlFlight] = (),
    validate_every: int = 500,
    diary: Diary | None = None,
    advance: Advance = silent,
) -> ControlScore | None:
    """Train the control student and write its safetensors and ONNX files of one name.

    `checkpoint` is the training state, to continue from and to update; `held_out` are flights for
    the validation, which the diary keeps. Returns the score at the end; None without them.
    """
    settings = config or ControlTrainingConfig()
    shape = net_config or ControlNetConfig()
    samples = ControlSamples(flights, shape, settings.near_weight)
    others = ControlSamples(held_out, shape) if held_out else None
    losses: list[float] = []

    def score(net: Any) -> ControlScore | None:
        if others is None:
            return None
        return score_control(lambda batch: predict_control(net, batch), others)

    def follow(now: Any, net: Any) -> None:
        losses.append(now.loss)
        advance(f"training, loss {now.loss:.3f}", now.step, now.steps)
        if diary is not None and (now.step % validate_every == 0 or now.step == now.steps):
            scored = score(net)
            values = {} if scored is None else scored.to_json()
            diary.note(now.step, {"loss": float(np.mean(losses)), **values})
            losses.clear()

    net = train_control(
        samples,
        settings,
        shape,
        start=None if start is None else first_weights(start),
        checkpoint=checkpoint,
        progress=follow,
    )
    final = score(net)
    notes = {
        "training": asdict(settings),
        "start": None if start is None else start.name,
        "flights": len(flights),
        "windows": len(samples),
        "near_share": round(samples.near_share, 4),
        "parameters": parameter_count(net),
        "validation": None if final is None else final.to_json(),
    }
    _save(STUDENT_FILES, net, weights, notes)
    return final
