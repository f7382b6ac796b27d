"""`uav-bt lab train`: the segmentation network of a lab, from its images and picks."""

from __future__ import annotations

import math
from typing import Annotated

import click
from annotated_types import Ge

from uav_bt.app.option_values import Seed
from uav_bt.cli.declare import command
from uav_bt.cli.lab_images import score_lines
from uav_bt.cli.progress import progress_bars
from uav_bt.cli.shared import Count, Device, Steps
from uav_bt.files import check_output
from uav_bt.lab.shipped import load_lab
from uav_bt.learning import lab_training
from uav_bt.learning.lab_data import LabData, checked_data
from uav_bt.learning.lab_material import LabMaterial
from uav_bt.learning.pick_scores import network_of_lab, score_picks
from uav_bt.plugins import need


@command()
def train(
    lab: str,
    *,
    steps: Steps = 800,
    batch: Annotated[int, Ge(2)] = 12,
    device: Device = "cpu",
    seed: Seed = 0,
    workers: Count = 1,
) -> None:
    """Train the segmentation network of a lab.

    LAB is a shipped lab, a folder of labs/, or a path, with images in frames/ and picks in
    picks.csv. A teacher learns from the picks and makes a class map of every image for training;
    from these learns the network. It begins with the lab's last network, the first time and
    after a change of the classes with the shipped U-Net. If the lab file names another network as
    `teacher`, that one makes the class maps.

    Writes LAB/segmentation.onnx, with which the lab is flown unless its file states a network. An
    existing one is replaced when the training has finished. LAB/training keeps teacher, masks and
    checkpoint: the same command continues an interrupted training.

    Options:
        batch: Images in a step.
        workers: Processes that make the masks.
    """
    need("train")
    # Refuses an absent GPU now.
    settings = lab_training.lab_training_config(steps=steps, batch=batch, device=device, seed=seed)
    material = LabMaterial(lab=load_lab(lab))
    data = checked_data(material)
    check_output(material.network)
    for warning in data.warnings:
        click.echo(f"warning: {warning}", err=True)
    with progress_bars() as advance:
        source = lab_training.mask_source(data, seed=settings.seed, advance=advance)
    if material.network.exists():
        click.echo(f"{material.network} stays until the new network is finished")
    with progress_bars() as advance:
        loss = lab_training.train_lab(data, source, settings, workers=workers, advance=advance)
    for line in _result(data, loss):
        click.echo(line)


def _result(data: LabData, loss: float) -> list[str]:
    material, picks = data.material, data.picks_on("check")
    lines = [] if math.isnan(loss) else [f"loss: {loss:.3f}"]
    if picks:
        segment = network_of_lab(material.lab, material.network).ids
        score = score_picks(segment, picks, material.frames, material.lab.classes)
        lines += score_lines(score)
    else:
        lines.append("no picks on images for checks: the network is not scored")
    lines += [f"network: {material.network}", f"teacher, masks, weights: {material.training}"]
    if material.lab.flight.network is not None:
        lines.append(
            f"note: {material.lab.file} states another network, with which the lab is flown; "
            "delete the key 'network' for this one"
        )
    where = material.lab.folder
    return [*lines, f"next: uav-bt lab check {where}, then uav-bt fly MISSION --lab {where}"]
