"""`uav-bt net train teacher`: the teacher of segmentation."""

from __future__ import annotations

from pathlib import Path

import click

from perception.segmentation.teacher import TeacherConfig, save_teacher
from uav_bt.cli.command import Command
from uav_bt.cli.options import INPUT, RUNS, output_option
from uav_bt.cli.progress import progress_bars
from uav_bt.cli.training_options import Drawn, drawn_options
from uav_bt.cli.values import WholeNumber
from uav_bt.lab.shipped import load_lab
from uav_bt.learning import teacher as training
from uav_bt.learning.views import TRAINING_SCENES, ViewPlan


@click.command(cls=Command)
@output_option("--out", "The weights.", default=RUNS / "teacher.safetensors", suffix=".safetensors")
@click.option(
    "--picks",
    metavar="FILE",
    type=INPUT,
    help="Learn from the picks of this file instead of drawing them from the twin.",
)
@click.option(
    "--photographs",
    metavar="DIR",
    type=click.Path(path_type=Path),
    help="The folder of the photographs that --picks is about.",
)
@drawn_options(views=60)
@click.option(
    "--total",
    type=WholeNumber(min=1),
    default=6500,
    help="Picks that are drawn in the twin in all.",
)
def teacher(
    *,
    out: Path,
    picks: Path | None,
    photographs: Path | None,
    drawn: Drawn,
    total: int,
) -> None:
    """Train the teacher on picks: drawn from the twin, or clicked by a person."""
    if (photographs is None) != (picks is None):
        raise click.UsageError("--picks and --photographs belong together")
    config, classes = TeacherConfig(), load_lab().classes
    if picks is not None and photographs is not None:
        trained = training.train_teacher_on_photographs(picks, photographs, config, classes)
    else:
        plan = drawn.of(ViewPlan(scenes=TRAINING_SCENES))
        with progress_bars() as advance:
            found = training.draw_twin_picks(plan, config, total=total, advance=advance)
            trained = training.train_teacher(found, plan, config, classes, advance=advance)
    save_teacher(out, trained)
    click.echo(f"teacher of {len(trained.known)} classes: {out}")
