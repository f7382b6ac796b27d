"""`uav-bt net perceive` and `net evaluate`: what networks make of a video, how good they are."""

from __future__ import annotations

import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeVar

import click

from perception.control.runtime import SHIPPED_STUDENT, OnnxControlStudent
from perception.depth.runtime import load_depth_estimator
from perception.segmentation import runtime
from uav_bt.app.option_values import Seed
from uav_bt.app.perceive import PerceiveOptions, PerceiveSummary
from uav_bt.app.perceive import perceive as perceive_source
from uav_bt.cli.declare import command
from uav_bt.cli.progress import progress_bars
from uav_bt.cli.shared import (
    Count,
    InputFile,
    OutputFile,
    OutputFolder,
    Records,
    table,
    write_scores,
)
from uav_bt.learning.dataset import evaluate_student, read_advised_flights, records_of
from uav_bt.learning.depth_evaluation import evaluate_depth
from uav_bt.learning.views import TESTING_SCENES, DepthViewPlan, ViewPlan
from uav_bt.option import Option

_FIGURES: Final = {
    "edges": ("mean", "median", "rmse", "std", "corr", "known"),
    "distances": ("mean", "median", "max", "known"),
    "obstacles": ("mean", "known"),
}
_PAPER: Final = (
    *("0.0740", "0.0597", "0.0988", "0.0655", "0.8342", ""),
    *("0.1440", "0.1628", "0.3714", "", "", ""),
)
_Plan = TypeVar("_Plan", ViewPlan, DepthViewPlan)


@dataclass(frozen=True, kw_only=True)
class Drawn:
    """Which images the twin draws; without scenes those of the plan.

    Options:
        scenes: Draw images of this scene, by name or file, not of the default ones. Repeatable.
        views: Images of each scene.
    """

    scenes: Annotated[tuple[str, ...], Option(form="--scene SCENE")] = ()
    views: Count = 50
    seed: Seed = 5

    def of(self, plan: _Plan) -> _Plan:
        """Return a plan with these values."""
        scenes = self.scenes or plan.scenes
        return replace(plan, scenes=scenes, views=self.views, seed=self.seed)


@command()
def depth(
    *,
    model: str = "depth",
    masks: Literal["unet", "exact"] = "unet",
    drawn: Annotated[Drawn, Option(parts=Drawn, defaults={"views": 170, "seed": 21})],
    out: OutputFile = None,
) -> None:
    """Measure metric depth against the twin's exact depth; on the testing scenes by default.

    Prints errors beside the paper's: lengths of obstacles' edges and distances from the camera,
    by the paper's three scales, by ground contact alone, and as flown.

    Options:
        model: 'depth', an ONNX network, or 'contact': masks and geometry, no network.
        masks: Class maps: the network's, as in a flight, or the twin's exact ones.
        out: Write the scores there too, as JSON.
    """
    network = None if model == "contact" else load_depth_estimator(model, threads=2)
    plan = drawn.of(DepthViewPlan(scenes=TESTING_SCENES))
    unet = runtime.shipped_unet(threads=2)
    with progress_bars() as advance:
        measured = evaluate_depth(plan, masks, unet, network, advance=advance)
    click.echo(
        f"{model} on {measured['images']} images of {', '.join(plan.scenes)}, {masks} masks, "
        f"telemetry of profile '{plan.profile}'\n"
        f"Errors in metres of {measured['edges']} edges of obstacles and of {measured['points']} "
        "distances of 0.3 to 5 m; 'known': the share for which a method has an estimate"
    )
    click.echo(depth_table(measured["rows"]))
    write_scores({"model": model, **measured}, out)


def depth_table(rows: Sequence[Mapping[str, Any]]) -> str:
    """Return a table of errors, the paper's first."""
    figures = [(what, name) for what, names in _FIGURES.items() for name in names]
    heads = ["", *(f"{what} {name}" for what, name in figures)]
    measured = (
        [row["method"], *(_figure(row[what], name) for what, name in figures)] for row in rows
    )
    return table([heads, ["the paper (adaptive)", *_PAPER], *measured])


def _figure(error: Mapping[str, Any], name: str) -> str:
    if name == "known":
        return f"{error['valid'] / error['total']:.0%}" if error["total"] else "-"
    value = error["correlation" if name == "corr" else f"{name}_m"]
    return "-" if value is None else f"{value:.4f}"


@command()
def student(
    records: Records,
    *,
    model: InputFile = None,
    views: Count = 2000,
    out: OutputFile = None,
) -> None:
    """Measure how well a control student agrees with the rule that advised in RECORDS.

    RECORDS are files that `uav-bt net collect` made, or folders of them.

    Options:
        model: A control student's ONNX file; the shipped one if not given.
        views: Number of views that are scored.
        out: Write the scores there too, as JSON.
    """
    network = OnnxControlStudent(model or SHIPPED_STUDENT, threads=2)
    with tempfile.TemporaryDirectory() as folder, progress_bars() as advance:
        found = records_of(records)
        flights = read_advised_flights(found, network.config, Path(folder), advance=advance)
        score = evaluate_student(flights, network, max_windows=views)
    click.echo(f"flights: {len(flights)}, views scored: {score.windows}")
    for name, value in score.to_json().items():
        if name != "windows":
            click.echo(f"  {name:<18}{'-' if value is None else format(value, '.4f')}")
    write_scores(score.to_json(), out)


@command()
def perceive(
    source: str,
    *,
    out: Annotated[Path | None, Option(path="written", suffix=".mp4")] = None,
    json: OutputFile = None,
    masks: OutputFolder = None,
    options: Annotated[PerceiveOptions, Option(parts=PerceiveOptions)],
) -> bool:
    """Show what perception makes of a video: masks, depth in metres, corridor, mark.

    SOURCE is a video file, a folder of images, an image, a live camera such as camera:0, or a
    record of `uav-bt fly --record`, which brings its camera and telemetry along. The images of a
    folder are unrelated unless --sequence or --telemetry is given. Ctrl-C keeps what was written
    and exits with 1.

    Options:
        out: Write the overlays there: an mp4 file.
        json: Write one JSON object a frame there, a line each.
        masks: A new or empty folder for the class map of each frame, a PNG of class ids, and for
            classes.json.
    """
    with progress_bars() as advance:
        summary = perceive_source(
            source, options, out=out, lines=json, masks=masks, advance=advance
        )
    _show(summary)
    for what, path in (("video", out), ("frames", json), ("masks", masks)):
        if path is not None and path.exists():
            click.echo(f"{what}: {path}")
    return not summary.interrupted


def _show(summary: PerceiveSummary) -> None:
    none = sum(summary.without_depth.values())
    stopped = ", then interrupted" if summary.interrupted else ""
    if summary.unrelated and summary.frames > 1:
        stopped = f"{stopped}, each for itself (--sequence: they follow one another)"
    rows = [
        ("frames", f"{summary.frames}{stopped}"),
        ("camera", summary.camera),
        ("telemetry", summary.telemetry),
        ("metric depth", f"in {summary.frames - none} frames, none in {none}"),
        *(("", f"none in {count}: {why}") for why, count in summary.without_depth.most_common()),
        *(("", f"contact only in {count}: {why}") for why, count in summary.in_part.most_common()),
        ("mark", f"seen in {summary.with_mark} frames"),
        *(
            (name, f"{spent.p50:.1f} ms median, {spent.p99:.1f} ms 99 %")
            for name, spent in summary.stage_ms.items()
        ),
    ]
    for name, value in rows:
        click.echo(f"{name:<15} {value}")
    for line in summary.skipped:
        click.echo(f"skipped {line}")
    for line in summary.warnings:
        click.echo(f"Warning: {line}", err=True)
