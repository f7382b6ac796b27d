"""`uav-bt evaluate`: how good a network is, measured against the twin's truth."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from uav_bt.cli.options import output_option, seed_option, views_option
from uav_bt.cli.progress import progress_bars
from uav_bt.plugins import need

if TYPE_CHECKING:
    from perception.segmentation.evaluation import SegmentationScore

__all__ = ["evaluate"]


@click.group()
def evaluate() -> None:
    """Measure what perception is worth."""


@evaluate.command()
@click.option(
    "--model",
    default="unet",
    show_default=True,
    help="'unet', 'unet-fp32', 'teacher', a teacher's .safetensors file, or an ONNX network.",
)
@click.option(
    "--classes",
    type=click.Path(path_type=Path),
    help="Class-mapping file of a foreign ONNX network.",
)
@views_option(100)
@seed_option(2)
@output_option("--out", "Write the scores there too, as JSON.")
def segmentation(
    *,
    model: str,
    classes: Path | None,
    scenes: tuple[str, ...],
    views: int,
    seed: int,
    out: Path | None,
) -> None:
    """Score a segmentation against the twin's exact class ids; on the testing scenes by default.

    The score is the intersection over union over all pixels, by class and by navigation group.
    """
    from uav_bt.learning import segmentation as training  # noqa: PLC0415 - late, for --help
    from uav_bt.learning.scenes import TESTING_SCENES  # noqa: PLC0415 - late, for --help
    from uav_bt.learning.views import ViewPlan  # noqa: PLC0415 - late, for --help

    segment = _segmenter(model, classes)
    plan = ViewPlan(scenes=scenes or TESTING_SCENES, views=views, seed=seed)
    with progress_bars() as advance:
        score = training.evaluate_segmentation(segment, plan, advance=advance)
    result = {"model": model, "scenes": list(plan.scenes), "views": views, "seed": seed}
    result |= _figures(score)
    _show(result)
    if out is not None:
        out.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
        click.echo(f"scores: {out}")


@evaluate.command()
@click.option(
    "--model",
    default="depth",
    show_default=True,
    help="'depth', 'depth-fp32', an ONNX network, or 'footing': the ways that need no network.",
)
@click.option(
    "--masks",
    type=click.Choice(["unet", "exact"]),
    default="unet",
    show_default=True,
    help="Whose class maps: those a flight has, or the twin's exact ones.",
)
@click.option(
    "--tables",
    default="pairs,distance,sensitivity,corridor",
    show_default=True,
    metavar="NAMES",
    help="Which tables, with commas between.",
)
@views_option(170)
@seed_option(21)
@output_option("--out", "Write the tables there too, as JSON.")
def depth(
    *,
    model: str,
    masks: Literal["unet", "exact"],
    tables: str,
    scenes: tuple[str, ...],
    views: int,
    seed: int,
    out: Path | None,
) -> None:
    """Measure metric depth against the twin's exact depth; on the testing scenes by default.

    Prints the paper's tables, its figures beside ours: lengths of obstacles' edges, distances from
    the camera, what wrong telemetry and masks cost, and what the safety corridor sees.
    """
    from perception.depth.runtime import load_depth_estimator  # noqa: PLC0415 - late, for --help
    from perception.segmentation.runtime import shipped_unet  # noqa: PLC0415
    from uav_bt.cli.depth_tables import depth_report  # noqa: PLC0415
    from uav_bt.learning.depth import DepthViewPlan  # noqa: PLC0415
    from uav_bt.learning.depth_tables import images, report  # noqa: PLC0415
    from uav_bt.learning.scenes import TESTING_SCENES  # noqa: PLC0415 - late, for --help

    network = None if model == "footing" else load_depth_estimator(model, threads=2)
    plan = images.ImagePlan(
        views=DepthViewPlan(scenes=scenes or TESTING_SCENES, views=views, seed=seed), masks=masks
    )
    wanted = [name.strip() for name in tables.split(",") if name.strip()]
    with progress_bars() as advance:
        measured = report.evaluate_depth(
            plan, shipped_unet(threads=2), network, tables=wanted, advance=advance
        )
    result = {"model": model, **measured}
    for line in depth_report(result):
        click.echo(line)
    if out is not None:
        out.write_text(json.dumps(result, indent=2) + "\n", encoding="utf-8")
        click.echo(f"tables: {out}")


@evaluate.command()
@click.argument(
    "records", nargs=-1, required=True, metavar="RECORDS...", type=click.Path(path_type=Path)
)
@click.option(
    "--model",
    type=click.Path(dir_okay=False, path_type=Path),
    help="A control student's ONNX file; the shipped one if not given.",
)
@click.option(
    "--views", type=click.IntRange(min=1), default=2000, show_default=True, help="That are scored."
)
@click.option(
    "--views-kept",
    type=click.Path(file_okay=False, path_type=Path),
    help="Where `train student` keeps the records' views, to read them once only.",
)
@output_option("--out", "Write the scores there too, as JSON.")
def student(
    *,
    records: tuple[Path, ...],
    model: Path | None,
    views: int,
    views_kept: Path | None,
    out: Path | None,
) -> None:
    """Measure how well a control student agrees with the rule that advised in RECORDS.

    RECORDS are files that `uav-bt collect` made, or folders of them.
    """
    need("record", "mcap", "foxglove")
    from perception.control.runtime import (  # noqa: PLC0415 - late, for --help
        SHIPPED_STUDENT,
        OnnxControlStudent,
    )
    from uav_bt.learning import student as training  # noqa: PLC0415
    from uav_bt.learning.dataset import records_of  # noqa: PLC0415

    flies = OnnxControlStudent(model or SHIPPED_STUDENT, threads=2)
    with tempfile.TemporaryDirectory() as folder, progress_bars() as advance:
        flights = training.read_advised_flights(
            records_of(records), flies.config, views_kept or Path(folder), advance=advance
        )
        score = training.evaluate_student(flights, flies, most=views)
    click.echo(f"flights: {len(flights)}, views scored: {score.windows}")
    for name, value in score.to_json().items():
        if name != "windows":
            click.echo(f"  {name:<18}{'-' if value is None else format(value, '.4f')}")
    if out is not None:
        out.write_text(json.dumps(score.to_json(), indent=2) + "\n", encoding="utf-8")
        click.echo(f"scores: {out}")


def _segmenter(model: str, classes: Path | None) -> Callable[[Any], Any]:
    import numpy as np  # noqa: PLC0415 - late, for --help

    from perception.segmentation import runtime  # noqa: PLC0415
    from perception.segmentation.teacher import load_teacher  # noqa: PLC0415
    from uav_bt.types import Frame  # noqa: PLC0415

    if classes is not None and not model.endswith(".onnx"):
        raise click.UsageError("--classes belongs to an ONNX network")
    if model in runtime.SHIPPED_UNETS:
        return runtime.shipped_unet(model, threads=2).ids
    if model != "teacher" and not model.endswith(".safetensors"):
        return runtime.OnnxSegmenter(Path(model), mapping=classes, threads=2).ids
    teacher = (
        runtime.shipped_teacher()
        if model == "teacher"
        else runtime.TeacherSegmenter(load_teacher(Path(model)))
    )

    def segment(rgb: Any) -> Any:
        frame = Frame(
            image=np.asarray(rgb, dtype=np.uint8), index=0, captured_s=0.0, gimbal_pitch_rad=0.0
        )
        return teacher.segment(frame).ids

    return segment


def _figures(score: SegmentationScore) -> dict[str, Any]:
    from uav_bt.classes import CLASS_NAMES, GROUP_NAMES  # noqa: PLC0415 - late, for --help

    return {
        "pictures": score.images,
        "accuracy": round(score.accuracy, 4),
        "group_miou": round(score.group_miou, 4),
        "miou": round(score.miou, 4),
        "group_iou": _by_name(GROUP_NAMES, score.group_iou),
        "class_iou": _by_name(CLASS_NAMES, score.iou),
    }


def _by_name(names: Any, values: Any) -> dict[str, float | None]:
    # A class that no picture shows has no score: it is not a number, and equals nothing.
    return {
        name: round(float(value), 4) if value == value else None  # noqa: PLR0124
        for name, value in zip(names, values, strict=True)
    }


def _show(result: dict[str, Any]) -> None:
    click.echo(
        f"{result['model']} on {result['pictures']} pictures of {', '.join(result['scenes'])}"
    )
    click.echo(f"  pixel accuracy    {result['accuracy']:.4f}")
    click.echo(f"  mIoU, 4 groups    {result['group_miou']:.4f}")
    click.echo(f"  mIoU, 17 classes  {result['miou']:.4f}")
    for title in ("group_iou", "class_iou"):
        click.echo(f"  {title.replace('_', ', ').replace('iou', 'IoU')}")
        for name, value in result[title].items():
            click.echo(f"    {name:<16}{'-' if value is None else format(value, '.4f')}")
