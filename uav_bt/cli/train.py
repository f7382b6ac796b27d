"""`uav-bt net train depth`: the depth network."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from perception.depth.training.run import DepthTrainingConfig
from perception.segmentation.runtime import shipped_unet
from uav_bt.cli.command import Command
from uav_bt.cli.flight_options import flight_option
from uav_bt.cli.options import INPUT, RUNS, grouped, output_option
from uav_bt.cli.progress import progress_bars
from uav_bt.cli.training_options import (
    device_option,
    run_option,
    steps_option,
)
from uav_bt.learning import diary, training
from uav_bt.learning.dataset import read_flights
from uav_bt.learning.views import DepthViewPlan, depth_views


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
    with progress_bars() as advance:
        read = read_flights(
            flights, shipped_unet() if labels == "contact" else None, run, advance=advance
        )
        score = training.train_depth(
            read,
            out,
            config=DepthTrainingConfig(**config, photometric=photometric),
            start=start,
            checkpoint=run / "checkpoint.safetensors",
            views=depth_views(DepthViewPlan()) if validate else None,
            diary=diary.Diary(run, training.DEPTH_CURVES) if validate else None,
            advance=advance,
        )
    if score is not None:
        click.echo(
            f"validation: {score.abs_rel:.4f} relative error after median scaling, obstacles "
            f"{score.obstacle_error_m:.3f} m and ground {score.ground_error_m:.3f} m off with the "
            "ground's scale"
        )
    click.echo(f"depth network: {out} and {out.with_suffix('.onnx')}")
