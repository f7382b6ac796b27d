"""`uav-bt net perceive`: the whole of perception over a video, a folder or a live camera."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import click

from uav_bt.app.perceive import PerceiveOptions, PerceiveSummary
from uav_bt.app.perceive import perceive as perceive_source
from uav_bt.cli.declare import command
from uav_bt.cli.progress import progress_bars
from uav_bt.cli.shared import OutputFile, OutputFolder
from uav_bt.errors import MissionError
from uav_bt.option import Option


@command()
def perceive(
    source: str,
    *,
    out: Annotated[Path | None, Option(path="written", suffix=".mp4")] = None,
    json: OutputFile = None,
    masks: OutputFolder = None,
    options: Annotated[PerceiveOptions, Option(parts=PerceiveOptions)],
) -> None:
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
    if out is not None and summary.frames:
        click.echo(f"video: {out}")
    if json is not None:
        click.echo(f"frames: {json}")
    if masks is not None and summary.frames:
        click.echo(f"masks: {masks}")
    if summary.interrupted:
        raise SystemExit(MissionError.exit_code)


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
