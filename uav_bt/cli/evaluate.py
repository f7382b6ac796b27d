"""`uav-bt net evaluate`: how good a network is, measured against the twin's truth."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal

import click
import numpy as np

from perception.control.runtime import SHIPPED_STUDENT, OnnxControlStudent
from perception.depth.runtime import load_depth_estimator
from perception.networks.named import SHIPPED_UNETS
from perception.segmentation import runtime
from perception.segmentation.evaluation import SegmentationScore
from perception.segmentation.teacher import load_teacher
from uav_bt.cli.command import Command
from uav_bt.cli.depth_tables import depth_report
from uav_bt.cli.flight_options import flight_option
from uav_bt.cli.options import FOLDER, INPUT, output_option, records_argument
from uav_bt.cli.progress import progress_bars
from uav_bt.cli.training_options import Drawn, drawn_options
from uav_bt.cli.values import Number, WholeNumber
from uav_bt.files import writing
from uav_bt.lab.roles import ROLE_NAMES
from uav_bt.lab.shipped import load_lab
from uav_bt.learning import evaluation
from uav_bt.learning.dataset import read_advised_flights, records_of
from uav_bt.learning.depth_tables.images import ImagePlan
from uav_bt.learning.views import TESTING_SCENES, DepthViewPlan, ViewPlan
from uav_bt.types import Frame

_scores_option = output_option("--out", "Write the scores there too, as JSON.")


@click.command(cls=Command)
@click.option(
    "--model",
    default="unet",
    help="'unet', 'unet-fp32', 'teacher', a teacher's .safetensors file, or an ONNX network.",
)
@click.option(
    "--classes",
    metavar="FILE",
    type=INPUT,
    help="Class-mapping file of a foreign ONNX network.",
)
@click.option(
    "--lowered",
    type=Number(min=0.0, max=1.0),
    default=0.0,
    help="Share of the images whose camera is lowered further, as at the carpet's edge.",
)
@flight_option("image_size_px")
@flight_option("profile")
@drawn_options(views=100, seed=2)
@_scores_option
def segmentation(
    *,
    model: str,
    classes: Path | None,
    lowered: float,
    image_size_px: tuple[int, int],
    profile: str,
    drawn: Drawn,
    out: Path | None,
) -> None:
    """Score a segmentation against the twin's exact class ids; on the testing scenes by default.

    The score is the intersection over union over all pixels, by class and by role.
    """
    segment = _segmenter(model, classes)
    plan = drawn.of(
        ViewPlan(scenes=TESTING_SCENES, size_px=image_size_px, profile=profile, lowered=lowered)
    )
    with progress_bars() as advance:
        score = evaluation.evaluate_segmentation(segment, plan, load_lab().classes, advance=advance)
    result = {"model": model, "scenes": list(plan.scenes), "views": plan.views, "seed": plan.seed}
    result |= {"image_size": list(image_size_px), "profile": profile, "lowered": lowered}
    result |= _figures(score)
    _show(result)
    _write(result, out)


@click.command(cls=Command)
@click.option(
    "--model",
    default="depth",
    help="'depth', 'depth-fp32', an ONNX network, or 'contact': masks and geometry, no network.",
)
@click.option(
    "--masks",
    type=click.Choice(["unet", "exact"]),
    default="unet",
    help="Class maps: the network's, as in a flight, or the twin's exact ones.",
)
@click.option(
    "--tables",
    default="pairs,distance,sensitivity,corridor",
    metavar="NAMES",
    help="The tables, with commas between.",
)
@drawn_options(views=170, seed=21)
@_scores_option
def depth(
    *,
    model: str,
    masks: Literal["unet", "exact"],
    tables: str,
    drawn: Drawn,
    out: Path | None,
) -> None:
    """Measure metric depth against the twin's exact depth; on the testing scenes by default.

    Prints the paper's tables, its figures beside ours: lengths of obstacles' edges, distances from
    the camera, what wrong telemetry and masks cost, and what the safety corridor sees.
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


@click.command(cls=Command)
@records_argument
@click.option(
    "--model",
    metavar="FILE",
    type=INPUT,
    default=SHIPPED_STUDENT,
    show_default=False,
    help="A control student's ONNX file; the shipped one if not given.",
)
@click.option(
    "--views",
    type=WholeNumber(min=1),
    default=2000,
    help="Number of views that are scored.",
)
@click.option(
    "--views-kept",
    metavar="DIR",
    type=FOLDER,
    help="Where `net train student` keeps the records' views, to read them once only.",
)
@_scores_option
def student(
    *,
    records: tuple[Path, ...],
    model: Path,
    views: int,
    views_kept: Path | None,
    out: Path | None,
) -> None:
    """Measure how well a control student agrees with the rule that advised in RECORDS.

    RECORDS are files that `uav-bt net collect` made, or folders of them.
    """
    network = OnnxControlStudent(model, threads=2)
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


def _segmenter(model: str, classes: Path | None) -> Callable[[Any], Any]:
    if classes is not None and not model.endswith(".onnx"):
        raise click.UsageError("--classes belongs to an ONNX network")
    if model in SHIPPED_UNETS:
        return runtime.shipped_unet(model, threads=2).ids
    if model != "teacher" and not model.endswith(".safetensors"):
        return runtime.OnnxSegmenter(Path(model), load_lab().classes, classes, threads=2).ids
    teacher = (
        runtime.shipped_teacher(load_lab().classes)
        if model == "teacher"
        else runtime.TeacherSegmenter(load_teacher(Path(model), load_lab().classes))
    )

    def segment(rgb: Any) -> Any:
        frame = Frame(
            image=np.asarray(rgb, dtype=np.uint8), index=0, captured_s=0.0, gimbal_pitch_rad=0.0
        )
        return teacher.segment(frame).ids

    return segment


def _figures(score: SegmentationScore) -> dict[str, Any]:
    return {
        "pictures": score.images,
        "accuracy": round(score.accuracy, 4),
        "role_miou": round(score.role_miou, 4),
        "miou": round(score.miou, 4),
        "role_iou": _by_name(ROLE_NAMES, score.role_iou),
        "class_iou": _by_name(score.classes.names, score.iou),
    }


def _by_name(names: Any, values: Any) -> dict[str, float | None]:
    # A class that no image shows has no score: NaN, which equals nothing.
    return {
        name: round(float(value), 4) if value == value else None  # noqa: PLR0124
        for name, value in zip(names, values, strict=True)
    }


def _show(result: dict[str, Any]) -> None:
    click.echo(f"{result['model']} on {result['pictures']} images of {', '.join(result['scenes'])}")
    click.echo(f"  pixel accuracy    {result['accuracy']:.4f}")
    click.echo(f"  mIoU, 4 roles     {result['role_miou']:.4f}")
    title = f"mIoU, {len(result['class_iou'])} classes"
    click.echo(f"  {title:<17} {result['miou']:.4f}")
    for title in ("role_iou", "class_iou"):
        click.echo(f"  {title.replace('_', ', ').replace('iou', 'IoU')}")
        for name, value in result[title].items():
            click.echo(f"    {name:<16}{'-' if value is None else format(value, '.4f')}")
