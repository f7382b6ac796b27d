"""`uav-bt net perceive`: the whole of perception over a video, a folder or a live camera."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import click

from uav_bt.app.perceive import PerceiveOptions, PerceiveSummary
from uav_bt.app.perceive import perceive as perceive_source
from uav_bt.cli.command import Command
from uav_bt.cli.flight_options import flight_option
from uav_bt.cli.options import FOLDER, INPUT, grouped, output_option
from uav_bt.cli.progress import progress_bars
from uav_bt.cli.values import Number, WholeNumber
from uav_bt.errors import MissionError


def _options(
    *, gimbal_deg: float, seconds: float | None, inference_threads: int, **others: Any
) -> PerceiveOptions:
    return PerceiveOptions(
        gimbal_pitch_rad=math.radians(gimbal_deg),
        longest_s=seconds,
        threads=inference_threads,
        **others,
    )


@click.command(cls=Command)
@click.argument("source")
@output_option("--out", "Write the overlays there: an mp4 file.", suffix=".mp4")
@output_option("--json", "Write one JSON object a frame there, a line each.")
@click.option(
    "--masks",
    metavar="DIR",
    type=FOLDER,
    help="A new or empty folder for the class map of each frame, a PNG of class ids, and for "
    "classes.json.",
)
@grouped(
    "options",
    _options,
    camera=click.option(
        "--camera",
        type=INPUT,
        metavar="FILE",
        help="Camera file of `uav-bt lab calibrate`; without it, the ANAFI's video is assumed.",
    ),
    height_m=click.option(
        "--height-m",
        type=Number(min=0.0, min_open=True, max=100.0),
        default=1.5,
        help="Height of the camera above the ground, for all frames.",
    ),
    gimbal_deg=click.option(
        "--gimbal-deg",
        type=Number(min=-90.0, max=90.0),
        default=-30.0,
        help="Pitch of the camera, for all frames: 0 level, negative down.",
    ),
    telemetry=click.option(
        "--telemetry",
        type=INPUT,
        metavar="FILE",
        help="Record of the same flight, from `uav-bt fly --record`: height and gimbal by frame.",
    ),
    model=click.option(
        "--model",
        help="Depth network: 'any', 'depth', an ONNX file, or 'contact' (masks and geometry, no "
        "network); by default the one that belongs to the segmentation.",
    ),
    segmentation=click.option(
        "--segmentation",
        help="Segmentation: 'any', 'unet', 'teacher', or an ONNX file; by default 'unet' for "
        "flights and 'any' for all else.",
    ),
    classes=click.option(
        "--classes",
        type=INPUT,
        metavar="FILE",
        help="Class-mapping file of a foreign segmentation network.",
    ),
    sequence=click.option(
        "--sequence",
        is_flag=True,
        help="The images of the folder follow one another; without it each stands for itself.",
    ),
    every=click.option(
        "--every",
        type=WholeNumber(min=1),
        default=1,
        help="Process only one in this many frames.",
    ),
    seconds=click.option(
        "--seconds",
        type=Number(min=0.0, min_open=True),
        help="Stop after this much of the source.",
    ),
    inference_threads=flight_option("inference_threads"),
)
@click.pass_context
def perceive(
    ctx: click.Context,
    *,
    source: str,
    out: Path | None,
    json: Path | None,
    masks: Path | None,
    options: PerceiveOptions,
) -> None:
    """Show what perception makes of a video: masks, depth in metres, corridor, mark.

    SOURCE is a video file, a folder of images, an image, a live camera such as camera:0, or a
    record of `uav-bt fly --record`, which brings its camera and telemetry along. The images of a
    folder are unrelated unless --sequence or --telemetry is given. Ctrl-C keeps what was written
    and exits with 1.
    """
    with progress_bars() as advance:
        summary = perceive_source(
            source, options, out=out, lines=json, masks=masks, advance=advance
        )
    _show(summary)
    if out is not None and summary.frames:
        click.echo(f"video: {out}")
    if json is not None:
        click.echo(f"frames: {json}")
    if masks is not None and summary.frames:
        click.echo(f"masks: {masks}")
    if summary.interrupted:
        ctx.exit(MissionError.exit_code)


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
        *(("", f"none in {count}: {why}") for why, count in summary.without_depth.items()),
        *(("", f"contact only in {count}: {why}") for why, count in summary.in_part.items()),
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
