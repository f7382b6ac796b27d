"""Training of a lab's segmentation network. Needs the extra `train`."""

from __future__ import annotations

import json
import shutil
from dataclasses import asdict
from typing import Any, Final

import numpy as np

from perception.networks.training.loop import Progress
from perception.networks.weights_file import SHIPPED_WEIGHTS
from perception.segmentation.runtime import MAP_PX
from perception.segmentation.teacher import TeacherConfig, fit_teacher, save_teacher
from perception.segmentation.training import run
from perception.segmentation.training.pick_images import PickImages
from perception.segmentation.training.run import TrainingConfig
from perception.segmentation.training.unet import UNET_FILES, UNet, UNetConfig
from uav_bt.learning.lab_data import LabData, MaskSource, digest, make_masks, mask_files
from uav_bt.protocols import Advance, silent

WEIGHTS_FILE: Final = "unet.safetensors"
UNET_WEIGHTS: Final = SHIPPED_WEIGHTS / WEIGHTS_FILE
"""Weights that a lab's first network begins with."""

_CALIBRATION_IMAGES: Final = 200


def lab_training_config(*, steps: int = 800, **given: Any) -> TrainingConfig:
    """Return the settings of a lab's training.

    The learning rate is two thirds of that of a new network, and rare classes are balanced.
    """
    return TrainingConfig(
        steps=steps,
        learning_rate=2e-3,
        warm_up_steps=min(50, steps // 10 + 1),
        checkpoint_every=50,
        augment=run.FLIGHT_AUGMENT,
        balanced=True,
        **given,
    )


def mask_source(data: LabData, *, seed: int = 0, advance: Advance = silent) -> MaskSource:
    """Return the maker of masks: the network of the lab file, else a teacher of the picks.

    The teacher is written to the folder `training`.
    """
    if data.source is not None:
        return data.source
    material, classes = data.material, data.material.lab.classes
    images = PickImages(material.frames, data.uses, TeacherConfig())
    patches = images.patches(data.picks_on("train"), classes, advance)
    save_teacher(material.teacher, fit_teacher(patches, images.config, seed=seed))
    return MaskSource(file=material.teacher, classes=classes)


def train_lab(
    data: LabData,
    source: MaskSource,
    config: TrainingConfig,
    *,
    workers: int = 1,
    advance: Advance = silent,
) -> float:
    """Train the network of a lab and write its files; `workers` processes make masks.

    `training/` gets weights, checkpoint and the network in floats. `segmentation.onnx` is written
    last, in one step. An interrupted training continues from its masks and its checkpoint.

    Returns:
        The mean loss of the last tenth of the steps that were done now; NaN without any.
    """
    folder, images = data.material.training, data.images("train")
    data.material.keep_uses(data.uses)
    masks = folder / f"masks-{source.fingerprint}"
    rgb, ids = make_masks(source, images, masks, workers=workers, advance=advance)
    classes = data.material.lab.classes.names
    width, height = MAP_PX
    losses: list[float] = []

    def step_done(now: Progress, _net: UNet) -> None:
        losses.append(now.loss)
        advance(f"training, loss {now.loss:.3f}", now.step, now.steps)

    start = _first_network(data)
    about = [asdict(config), masks.name, [one.name for one in mask_files(images, masks).values()]]
    name = f"checkpoint-{digest(json.dumps(about, sort_keys=True).encode())}.safetensors"
    checkpoint = folder / name
    net = run.train_unet(
        run.LabelledImages(rgb=rgb, ids=ids, classes=classes),
        config,
        UNetConfig(width_px=width, height_px=height, outputs=len(classes)),
        start=start,
        checkpoint=checkpoint,
        progress=step_done,
    )
    weights = folder / WEIGHTS_FILE
    notes = {"training": asdict(config), "images": len(rgb), "began_with": list(start.classes)}
    UNET_FILES.save(weights, net, notes=notes)
    UNET_FILES.export(weights, folder / "segmentation-fp32.onnx")
    advance("8-bit integers", 0, 1)
    spread = np.linspace(0, len(rgb) - 1, min(len(rgb), _CALIBRATION_IMAGES)).astype(int)
    UNET_FILES.export(weights, data.material.network, calibration=rgb[spread])
    advance("8-bit integers", 1, 1)
    for old in {*folder.glob("checkpoint-*"), *folder.glob("masks-*")} - {checkpoint, masks}:
        # Of trainings with other settings, picks or images.
        shutil.rmtree(old) if old.is_dir() else old.unlink()
    last = losses[-max(len(losses) // 10, 1) :]
    return float(np.mean(last)) if last else float("nan")


def _first_network(data: LabData) -> UNet:
    """Return the lab's last network, or the shipped one if it has none or of other classes."""
    last = data.material.training / WEIGHTS_FILE
    if last.is_file():
        net, _ = UNET_FILES.load(last)
        if net.classes == tuple(data.material.lab.classes.names):
            return net
    return UNET_FILES.load(UNET_WEIGHTS)[0]
