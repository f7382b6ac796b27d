"""`uav-bt lab frames` and `lab pick`: images of a lab from videos, and picks on them."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Annotated

import click
from annotated_types import Ge, Le

from perception.segmentation.training.pick_images import CHECK, TRAIN
from perception.segmentation.training.pick_server import make_pick_server
from perception.segmentation.training.pick_session import PickSession
from uav_bt.cli.declare import command
from uav_bt.cli.progress import progress_bars
from uav_bt.cli.shared import Count, table
from uav_bt.errors import InputError
from uav_bt.files import check_output
from uav_bt.lab.shipped import load_lab
from uav_bt.learning import lab_frames
from uav_bt.learning.lab_material import LabMaterial
from uav_bt.option import Option


@command()
def frames(
    lab: str,
    videos: Annotated[tuple[Path, ...], Option(form="VIDEOS...")],
    *,
    count: Count = lab_frames.DEFAULT_COUNT,
) -> None:
    """Take images of a place from videos: sharp ones that differ from each other.

    LAB is the lab, as --lab takes it. VIDEOS are video files of a phone or a drone, records of
    `uav-bt fly --record`, photographs, or folders of them. The images and a list of them
    (frames.csv) are written to the folder frames/ of the lab. A fifth of them is for checks: the
    network does not learn from those. Videos that were read before are left out, so the same
    command continues a run that was stopped, and further videos add images.

    Options:
        count: Most images of all videos together, shared by their durations.
    """
    with progress_bars() as advance:
        summary = lab_frames.take_frames(load_lab(lab), videos, count=count, advance=advance)
    _show(summary)
    if summary.refused:
        raise InputError("\n".join(summary.refused))


def _show(summary: lab_frames.FramesSummary) -> None:
    rows = [("source", "read", "blurred", "alike", "over count", "kept", "for check")]
    for one in summary.sources:
        counts = (one.read, one.blurred, one.alike, one.surplus, one.kept, one.for_check)
        rows.append((one.source, *map(str, counts)))
    for line in table(rows):
        click.echo(line)
    for one in summary.sources:
        earlier = ["taken in an earlier run"] if one.earlier else []
        for note in (*earlier, *one.notes):
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


@command()
def pick(lab: str, *, port: Annotated[int, Ge(0), Le(65535)] = 0) -> None:
    """Pick classes on the images of a lab, on a page in the browser.

    LAB is the name of a lab or its folder. Its images are those in frames/; each stroke is written
    to picks.csv in the folder of the lab. Call the command again to go on.

    `uav-bt lab train` learns from the picks.

    Options:
        port: Port of the page; 0 takes a free one.
    """
    material = LabMaterial(lab=load_lab(lab))
    uses = material.uses()
    check_output(material.picks)
    session = PickSession(material.frames, material.picks, material.lab.classes, uses)
    try:
        server = make_pick_server(session, port=port)
    except OSError as error:
        raise InputError(
            f"port {port} cannot be served ({error.strerror}): give another --port, or 0 for a "
            "free one"
        ) from error
    with server:
        click.echo(f"open http://127.0.0.1:{server.server_port}/ and pick; Ctrl-C when done")
        with contextlib.suppress(KeyboardInterrupt):
            server.serve_forever()
    _print_summary(session)
    click.echo(f"next: uav-bt lab train {lab}")


def _print_summary(session: PickSession) -> None:
    counts = session.counts()
    each = ", ".join(f"{name} {count}" for name, count in counts.items() if count)
    click.echo(f"{len(session.picks)} picks: {session.path}{f' ({each})' if each else ''}")
    picked = session.picked_images()
    click.echo(f"images with picks: {picked[TRAIN]} for training, {picked[CHECK]} for the check")
    missing = [name for name, count in counts.items() if not count]
    if missing:
        click.echo(
            f"warning: no picks of {', '.join(missing)}: the network never predicts these classes",
            err=True,
        )
    if session.picks and not picked[CHECK]:
        click.echo(
            "warning: no picks on images for the check: the network cannot be scored", err=True
        )
