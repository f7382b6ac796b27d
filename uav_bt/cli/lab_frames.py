"""`uav-bt lab frames`: images of a lab from videos, for its network."""

from __future__ import annotations

from pathlib import Path

import click

from uav_bt.cli.command import Command
from uav_bt.cli.progress import progress_bars
from uav_bt.cli.values import WholeNumber
from uav_bt.errors import InputError
from uav_bt.lab.shipped import load_lab
from uav_bt.learning import lab_frames


@click.command(cls=Command)
@click.argument("lab")
@click.argument(
    "videos", nargs=-1, required=True, metavar="VIDEOS...", type=click.Path(path_type=Path)
)
@click.option(
    "--count",
    type=WholeNumber(min=1),
    default=lab_frames.DEFAULT_COUNT,
    help="Most images of all videos together, shared by their durations.",
)
def frames(*, lab: str, videos: tuple[Path, ...], count: int) -> None:
    """Take images of a place from videos: sharp ones that differ from each other.

    LAB is the lab, as --lab takes it. VIDEOS are video files of a phone or a drone, records of
    `uav-bt fly --record`, photographs, or folders of them. The images and a list of them
    (frames.csv) are written to the folder frames/ of the lab. A fifth of them is for checks: the
    network does not learn from those. Videos that were read before are left out, so the same
    command continues a run that was stopped, and further videos add images.
    """
    with progress_bars() as advance:
        summary = lab_frames.take_frames(load_lab(lab), videos, count=count, advance=advance)
    _show(summary)
    if summary.refused:
        raise InputError("\n".join(summary.refused))


def _show(summary: lab_frames.FramesSummary) -> None:
    width = max(len("source"), *(len(one.source) for one in summary.sources))
    click.echo(f"{'source':<{width}}    read  blurred  alike  over count  kept  for check")
    for one in summary.sources:
        left_out = f"{one.read:6d}  {one.blurred:7d}  {one.alike:5d}  {one.surplus:10d}"
        if one.earlier:
            left_out = f"{'taken in an earlier run':>34}"
        click.echo(f"{one.source:<{width}}  {left_out}  {one.kept:4d}  {one.for_check:9d}")
        for note in one.notes:
            click.echo(f"  {one.source}: {note}")
    for note in summary.notes:
        click.echo(f"skipped {note}")
    click.echo(f"images: {summary.total} in {summary.folder}")
    if summary.total < lab_frames.FEW:
        click.echo(
            f"Warning: {summary.total} images are few for a network, {lab_frames.FEW} are the "
            "least: film every part of the place from several heights and directions, and add the "
            "videos with the same command",
            err=True,
        )
