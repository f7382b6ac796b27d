"""`uav-bt net train segmentation` and `depth`: the networks of perception."""

from __future__ import annotations

import hashlib
import json
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import click

from perception.depth.training.run import DepthTrainingConfig
from perception.segmentation.runtime import shipped_unet
from perception.segmentation.teacher import load_teacher
from perception.segmentation.training.run import TrainingConfig
from uav_bt.cli.command import Command
from uav_bt.cli.flight_options import flight_option
from uav_bt.cli.options import INPUT, RUNS, grouped, output_option
from uav_bt.cli.progress import progress_bars
from uav_bt.cli.training_options import (
    Drawn,
    batch_option,
    device_option,
    drawn_options,
    run_option,
    steps_option,
)
from uav_bt.cli.values import WholeNumber
from uav_bt.lab.shipped import load_lab
from uav_bt.learning import diary, training
from uav_bt.learning.dataset import read_flights
from uav_bt.learning.teacher import SHIPPED_TEACHER, UNetPlan, label_flights, label_views
from uav_bt.learning.training import train_segmentation
from uav_bt.learning.views import TRAINING_SCENES, DepthViewPlan, depth_views


@click.command(cls=Command)
@click.argument("flights", nargs=-1, metavar="[FLIGHTS]...", type=click.Path(path_type=Path))
@output_option("--out", "The weights.", default=RUNS / "unet.safetensors", suffix=".safetensors")
@click.option(
    "--teacher",
    "teacher_path",
    metavar="FILE",
    type=INPUT,
    help="The teacher that makes the masks; the shipped one if not given.",
)
@run_option("segmentation", "masks and checkpoint")
@drawn_options(views=1200, seed=1)
@grouped(
    "config",
    dict,
    steps=steps_option(4000),
    batch=batch_option(12, "Images"),
    device=device_option(),
    loss=click.option(
        "--loss",
        type=click.Choice(["cross_entropy", "bce_dice"]),
        default="cross_entropy",
        help="The loss that is minimised.",
    ),
)
@click.option(
    "--workers",
    type=WholeNumber(min=1),
    default=1,
    help="Processes that make masks of the twin's images.",
)
def segmentation(
    *,
    flights: tuple[Path, ...],
    out: Path,
    teacher_path: Path | None,
    run: Path,
    drawn: Drawn,
    config: dict[str, Any],
    workers: int,
) -> None:
    """Train the U-Net on the teacher's masks.

    FLIGHTS are records of `uav-bt fly --record`: the network learns from their frames, one a
    second. Without any, images are drawn in the twin (--scene, --views, --seed).

    Writes a safetensors file and, beside it, the ONNX file made from it. A mission flies on the
    latter when its tree has <Segment model="FILE.onnx"/>.
    """
    training = TrainingConfig(**config)  # refuses an absent GPU before masks are made
    teacher_path = SHIPPED_TEACHER if teacher_path is None else teacher_path
    classes = load_lab().classes
    load_teacher(teacher_path, classes)  # refuses a damaged one now, and not in a worker later
    plan = replace(UNetPlan(), views=drawn.of(replace(UNetPlan().views, scenes=TRAINING_SCENES)))
    with progress_bars() as advance:
        masks = run / f"masks-{_fingerprint(plan, teacher_path)}"
        if flights:
            images = label_flights(teacher_path, flights, plan, masks, advance=advance)
        else:
            images = label_views(teacher_path, plan, masks, workers=workers, advance=advance)
        train_segmentation(
            images,
            classes,
            out,
            config=training,
            checkpoint=run / "checkpoint.safetensors",
            advance=advance,
        )
    click.echo(f"segmentation U-Net: {out} and {out.with_suffix('.onnx')}")


@click.command(cls=Command)
@click.argument(
    "flights", nargs=-1, required=True, metavar="FLIGHTS...", type=click.Path(path_type=Path)
)
@output_option("--out", "The weights.", default=RUNS / "depth.safetensors", suffix=".safetensors")
@run_option("depth", "labels, checkpoint, scores and images")
@click.option(
    "--labels",
    type=click.Choice(["contact", "none"]),
    default="contact",
    help="Labels beside the frames: depth from masks and geometry, or none.",
)
@click.option(
    "--photometric/--no-photometric",
    default=True,
    help="Learn from the photometric loss between neighbouring frames, too.",
)
@click.option(
    "--start",
    metavar="FILE",
    type=INPUT,
    help="Weights of a depth network to begin with; random ones if not given.",
)
@click.option(
    "--validate/--no-validate",
    default=True,
    help="Score the network on the twin's validation scenes as it learns.",
)
@grouped(
    "config",
    dict,
    pose=click.option(
        "--pose",
        type=click.Choice(["telemetry", "network"]),
        default="telemetry",
        help="Source of the camera's movement between frames.",
    ),
    seed=flight_option("seed"),
    steps=steps_option(2500),
    device=device_option(),
)
def depth(
    *,
    flights: tuple[Path, ...],
    out: Path,
    run: Path,
    labels: str,
    photometric: bool,
    start: Path | None,
    validate: bool,
    config: dict[str, Any],
) -> None:
    """Train the depth network on flights, without the true depth.

    FLIGHTS are records of `uav-bt fly --record`. Writes a safetensors file and, beside it, the ONNX
    file made from it, which a tree file may name.
    """
    if not photometric and labels == "none":
        raise click.UsageError("--no-photometric with --labels none leaves nothing to learn from")
    weighted = DepthTrainingConfig(
        **config,
        photometric=1.0 if photometric else 0.0,
        geometry=0.1 if photometric else 0.0,
        labels=1.0 if labels == "contact" else 0.0,
    )
    with progress_bars() as advance:
        read = read_flights(
            flights, shipped_unet() if labels == "contact" else None, run, advance=advance
        )
        score = training.train_depth(
            read,
            out,
            config=weighted,
            start=start,
            checkpoint=run / "checkpoint.safetensors",
            views=depth_views(DepthViewPlan()) if validate else None,
            diary=diary.Diary(run, training.DEPTH_CURVES) if validate else None,
            advance=advance,
        )
    if score is not None:
        click.echo(
            f"validation: {score.abs_rel:.4f} relative error after median scaling, obstacles "
            f"{score.obstacle_error_m:.3f} m and carpet {score.carpet_error_m:.3f} m off with the "
            "carpet's scale"
        )
    click.echo(f"depth network: {out} and {out.with_suffix('.onnx')}")


def _fingerprint(plan: object, teacher_path: Path) -> str:
    """Return a name for the masks of a plan, so that no other masks are mistaken for them."""
    about = json.dumps(asdict(plan), sort_keys=True)  # type: ignore[call-overload]  # a dataclass
    return hashlib.sha256(about.encode() + teacher_path.read_bytes()).hexdigest()[:12]
