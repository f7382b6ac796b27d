"""`uav-bt report`: what came of campaigns, on one page."""

from __future__ import annotations

from pathlib import Path

import click

from uav_bt.campaign.report.campaign_report import write_report
from uav_bt.cli.command import Command
from uav_bt.cli.options import output_option


@click.command(cls=Command)
@click.argument(
    "sources", metavar="DIR...", nargs=-1, required=True, type=click.Path(path_type=Path)
)
@output_option("--out", "The HTML page; images and tables go beside it. Default: DIR/report.html")
def report(*, sources: tuple[Path, ...], out: Path | None) -> None:
    """Write the report of campaigns, their trees side by side.

    DIR is the folder of a `uav-bt campaign`, or a file with a flight a line. The page needs nothing
    but itself; its images (PNG) and tables (CSV) are written beside it as well.
    """
    written = write_report(sources, out, on_note=lambda note: click.echo(f"note: {note}", err=True))
    for file in (written.page, *written.images, *written.tables):
        click.echo(file)
