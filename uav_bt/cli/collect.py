"""`uav-bt net collect`: flights for the control student to learn from."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from uav_bt.campaign.runner import LocalBackend
from uav_bt.cli.command import Command
from uav_bt.cli.flight_options import flight_option
from uav_bt.cli.options import FOLDER, RUNS, grouped, workers_option
from uav_bt.cli.progress import campaign_progress
from uav_bt.cli.values import WholeNumber
from uav_bt.errors import MissionError
from uav_bt.learning import collecting
from uav_bt.learning.views import TRAINING_SCENES
from uav_bt.plugins import need


@click.command(cls=Command)
@click.argument("tree", metavar="TREE")
@grouped(
    "chosen",
    dict,
    flights=click.option(
        "--flights",
        type=WholeNumber(min=1),
        default=96,
        help="Minimum in all, shared evenly over scenes and profiles.",
    ),
    scenes=click.option(
        "--scene",
        "scenes",
        metavar="SCENE",
        multiple=True,
        default=TRAINING_SCENES,
        show_default=False,
        help="Scene to begin with, by name or file. Repeatable; default: all training scenes.",
    ),
    profiles=click.option(
        "--profile",
        "profiles",
        type=click.Choice(["ideal", "lab", "harsh", "lab-instant", "harsh-instant"]),
        multiple=True,
        default=("lab", "harsh"),
        show_default=False,
        help="How imperfect the twin is. Repeatable; default: lab and harsh.",
    ),
    layouts=click.option(
        "--layouts/--no-layouts",
        default=True,
        help="Vary the boxes, too, in all flights but the first of each scene; light always "
        "varies.",
    ),
    seed=flight_option("seed"),
    image_size_px=flight_option("image_size_px"),
)
@click.option(
    "--student",
    metavar="FILE",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="Let this control student (ONNX) fly in place of every policy of the tree.",
)
@flight_option("policies")
@workers_option
@click.option(
    "--out",
    metavar="DIR",
    type=FOLDER,
    help="Where flights and records are kept; default: runs/collected-TREE.",
)
@click.pass_context
def collect(
    ctx: click.Context,
    *,
    tree: str,
    chosen: dict[str, Any],
    student: Path | None,
    policies: dict[str, str],
    workers: int | None,
    out: Path | None,
) -> None:
    """Fly a mission many times and record the rule's advice on every view.

    TREE has an <Advise/> leaf: explore_and_land_advised, where the rule flies, or
    explore_and_land_student_advised, where the student flies and the rule's answers are
    recorded. `uav-bt net train student DIR...` learns from the records. The same command continues
    a collection that was stopped. A flight takes about 45 s of a core.
    """
    need("record")
    if student is not None:
        # Absolute: workers have another working directory.
        flying = collecting.nodes_under_policy(tree)
        policies = {**dict.fromkeys(flying, f"student:{student.resolve()}"), **policies}
    plan = collecting.CollectionPlan(tree=tree, policies=policies, **chosen)
    folder = out or RUNS / f"collected-{Path(tree).stem}"
    with campaign_progress(len(plan)) as progress:
        try:
            records = collecting.collect(
                plan,
                folder,
                backend=LocalBackend(workers),
                on_flight=progress.add,
                on_note=progress.note,
            )
        except KeyboardInterrupt:
            progress.note(f"stopped; the same command continues from the files in {folder}")
            ctx.exit(MissionError.exit_code)
    size_mb = sum(record.stat().st_size for record in records) / 1e6
    click.echo(f"{len(records)} records, {size_mb:.0f} MB: {folder}")
