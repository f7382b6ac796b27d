"""`uav-bt net perceive`: the whole of perception over a video, a folder or a live camera."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import click
from annotated_types import Ge, Gt, Le

from uav_bt.app.option_values import Threads
from uav_bt.app.perceive import PerceiveOptions, PerceiveSummary
from uav_bt.app.perceive import perceive as perceive_source
from uav_bt.cli.declare import command
from uav_bt.cli.progress import progress_bars
from uav_bt.errors import MissionError
from uav_bt.option import Option


def _options(
    *,
    camera: Annotated[
        Path | None,
        Option(
            "Camera file of `uav-bt lab calibrate`; without it, the ANAFI's video is assumed.",
            path="read",
        ),
    ] = None,
    height_m: Annotated[
        float, Gt(0), Le(100), Option("Height of the camera above the ground, for all frames.")
    ] = 1.5,
    gimbal_deg: Annotated[
        float,
        Ge(-90),
        Le(90),
        Option("Pitch of the camera, for all frames: 0 level, negative down."),
    ] = -30.0,
    telemetry: Annotated[
        Path | None,
        Option(
            "Record of the same flight, from `uav-bt fly --record`: height and gimbal by frame.",
            path="read",
        ),
    ] = None,
    model: Annotated[
        str | None,
        Option(
            "Depth network: 'any', 'depth', an ONNX file, or 'contact' (masks and geometry, no "
            "network); by default the one that belongs to the segmentation."
        ),
    ] = None,
    segmentation: Annotated[
        str | None,
        Option(
            "Segmentation: 'any', 'unet', 'teacher', or an ONNX file; by default 'unet' for "
            "flights and 'any' for all else."
        ),
    ] = None,
    classes: Annotated[
        Path | None, Option("Class-mapping file of a foreign segmentation network.", path="read")
    ] = None,
    sequence: Annotated[
        bool,
        Option("The images of the folder follow one another; without it each stands for itself."),
    ] = False,
    every: Annotated[int, Ge(1), Option("Process only one in this many frames.")] = 1,
    seconds: Annotated[float | None, Gt(0), Option("Stop after this much of the source.")] = None,
    inference_threads: Threads = 1,
) -> PerceiveOptions:
    return PerceiveOptions(
        camera=camera,
        height_m=height_m,
        gimbal_pitch_rad=math.radians(gimbal_deg),
        telemetry=telemetry,
        model=model,
        segmentation=segmentation,
        classes=classes,
        sequence=sequence,
        every=every,
        longest_s=seconds,
        threads=inference_threads,
    )


@command()
def perceive(
    ctx: click.Context,
    source: str,
    *,
    out: Annotated[
        Path | None, Option("Write the overlays there: an mp4 file.", path="written", suffix=".mp4")
    ] = None,
    json: Annotated[
        Path | None, Option("Write one JSON object a frame there, a line each.", path="written")
    ] = None,
    masks: Annotated[
        Path | None,
        Option(
            "A new or empty folder for the class map of each frame, a PNG of class ids, and for "
            "classes.json.",
            path="folder",
        ),
    ] = None,
    options: Annotated[PerceiveOptions, Option(parts=_options)],
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
