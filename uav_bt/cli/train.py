"""`uav-bt net train`, `export`, `collect` and `lab train`: networks, flights to learn from."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Literal

import click
from annotated_types import Ge, Le

from perception.control.ego_state import ControlNetConfig
from perception.control.training.network import STUDENT_FILES
from perception.control.training.run import ControlTrainingConfig, train_control
from perception.control.training.samples import ControlSamples
from perception.depth.training.clips import ClipSource
from perception.depth.training.network import DEPTH_FILES, DepthNetConfig
from perception.depth.training.run import DepthTrainingConfig, train_depth
from perception.networks.training.network_files import parameter_count
from perception.networks.weights_file import SHIPPED_WEIGHTS
from perception.segmentation.runtime import shipped_unet
from uav_bt.app.option_values import Seed
from uav_bt.campaign.runner import LocalBackend
from uav_bt.cli.declare import command
from uav_bt.cli.evaluate import Drawn
from uav_bt.cli.lab_images import score_lines
from uav_bt.cli.progress import campaign_progress, progress_bars
from uav_bt.cli.shared import RUNS, Count, Device, InputFile, OutputFolder, Records, Steps, Workers
from uav_bt.errors import FileError
from uav_bt.files import check_output
from uav_bt.lab.shipped import load_lab
from uav_bt.learning import collecting, lab_training, training
from uav_bt.learning.dataset import read_advised_flights, read_flights, records_of
from uav_bt.learning.lab_data import LabData, checked_data
from uav_bt.learning.lab_material import LabMaterial
from uav_bt.learning.pick_scores import network_of_lab, score_picks
from uav_bt.option import Option
from uav_bt.plugins import need

_Weights = Annotated[Path, Option("The weights.", path="written", suffix=".safetensors")]
_Run = Annotated[
    Path,
    Option(
        "Where the checkpoint and what is made of the flights are kept; the same command "
        "continues a training from there.",
        path="folder",
    ),
]


@command()
def depth(
    flights: Annotated[tuple[Path, ...], Option(form="FLIGHTS...")],
    *,
    out: _Weights = RUNS / "depth.safetensors",
    run: _Run = RUNS / "depth",
    labels: Literal["contact", "none"] = "contact",
    photometric: bool = True,
    start: InputFile = None,
    pose: Literal["telemetry", "network"] = "telemetry",
    seed: Seed = 0,
    steps: Steps = 2500,
    device: Device = "cpu",
) -> None:
    """Train the depth network on flights, without the true depth.

    FLIGHTS are records of `uav-bt fly --record`. Writes a safetensors file and, beside it, the ONNX
    file made from it, which a tree file may name.

    Options:
        labels: Labels beside the frames: depth from masks and geometry, or none.
        photometric: Learn from the photometric loss between neighbouring frames, too.
        start: Weights of a depth network to begin with; random ones if not given.
        pose: Source of the camera's movement between frames.
    """
    if not photometric and labels == "none":
        raise click.UsageError("--no-photometric with --labels none leaves nothing to learn from")
    config = DepthTrainingConfig(
        pose=pose, seed=seed, steps=steps, device=device, photometric=photometric
    )
    with progress_bars() as advance:
        segmenter = shipped_unet() if labels == "contact" else None
        clips = ClipSource(read_flights(flights, segmenter, run, advance=advance))
        net = train_depth(
            clips,
            config,
            DepthNetConfig(),
            start=start,
            checkpoint=run / "checkpoint.safetensors",
            progress=training.shown(advance),
        )
    about = {"start": start and start.name, "frames": clips.frame_count}
    training.save_trained(DEPTH_FILES, net, out, config, about)
    click.echo(f"depth network: {out} and {out.with_suffix('.onnx')}")


@command()
def student(
    records: Records,
    *,
    out: _Weights = RUNS / "student.safetensors",
    run: _Run = RUNS / "student",
    views: Annotated[int, Ge(1), Le(5)] = 3,
    start: InputFile = None,
    seed: Seed = 0,
    steps: Steps = 6000,
    batch: Annotated[int, Ge(2)] = 24,
    device: Device = "cpu",
) -> None:
    """Train the control student on records of advised flights.

    RECORDS are files that `uav-bt net collect` made, or folders of them. Writes a safetensors file
    and, beside it, the ONNX file made from it, for a tree with policy="student:FILE.onnx". On two
    cores 4,500 steps take about 36 minutes; the same command continues what was stopped.

    Options:
        views: Frames in a window: the present one and earlier ones.
        start: Weights to begin with, a student's or a segmentation U-Net's; the shipped U-Net's if
            not given.
        batch: Windows in a step.
    """
    # Refuses an absent GPU before records are read.
    loop = ControlTrainingConfig(seed=seed, steps=steps, batch=batch, device=device)
    net_config = ControlNetConfig(views=views)
    begin = start or lab_training.UNET_WEIGHTS
    with progress_bars() as advance:
        paths = records_of(records)
        advised = read_advised_flights(paths, net_config, run / "views", advance=advance)
        samples = ControlSamples(advised, net_config, loop.near_weight)
        net = train_control(
            samples,
            loop,
            net_config,
            start=training.first_weights(begin),
            checkpoint=run / "checkpoint.safetensors",
            progress=training.shown(advance),
        )
    about = {
        "start": begin.name,
        "flights": len(advised),
        "windows": len(samples),
        "near_share": round(samples.near_share, 4),
        "parameters": parameter_count(net),
    }
    training.save_trained(STUDENT_FILES, net, out, loop, about)
    click.echo(f"control student: {out} and {out.with_suffix('.onnx')}")


@command("train")
def lab_network(
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
    click.echo("\n".join(_result(data, loss)))


def _result(data: LabData, loss: float) -> Iterator[str]:
    material, picks = data.material, data.picks_on("check")
    if not math.isnan(loss):
        yield f"loss: {loss:.3f}"
    if picks:
        segment = network_of_lab(material.lab, material.network).ids
        yield from score_lines(score_picks(segment, picks, material.frames, material.lab.classes))
    else:
        yield "no picks on images for checks: the network is not scored"
    yield f"network: {material.network}"
    yield f"teacher, masks, weights: {material.training}"
    if material.lab.flight.network is not None:
        yield (
            f"note: {material.lab.file} states another network, with which the lab is flown; "
            "delete the key 'network' for this one"
        )
    where = material.lab.folder
    yield f"next: uav-bt lab check {where}, then uav-bt fly MISSION --lab {where}"


@command()
def collect(
    *,
    plan: Annotated[collecting.CollectionPlan, Option(parts=collecting.CollectionPlan)],
    student: InputFile = None,
    workers: Workers = None,
    out: OutputFolder = None,
) -> None:
    """Fly a mission many times and record the rule's advice on every view.

    TREE has an <Advise/> leaf: explore_and_land_advised, where the rule flies, or
    explore_and_land_student_advised, where the student flies and the rule's answers are
    recorded. `uav-bt net train student DIR...` learns from the records. The same command continues
    a collection that was stopped. A flight takes about 45 s of a core.

    Options:
        student: Let this control student (ONNX) fly in place of every policy of the tree.
        out: Where flights and records are kept; default: runs/collected-TREE.
    """
    need("record")
    if student is not None:
        if not student.is_file():
            raise FileError(student, "there is no such control student")
        # Absolute: workers have another working directory.
        flying = collecting.nodes_under_policy(plan.tree)
        by_student = dict.fromkeys(flying, f"student:{student.resolve()}")
        plan = replace(plan, policies={**by_student, **plan.policies})
    folder = out or RUNS / f"collected-{Path(plan.tree).stem}"
    with campaign_progress(len(plan), folder) as progress:
        records = collecting.collect(
            plan,
            folder,
            backend=LocalBackend(workers),
            on_flight=progress.add,
            on_note=progress.note,
        )
    size_mb = sum(record.stat().st_size for record in records) / 1e6
    click.echo(f"{len(records)} records, {size_mb:.0f} MB: {folder}")


@dataclass(frozen=True, kw_only=True)
class Export:
    """The network that is exported.

    Options:
        weights: The safetensors file of `uav-bt net train`; the shipped one if not given.
        precision: 8-bit integers, which take about half the time, or floats. The integers' ranges
            are taken from images of the twin.
        out: The ONNX file; runs/NETWORK-PRECISION.onnx if not given.
    """

    weights: InputFile = None
    precision: training.Precision = "int8"
    out: Annotated[Path | None, Option(path="written", suffix=".onnx")] = None
    drawn: Annotated[Drawn, Option(parts=Drawn)]

    def write(self, network: training.Network) -> None:
        """Make the file, and name it."""
        need("train")
        path = self.out or RUNS / f"{network}-{self.precision}.onnx"
        source = self.weights or SHIPPED_WEIGHTS / f"{network}.safetensors"
        plan = self.drawn.of(training.CALIBRATION_VIEWS)
        with progress_bars() as advance:
            training.export_network(
                network, source, path, precision=self.precision, views=plan, advance=advance
            )
        click.echo(f"network in {self.precision}: {path}, {path.stat().st_size / 1e6:.1f} MB")


_Export = Annotated[Export, Option(parts=Export)]


@command("depth")
def export_depth(*, export: _Export) -> None:
    """Export a depth network."""
    export.write("depth")


@command("student")
def export_student(*, export: _Export) -> None:
    """Export a control student. All its shapes are fixed."""
    export.write("student")
