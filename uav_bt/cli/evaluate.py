"""`uav-bt net evaluate`: how good a network is, measured against the twin's truth."""

from __future__ import annotations

import json
import tempfile
from pathlib import Path
from typing import Annotated, Any, Literal

import click
from annotated_types import Ge

from perception.control.runtime import SHIPPED_STUDENT, OnnxControlStudent
from perception.depth.runtime import load_depth_estimator
from perception.segmentation import runtime
from uav_bt.cli.declare import command
from uav_bt.cli.depth_tables import depth_report
from uav_bt.cli.progress import progress_bars
from uav_bt.cli.shared import Records
from uav_bt.cli.training_options import Drawn
from uav_bt.files import writing
from uav_bt.learning import evaluation
from uav_bt.learning.dataset import read_advised_flights, records_of
from uav_bt.learning.depth_tables.images import ImagePlan
from uav_bt.learning.views import TESTING_SCENES, DepthViewPlan
from uav_bt.option import Option

_Scores = Annotated[Path | None, Option("Write the scores there too, as JSON.", path="written")]


@command()
def depth(
    *,
    model: Annotated[
        str, Option("'depth', an ONNX network, or 'contact': masks and geometry, no network.")
    ] = "depth",
    masks: Annotated[
        Literal["unet", "exact"],
        Option("Class maps: the network's, as in a flight, or the twin's exact ones."),
    ] = "unet",
    tables: Annotated[
        str, Option("The tables, with commas between.", "NAMES")
    ] = "pairs,distance,sensitivity,corridor",
    drawn: Annotated[Drawn, Option(parts=Drawn, defaults={"views": 170, "seed": 21})],
    out: _Scores = None,
) -> None:
    """Measure metric depth against the twin's exact depth; on the testing scenes by default.

    Prints the paper's tables, its figures beside ours: lengths of obstacles' edges, distances from
    the camera, errors by wrong telemetry and masks, and errors of the safety corridor.
    """
    network = None if model == "contact" else load_depth_estimator(model, threads=2)
    plan = ImagePlan(views=drawn.of(DepthViewPlan(scenes=TESTING_SCENES)), masks=masks)
    wanted = [name.strip() for name in tables.split(",") if name.strip()]
    with progress_bars() as advance:
        measured = evaluation.evaluate_depth(
            plan, runtime.shipped_unet(threads=2), network, tables=wanted, advance=advance
        )
    result = {"model": model, **measured}
    for line in depth_report(result):
        click.echo(line)
    _write(result, out)


@command()
def student(
    records: Records,
    *,
    model: Annotated[
        Path | None,
        Option("A control student's ONNX file; the shipped one if not given.", path="read"),
    ] = None,
    views: Annotated[int, Ge(1), Option("Number of views that are scored.")] = 2000,
    views_kept: Annotated[
        Path | None,
        Option(
            "Where `net train student` keeps the records' views, to read them once only.",
            path="folder",
        ),
    ] = None,
    out: _Scores = None,
) -> None:
    """Measure how well a control student agrees with the rule that advised in RECORDS.

    RECORDS are files that `uav-bt net collect` made, or folders of them.
    """
    network = OnnxControlStudent(model or SHIPPED_STUDENT, threads=2)
    with tempfile.TemporaryDirectory() as folder, progress_bars() as advance:
        flights = read_advised_flights(
            records_of(records), network.config, views_kept or Path(folder), advance=advance
        )
        score = evaluation.evaluate_student(flights, network, max_windows=views)
    click.echo(f"flights: {len(flights)}, views scored: {score.windows}")
    for name, value in score.to_json().items():
        if name != "windows":
            click.echo(f"  {name:<18}{'-' if value is None else format(value, '.4f')}")
    _write(score.to_json(), out)


def _write(scores: dict[str, Any], out: Path | None) -> None:
    if out is not None:
        with writing(out):
            out.write_text(json.dumps(scores, indent=2) + "\n", encoding="utf-8")
        click.echo(f"scores: {out}")
