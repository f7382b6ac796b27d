"""`uav-bt train student`: train the control student."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import click

from uav_bt.cli.options import output_option, seed_option
from uav_bt.cli.progress import progress_bars
from uav_bt.plugins import need

__all__ = ["student"]

_RUNS: Final = Path("runs")  # where results go by default; git does not look there


@click.command()
@click.argument(
    "records", nargs=-1, required=True, metavar="RECORDS...", type=click.Path(path_type=Path)
)
@output_option("--out", f"The safetensors file; {_RUNS}/student.safetensors if not given.")
@click.option(
    "--run",
    type=click.Path(file_okay=False, path_type=Path),
    default=_RUNS / "student",
    show_default=True,
    help="Where views, checkpoint, scores and curves are kept: the same command again goes on.",
)
@click.option(
    "--views-kept",
    metavar="DIR",
    type=click.Path(file_okay=False, path_type=Path),
    help="Where the records' views are kept, for several runs to share; RUN/views if not given.",
)
@click.option(
    "--validate",
    "held_out",
    multiple=True,
    type=click.Path(path_type=Path),
    help="Records to measure on and not to learn from. Repeatable.",
)
@click.option(
    "--learns",
    type=click.Choice(["choice", "movement"]),
    default="choice",
    show_default=True,
    help="To advance or turn, and how far; or the movement by mean squared error, as the paper.",
)
@click.option(
    "--views",
    type=click.IntRange(1, 5),
    default=3,
    show_default=True,
    help="The present frame and earlier ones.",
)
@click.option(
    "--spacing-s",
    type=click.FloatRange(min=0.0, min_open=True),
    default=0.5,
    show_default=True,
    help="Between views.",
)
@click.option(
    "--near-weight",
    type=click.FloatRange(min=0.0, min_open=True),
    default=2.0,
    show_default=True,
    help="How much more often views near obstacles are drawn; 1 for as often as all.",
)
@click.option(
    "--start",
    type=click.Path(dir_okay=False, path_type=Path),
    help="Weights to begin with, a student's or a segmentation U-Net's; the shipped U-Net's if "
    "not given.",
)
@seed_option()
@click.option(
    "--steps", type=click.IntRange(min=1), default=6000, show_default=True, help="Of training."
)
@click.option(
    "--batch", type=click.IntRange(min=2), default=24, show_default=True, help="Windows a step."
)
def student(
    *,
    records: tuple[Path, ...],
    out: Path | None,
    run: Path,
    views_kept: Path | None,
    held_out: tuple[Path, ...],
    learns: str,
    views: int,
    spacing_s: float,
    near_weight: float,
    start: Path | None,
    seed: int,
    steps: int,
    batch: int,
) -> None:
    """Train the control student on records of advised flights.

    RECORDS are files that `uav-bt collect` made, or folders of them. Writes a safetensors file and,
    beside it, the ONNX file made from it: a tree says policy="student:FILE.onnx".
    """
    need("train", "torch", "onnx")
    need("record", "mcap", "foxglove")
    weights = out or _RUNS / "student.safetensors"
    if weights.suffix != ".safetensors":
        raise click.UsageError(f"--out must end in .safetensors, got '{weights}'")
    from perception.control.config import ControlNetConfig  # noqa: PLC0415 - late, for --help
    from perception.control.samples import SampleConfig  # noqa: PLC0415
    from perception.control.training import ControlTrainingConfig  # noqa: PLC0415
    from uav_bt.learning import student as training  # noqa: PLC0415
    from uav_bt.learning.dataset import split_records  # noqa: PLC0415
    from uav_bt.learning.segmentation import SHIPPED_UNET  # noqa: PLC0415
    from uav_bt.learning.student_diary import StudentDiary  # noqa: PLC0415

    net = ControlNetConfig(views=views, spacing_s=spacing_s, learns=learns)  # type: ignore[arg-type]  # click checked it
    config = ControlTrainingConfig(
        steps=steps, batch=batch, seed=seed, samples=SampleConfig(near_weight=near_weight)
    )
    kept = views_kept or run / "views"
    learnt, others = split_records(records, held_out)
    with progress_bars() as advance:
        score = training.train_student(
            training.read_advised_flights(learnt, net, kept, advance=advance),
            weights,
            config=config,
            net_config=net,
            start=start or SHIPPED_UNET,
            checkpoint=run / "checkpoint.safetensors",
            held_out=training.read_advised_flights(others, net, kept, advance=advance),
            diary=StudentDiary(run),
            advance=advance,
        )
    if score is not None:
        click.echo(
            f"held-out flights: takes {100 * score.missed:.1f} % of blocked ways, stops before "
            f"{100 * score.stopped:.1f} % of free ones, begins {100 * score.wrong_side:.1f} % of "
            f"turns to the other side, steps {score.step_error_m:.3f} m off"
        )
    click.echo(f"control student: {weights} and {weights.with_suffix('.onnx')}")
