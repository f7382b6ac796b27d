"""`uav-bt pick`: points of photographs of which a person says the class."""

from __future__ import annotations

import contextlib
from pathlib import Path

import click

from uav_bt.cli.options import output_option

__all__ = ["pick"]


@click.command()
@click.argument("folder", type=click.Path(path_type=Path))
@output_option("--picks", "The CSV file; picks.csv if not given.")
@click.option(
    "--port", type=click.IntRange(0, 65535), default=0, help="Of the page; 0: a free one."
)
def pick(*, folder: Path, picks: Path | None, port: int) -> None:
    """Click picks that the teacher learns from, on a page in the browser.

    FOLDER holds the photographs; `uav-bt train teacher` learns from both.
    """
    from perception.segmentation.training.pick_tool import (  # noqa: PLC0415 - late, for --help
        PickSession,
        make_pick_server,
    )

    file = Path("picks.csv") if picks is None else picks
    session = PickSession(folder, file)
    with make_pick_server(session, port=port) as server:
        click.echo(f"open http://127.0.0.1:{server.server_port}/ and click; Ctrl-C when done")
        with contextlib.suppress(KeyboardInterrupt):
            server.serve_forever()
    click.echo(f"{len(session.picks)} picks: {file}")
