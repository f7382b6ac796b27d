"""`uav-bt net pick`: picks for the teacher of segmentation."""

from __future__ import annotations

import contextlib
from pathlib import Path

import click

from perception.segmentation.training.pick_tool import PickSession, make_pick_server
from uav_bt.cli.command import Command
from uav_bt.cli.options import output_option
from uav_bt.cli.values import WholeNumber
from uav_bt.lab.shipped import load_lab


@click.command(cls=Command)
@click.argument("folder", type=click.Path(path_type=Path))
@output_option("--picks", "The CSV file.", default=Path("picks.csv"))
@click.option(
    "--port",
    type=WholeNumber(0, 65535),
    default=0,
    help="Port of the page; 0 takes a free one.",
)
def pick(*, folder: Path, picks: Path, port: int) -> None:
    """Click picks that the teacher learns from, on a page in the browser.

    FOLDER holds the photographs. `uav-bt lab train` learns from them and the picks.
    """
    session = PickSession(folder, picks, load_lab().classes)
    with make_pick_server(session, port=port) as server:
        click.echo(f"open http://127.0.0.1:{server.server_port}/ and click; Ctrl-C when done")
        with contextlib.suppress(KeyboardInterrupt):
            server.serve_forever()
    click.echo(f"{len(session.picks)} picks: {picks}")
