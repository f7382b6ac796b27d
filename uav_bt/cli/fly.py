"""`uav-bt fly`: fly a mission, watch it, keep its report."""

from __future__ import annotations

import re
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Final, Literal

import click
from rich.console import Console

from uav_bt import app
from uav_bt.app import film
from uav_bt.app.drone_of_flight import is_simulated
from uav_bt.app.options import IN_COMMANDS
from uav_bt.app.view.live import live_view
from uav_bt.cli.declare import command
from uav_bt.cli.interrupts import stopped_by
from uav_bt.cli.keys import pilot_keys
from uav_bt.display.status import OrderLines, summary
from uav_bt.errors import FileError, InputError, MissionError
from uav_bt.groot import watched_live
from uav_bt.mission.judge import Outcome
from uav_bt.option import Option
from uav_bt.protocols import Drone

_GROOT_PORT: Final = 1667  # the default of Groot2
_MAX_GROOT_PORT: Final = 65_534  # notifications have the next one


def _groot_port(text: str) -> int:
    """Return a port whose neighbour exists, too."""
    if not re.fullmatch(r"[1-9]\d{0,4}", text) or int(text) > _MAX_GROOT_PORT:
        # `--groot` takes the next word for its port; the mission's name may be meant.
        raise InputError(
            f"expected a port from 1 to {_MAX_GROOT_PORT} or nothing, got '{text}'; "
            "write a --groot without a port after TREE"
        )
    return int(text)


@dataclass(frozen=True, kw_only=True)
class Outputs:
    """Output files of a flight besides its record; None: not written."""

    out: Annotated[
        Path | None,
        Option(
            "A new or empty folder for the report, the map's objects, and what leaves such as "
            "TakePhoto write.",
            "",
            "Outputs",
            path="folder",
        ),
    ] = None
    report: Annotated[
        Path | None,
        Option(
            "Write the flight's report there, as JSON; default: report.json in --out.",
            "",
            "Outputs",
            path="written",
        ),
    ] = None
    video: Annotated[
        Path | None,
        Option(
            "Make a video of the flight: an mp4 file.", "", "Outputs", path="written", suffix=".mp4"
        ),
    ] = None
    btlog: Annotated[
        Path | None,
        Option(
            "Log what each node does: a .btlog file, which Groot2 replays.",
            "",
            "Outputs",
            path="written",
            suffix=".btlog",
        ),
    ] = None


@command(sections=("Mission", "Outputs", "Watching", "Simulated room", "Place", "Real drone"))
def fly(
    ctx: click.Context,
    tree: str,
    *,
    outputs: Annotated[Outputs, Option(parts=Outputs)],
    flight: Annotated[app.FlightOptions, Option(parts=app.FlightOptions, only=IN_COMMANDS)],
    view: Annotated[
        Literal["window", "web"] | None,
        Option(
            "Show the flight in Rerun: in a window, or with `web` in a browser on this machine.",
            "[WHERE]",
            "Watching",
            alone="window",
        ),
    ] = None,
    groot: Annotated[
        int | None,
        Option(
            f"Let Groot2 on this machine watch, on port {_GROOT_PORT} or PORT and on the next one.",
            "[PORT]",
            "Watching",
            alone=str(_GROOT_PORT),
            read=_groot_port,
        ),
    ] = None,
    watch: Annotated[
        bool,
        Option(
            "Read TREE again whenever it is edited while it flies; for simulated drones.",
            "",
            "Watching",
        ),
    ] = False,
) -> None:
    """Fly a mission.

    TREE is a tree file, or the name of a mission that ships with uav-bt. Ctrl-C lands the drone and
    the report is still written. At a terminal m takes over (the drone hovers, the mission waits)
    and hands back, l lands, and X cuts the motors in flight. A real drone is checked before it
    takes off. The twin flies about four times faster than real time on two cores, and `--drone
    plain`, which draws no images, 10 to 16 times.

    Exits with 0 when the mission succeeded, with 1 when it did not, and with 2 when nothing was
    flown because something given was refused.

    \b
    Examples:
      uav-bt fly land_only --scene val-a --seed 3 --video flight.mp4
      uav-bt fly mission.xml --out results --record flight.mcap
      uav-bt fly mission.xml --watch --realtime
      uav-bt fly hover_and_look --drone anafi --site site.yaml --rehearse
    """  # noqa: D301  (click needs the backspace)
    files = {"record": flight.record, **asdict(outputs)}
    if watch:
        _check_watch(tree, flight, {**files, "view": view, "groot": groot})
    with ExitStack() as stack:
        watchers: list[app.Listeners] = [
            stack.enter_context(film.live_status()),
            lambda _: [OrderLines(click.echo)] if flight.rehearse else [],
        ]
        viewed = None
        if view is not None:
            # Lives as long as the command: a browser still shows it when the summary is printed.
            viewed = ctx.with_resource(live_view(web=view == "web", on_url=click.echo))
            watchers.append(viewed)
        follow = stack.enter_context(watched_live(btlog=outputs.btlog, groot=groot))
        watchers.append(lambda flown: follow(flown.mission, flown.context))
        begun: list[app.Flight[Drone]] = []

        def begin(flown: app.Flight[Drone]) -> tuple[()]:
            begun.append(flown)
            return ()

        watchers.append(begin)
        try:
            flown = app.fly(
                tree,
                flight,
                out=outputs.out,
                report=outputs.report,
                video=outputs.video,
                listeners=watchers,
                on_check=click.echo,
                controls=pilot_keys,
                watch=partial(click.echo, err=True) if watch else None,
            )
        except KeyboardInterrupt as stop:
            when = "again while it landed" if begun else "before take-off: nothing flew"
            raise MissionError(f"{stopped_by(stop)} {when}") from stop
        Console().print(summary(flown, begun[0].held.mark))
        lost = {**flown.lost_outputs, **_closed(stack)}
    _name_files(files, lost)
    if viewed is not None and view == "web":
        click.echo("The view stays until Ctrl-C.")
        with suppress(KeyboardInterrupt):
            viewed.wait()
    if flown.airborne_at_end:
        click.secho(app.STILL_IN_THE_AIR, fg="red", bold=True, err=True)
    if lost or flown.outcome != Outcome.SUCCESS.value:
        ctx.exit(MissionError.exit_code)


def _check_watch(tree: str, flight: app.FlightOptions, given: Mapping[str, object]) -> None:
    """Refuse options that cannot be combined with a tree that changes in flight."""
    if not is_simulated(flight):
        raise click.UsageError(
            f"--watch changes a tree in flight: for simulated drones, not for {flight.drone_name}"
        )
    if not Path(tree).is_file():
        raise click.UsageError(
            f"--watch needs a tree file to edit, and '{tree}' is none; 'uav-bt new FILE' writes one"
        )
    for name, value in given.items():
        if value is not None:
            raise click.UsageError(
                f"--{name} shows the one tree that a flight began with, and with --watch it may "
                "change: leave one of them out"
            )


def _name_files(written: Mapping[str, str | Path | None], lost: Mapping[str, str]) -> None:
    """Print the written outputs and the lost ones."""
    for what, path in written.items():
        if path is not None and Path(path).exists():
            click.echo(f"{what}: {path}")
    for what, why in lost.items():
        click.echo(f"Error: {what} was lost: {why}", err=True)


def _closed(outputs: ExitStack) -> dict[str, str]:
    """Close the outputs; return those that failed, with reasons."""
    try:
        outputs.close()
    except (FileError, OSError) as fault:
        return {"an output": str(fault)}
    return {}
