"""`uav-bt lab pick`: picks on the images of a lab, on a page in the browser."""

from __future__ import annotations

import contextlib

import click

from perception.segmentation.training.pick_images import CHECK, TRAIN
from perception.segmentation.training.pick_server import make_pick_server
from perception.segmentation.training.pick_session import PickSession
from uav_bt.cli.command import Command
from uav_bt.cli.values import WholeNumber
from uav_bt.errors import InputError
from uav_bt.files import check_output
from uav_bt.lab.shipped import load_lab
from uav_bt.learning.lab_material import LabMaterial


@click.command(cls=Command)
@click.argument("lab")
@click.option(
    "--port",
    type=WholeNumber(0, 65535),
    default=0,
    help="Port of the page; 0 takes a free one.",
)
def pick(*, lab: str, port: int) -> None:
    """Pick classes on the images of a lab, on a page in the browser.

    LAB is the name of a lab or its folder. Its images are those in frames/; each stroke is written
    to picks.csv in the folder of the lab. Call the command again to go on.

    `uav-bt lab train` learns from the picks.
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
