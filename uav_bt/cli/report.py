"""`uav-bt report`: the results of campaigns on one page."""

from __future__ import annotations

from pathlib import Path
from typing import cast, get_args

import click

from uav_bt.campaign.report.campaign_report import write_report
from uav_bt.campaign.report.figures import Form
from uav_bt.cli.command import Command
from uav_bt.cli.options import output_option


@click.command(cls=Command)
@click.argument(
    "sources", metavar="DIR...", nargs=-1, required=True, type=click.Path(path_type=Path)
)
@output_option("--out", "The HTML page; figures and tables go beside it. Default: DIR/report.html")
@click.option(
    "--figures",
    type=click.Choice([*get_args(Form), "none"]),
    default="png",
    help="Form of the files of figures; the page always has PNGs inside.",
)
def report(*, sources: tuple[Path, ...], out: Path | None, figures: str) -> None:
    """Write the report of campaigns, their trees side by side.

    DIR is the folder of a `uav-bt campaign`, or a file with one flight per line. The page is
    self-contained. Its figures are also written to the folder report-figures beside it, and its
    tables (CSV) beside it.
    """
    written = write_report(
        sources,
        out,
        figures=None if figures == "none" else cast("Form", figures),
        on_note=lambda note: click.echo(f"note: {note}", err=True),
    )
    for file in (written.page, *written.images, *written.tables):
        click.echo(file)
