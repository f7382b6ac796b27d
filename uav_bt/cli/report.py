"""`uav-bt report`: the results of campaigns on one page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import click

from uav_bt.campaign.report.campaign_report import write_report
from uav_bt.campaign.report.figures import Form
from uav_bt.campaign.report.paired import losses_of
from uav_bt.campaign.report.sources import read_sources
from uav_bt.cli.declare import command
from uav_bt.errors import MissionError
from uav_bt.option import Option


@command()
def report(
    ctx: click.Context,
    sources: Annotated[tuple[Path, ...], Option(form="DIR...")],
    *,
    out: Annotated[
        Path | None,
        Option(
            "The HTML page; figures and tables go beside it. Default: DIR/report.html",
            path="written",
            suffix=".html",
        ),
    ] = None,
    figures: Annotated[
        Literal[Form, "none"],
        Option("Form of the files of figures; the page always has PNGs inside."),
    ] = "png",
    all_pairs: Annotated[
        bool, Option("Compare all trees with each other, not only the first with each other one.")
    ] = False,
    not_worse: Annotated[
        bool, Option("Exit with 1 if a tree is worse than the first on the same flights.")
    ] = False,
) -> None:
    """Write the report of campaigns, their trees side by side.

    DIR is the folder of a `uav-bt campaign`, or a file with one flight per line. The page is
    self-contained. Its figures are also written to the folder report-figures beside it, and its
    tables (CSV) beside it.

    Trees that flew in the same scenes with the same seeds are compared flight by flight: McNemar's
    test of success, and paired differences of coverage, clearance, landing error and duration.
    Worse, for --not-worse, is a tree with two more failures among these flights, a median coverage
    more than 2 points lower or a 5th percentile of the clearance more than 2 cm lower.

    \b
    Examples:
      uav-bt report runs/land
      uav-bt report runs/before runs/after --out report.html --figures pdf
    """  # noqa: D301  (click needs the backspace)
    losses = losses_of(read_sources(sources)) if not_worse else []
    written = write_report(
        sources,
        out,
        figures=None if figures == "none" else figures,
        all_pairs=all_pairs,
        on_note=lambda note: click.echo(f"note: {note}", err=True),
    )
    for file in (written.page, *written.images, *written.tables):
        click.echo(file)
    if losses:
        click.echo("\n".join(f"worse: {loss}" for loss in losses), err=True)
        ctx.exit(MissionError.exit_code)
