"""`uav-bt net train student`: the control student."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from perception.control.ego_state import ControlNetConfig
from perception.control.training.run import ControlTrainingConfig
from uav_bt.cli.command import Command
from uav_bt.cli.flight_options import flight_option
from uav_bt.cli.options import FOLDER, INPUT, RUNS, grouped, output_option, records_argument
from uav_bt.cli.progress import progress_bars
from uav_bt.cli.training_options import batch_option, device_option, run_option, steps_option
from uav_bt.cli.values import Number, WholeNumber
from uav_bt.learning import diary, training
from uav_bt.learning.dataset import read_advised_flights, split_records
from uav_bt.learning.lab_training import UNET_WEIGHTS


@click.command(cls=Command)
@records_argument
@output_option("--out", "The weights.", default=RUNS / "student.safetensors", suffix=".safetensors")
@run_option("student", "views, checkpoint, scores and curves")
@click.option(
    "--views-kept",
    metavar="DIR",
    type=FOLDER,
    help="Where the records' views are kept, for several runs to share; RUN/views if not given.",
)
@click.option(
    "--validate",
    "held_out",
    metavar="RECORDS",
    multiple=True,
    type=click.Path(path_type=Path),
    help="Records, or a folder of them, that validate and are not learnt from. Repeatable.",
)
@grouped(
    "net",
    ControlNetConfig,
    views=click.option(
        "--views",
        type=WholeNumber(1, 5),
        default=3,
        help="Frames in a window: the present one and earlier ones.",
    ),
    spacing_s=click.option(
        "--spacing-s",
        type=Number(min=0.0, min_open=True),
        default=0.5,
        help="Time between the views of a window.",
    ),
)
@click.option(
    "--start",
    metavar="FILE",
    type=INPUT,
    help="Weights to begin with, a student's or a segmentation U-Net's; the shipped U-Net's if "
    "not given.",
)
@grouped(
    "config",
    dict,
    near_weight=click.option(
        "--near-weight",
        type=Number(min=0.0, min_open=True),
        default=2.0,
        help="How much more often views near obstacles are drawn than others.",
    ),
    seed=flight_option("seed"),
    steps=steps_option(6000),
    batch=batch_option(24, "Windows"),
    device=device_option(),
)
def student(
    *,
    records: tuple[Path, ...],
    out: Path,
    run: Path,
    views_kept: Path | None,
    held_out: tuple[Path, ...],
    net: ControlNetConfig,
    start: Path | None,
    config: dict[str, Any],
) -> None:
    """Train the control student on records of advised flights.

    RECORDS are files that `uav-bt net collect` made, or folders of them. Writes a safetensors file
    and, beside it, the ONNX file made from it, for a tree with policy="student:FILE.onnx". On two
    cores 4,500 steps take about 36 minutes; the same command continues what was stopped.
    """
    loop = ControlTrainingConfig(**config)  # refuses an absent GPU before records are read
    kept = views_kept or run / "views"
    learnt, others = split_records(records, held_out)
    with progress_bars() as advance:
        score = training.train_student(
            read_advised_flights(learnt, net, kept, advance=advance),
            out,
            config=loop,
            net_config=net,
            start=start or UNET_WEIGHTS,
            checkpoint=run / "checkpoint.safetensors",
            held_out=read_advised_flights(others, net, kept, advance=advance),
            diary=diary.Diary(run, training.STUDENT_CURVES),
            advance=advance,
        )
    if score is not None:
        click.echo(
            f"held-out flights: enters {100 * score.missed:.1f} % of blocked paths, stops before "
            f"{100 * score.stopped:.1f} % of free ones, begins {100 * score.wrong_side:.1f} % of "
            f"turns to the other side, steps {score.step_error_m:.3f} m off"
        )
    click.echo(f"control student: {out} and {out.with_suffix('.onnx')}")
