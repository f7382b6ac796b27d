"""`uav-bt view`: look at a recorded flight."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from uav_bt.cli.options import output_option
from uav_bt.cli.progress import progress_bars

if TYPE_CHECKING:
    from uav_bt.app.view.recorded import RecordedFlight

__all__ = ["view"]


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@output_option("--save", "Keep the view: an rrd file, which `rerun FILE` opens anywhere.")
@click.option("--web", is_flag=True, help="Show it in a browser on this machine, until Ctrl-C.")
@output_option("--video", "Make a film of it: an mp4 file.")
@click.option(
    "--speed",
    type=click.FloatRange(0.1, 100.0),
    default=1.0,
    show_default=True,
    help="The film runs so many times faster than the flight.",
)
@click.option(
    "--from", "from_s", type=click.FloatRange(min=0.0), help="Begin here, seconds into the record."
)
@click.option("--to", "to_s", type=click.FloatRange(min=0.0), help="End here, likewise.")
def view(
    *,
    file: Path,
    save: Path | None,
    web: bool,
    video: Path | None,
    speed: float,
    from_s: float | None,
    to_s: float | None,
) -> None:
    """Show a record of `uav-bt fly --record` in Rerun.

    Camera with overlays, mask, metric depth, the lab and the path in 3D, the tree with its
    statuses, and plots, on one timeline. Opens a window unless --web, --save or --video is given.
    A record that was cut short is shown as far as it goes.
    """
    if from_s is not None and to_s is not None and from_s >= to_s:
        raise click.UsageError(f"--from {from_s:g} must lie before --to {to_s:g}")
    from uav_bt.app.view.recorded import (  # noqa: PLC0415
        WITHOUT_DISPLAY,
        RecordedFlight,
        Span,
    )
    from uav_bt.display.rerun import sinks  # noqa: PLC0415 - `--help` need not wait for these

    window = not (web or save or video)
    if window:
        sinks.need_display(WITHOUT_DISPLAY)
    with RecordedFlight(file, Span(from_s=from_s, to_s=to_s)) as flight:
        with progress_bars() as advance:
            if save is not None:
                flight.save(save, advance=advance)
            if video is not None:
                flight.film(video, speed=speed, advance=advance)
        for what, path in (("view", save), ("video", video)):
            if path is not None:
                click.echo(f"{what}: {path}")
        if web or window:
            _show(flight, web=web)
        for damage in flight.damages:
            click.echo(f"{file}: {damage}", err=True)


def _show(flight: RecordedFlight, *, web: bool) -> None:
    with flight.shown(web=web) as viewer:
        if viewer.url is not None:
            click.echo(f"{viewer.url}\nCtrl-C ends it.")
        with progress_bars() as advance:
            flight.draw(viewer.stream, advance=advance, stopped=lambda: viewer.closed)
        try:
            viewer.wait()
        except KeyboardInterrupt:
            click.echo("", err=True)
