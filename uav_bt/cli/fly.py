"""`uav-bt fly`: fly a mission, watch it, keep its report."""

from __future__ import annotations

import re
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from typing import Final, Literal

import click
from rich.console import Console

from uav_bt import app
from uav_bt.app import film
from uav_bt.app.options import mark_of
from uav_bt.app.site import load_site
from uav_bt.app.view.live import ViewListeners, live_view
from uav_bt.cli.command import Command
from uav_bt.cli.interrupts import stopped_by
from uav_bt.cli.keys import pilot_keys
from uav_bt.cli.lookup_options import lookup_options
from uav_bt.cli.options import (
    INPUT,
    image_size_option,
    movers_option,
    output_option,
    policy_option,
    profile_option,
    seed_option,
    threads_option,
    tree_option,
)
from uav_bt.display.orders import OrderLines
from uav_bt.display.status import summary
from uav_bt.errors import FileError, MissionError
from uav_bt.groot import GrootConfig, watched_live
from uav_bt.mission.judge import Outcome
from uav_bt.protocols import Drone

_GROOT_PORT: Final = 1667  # the default of Groot2
_MAX_GROOT_PORT: Final = 65_534  # notifications have the next one


def _groot_port(ctx: click.Context, param: click.Parameter, value: str | None) -> int | None:
    """Return a port whose neighbour exists, too.

    Raises:
        BadParameter: it is none.
    """
    if value is None:
        return None
    if not re.fullmatch(r"[1-9]\d{0,4}", value) or int(value) > _MAX_GROOT_PORT:
        # `--groot` takes the next word for its port; the mission's name may be meant.
        raise click.BadParameter(
            f"expected a port from 1 to {_MAX_GROOT_PORT} or nothing, got '{value}'; "
            "write a --groot without a port after TREE",
            ctx,
            param,
        )
    return int(value)


@click.command(cls=Command)
@click.argument("tree")
@tree_option
@lookup_options
@click.option("--scene", metavar="SCENE", help="The twin's lab: a shipped scene or a YAML file.")
@seed_option()
@click.option(
    "--drone",
    metavar="NAME[:ADDRESS]",
    default="twin",
    show_default=True,
    help="The drone that flies: twin, anafi[:HOST[:PORT]], sphinx[:HOST[:PORT]], or another "
    "that is installed.",
)
@click.option(
    "--site",
    metavar="FILE",
    type=INPUT,
    help="A site file: heights, camera, classes and limits of the place.",
)
@click.option(
    "--rehearse",
    is_flag=True,
    help="Motors off: perception and tree see the live video, and show what would be sent.",
)
@profile_option
@movers_option
@policy_option
@click.option(
    "--camera",
    metavar="FILE",
    type=INPUT,
    help="A camera file of `uav-bt lab calibrate`: frames are undistorted with it.",
)
@output_option("--report", "Write the flight's report there, as JSON.")
@output_option(
    "--record",
    "Keep the flight's record: an MCAP file, for viewers and for replay.",
    suffix=".mcap",
)
@click.option(
    "--quality",
    type=click.Choice(["lossless", "high"]),
    default="lossless",
    show_default=True,
    help="Quality of the record's images: exact, or small.",
)
@output_option("--video", "Make a video of the flight: an mp4 file.", suffix=".mp4")
@click.option(
    "--view",
    metavar="[WHERE]",
    type=click.Choice(["window", "web"]),
    is_flag=False,
    flag_value="window",
    help="Show the flight in Rerun: in a window, or with `web` in a browser on this machine.",
)
@output_option(
    "--btlog", "Log what each node does: a .btlog file, which Groot2 replays.", suffix=".btlog"
)
@click.option(
    "--groot",
    metavar="[PORT]",
    is_flag=False,
    flag_value=str(_GROOT_PORT),
    callback=_groot_port,
    help=f"Let Groot2 on this machine watch, on port {_GROOT_PORT} or PORT and on the next one.",
)
@click.option("--realtime", is_flag=True, help="Fly the twin no faster than real time.")
@click.option(
    "--watch",
    is_flag=True,
    help="Read TREE again whenever it is edited while it flies; for the twin.",
)
@image_size_option
@threads_option
@click.pass_context
def fly(
    ctx: click.Context,
    *,
    tree: str,
    tree_id: str | None,
    tree_folders: app.TreeFolders,
    scene: str | None,
    seed: int,
    drone: str,
    profile: str,
    movers: int,
    policies: dict[str, str],
    camera: Path | None,
    site: Path | None,
    rehearse: bool,
    report: Path | None,
    record: Path | None,
    quality: Literal["lossless", "high"],
    video: Path | None,
    view: Literal["window", "web"] | None,
    btlog: Path | None,
    groot: int | None,
    realtime: bool,
    watch: bool,
    image_size: tuple[int, int],
    threads: int,
) -> None:
    """Fly a mission.

    TREE is a tree file, or the name of a mission that ships with uav-bt. Ctrl-C lands the drone and
    the report is still written. At a terminal m takes over (the drone hovers, the mission waits)
    and hands back, l lands, and X cuts the motors in flight. A real drone is checked before it
    takes off. With networks the twin flies one to three times slower than real time on two cores.

    Exits with 0 when the mission succeeded, with 1 when it did not, and with 2 when nothing was
    flown because something given was refused.

    \b
    Examples:
      uav-bt fly land_only --scene val-a --seed 3 --video flight.mp4
      uav-bt fly mission.xml --report report.json --record flight.mcap
      uav-bt fly mission.xml --watch --realtime
      uav-bt fly hover_and_look --drone anafi --site site.yaml --rehearse
    """  # noqa: D301  (click needs the backspace)
    if watch:
        outputs = {"report": report, "record": record, "video": video, "btlog": btlog}
        _check_watch(tree, drone, {**outputs, "view": view, "groot": groot})
    options = app.FlightOptions(
        tree_id=tree_id,
        tree_folders=tree_folders,
        scene=scene,
        seed=seed,
        drone=drone,
        profile=profile,
        movers=movers,
        policies=policies,
        image_size_px=image_size,
        camera=camera,
        site=None if site is None else load_site(site),
        rehearse=rehearse,
        realtime=realtime,
        inference_threads=threads,
        record=record,
        record_quality=quality,
    )
    with ExitStack() as stack:
        watchers: list[app.Listeners] = [
            stack.enter_context(film.live_status()),
            lambda _: [OrderLines(click.echo)] if rehearse else [],
        ]
        viewed = None
        if view is not None:
            # Lives as long as the command: a browser still shows it when the summary is printed.
            viewed = ctx.with_resource(live_view(web=view == "web", on_url=click.echo))
            watchers.append(viewed)
        follow = stack.enter_context(
            watched_live(btlog=btlog, groot=None if groot is None else GrootConfig(port=groot))
        )
        watchers.append(lambda flight: follow(flight.mission, flight.context))
        flights: list[object] = []

        def begin(flight: app.Flight[Drone]) -> tuple[()]:
            flights.append(flight)
            return ()

        watchers.append(begin)
        try:
            flown = app.fly(
                tree,
                options,
                report=report,
                video=video,
                listeners=watchers,
                on_check=click.echo,
                controls=pilot_keys,
                watch=partial(click.echo, err=True) if watch else None,
            )
        except KeyboardInterrupt as stop:
            when = "again while it landed" if flights else "before take-off: nothing flew"
            raise MissionError(f"{stopped_by(stop)} {when}") from stop
        Console().print(summary(flown, mark_of(options)))
        lost = {**flown.lost_outputs, **_closed(stack)}
    _name_files({"report": report, "record": record, "video": video, "btlog": btlog}, lost)
    if viewed is not None and view == "web":
        _wait_for(viewed)
    if flown.airborne_at_end:
        click.secho(app.STILL_IN_THE_AIR, fg="red", bold=True, err=True)
    if lost or flown.outcome != Outcome.SUCCESS.value:
        ctx.exit(MissionError.exit_code)


def _check_watch(tree: str, drone: str, given: Mapping[str, object]) -> None:
    """Refuse what a tree that changes in flight cannot be combined with.

    Raises:
        UsageError: a real drone, a shipped mission's name, or an output that shows one tree.
    """
    if drone.partition(":")[0] != "twin":
        raise click.UsageError(f"--watch changes a tree in flight: for the twin, not for {drone}")
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


def _name_files(written: Mapping[str, Path | None], lost: Mapping[str, str]) -> None:
    """Say what was written and what was not."""
    for what, path in written.items():
        if path is not None and path.is_file():
            click.echo(f"{what}: {path}")
    for what, why in lost.items():
        click.echo(f"Error: {what} was lost: {why}", err=True)


def _closed(outputs: ExitStack) -> dict[str, str]:
    """Close what was written beside the flight; return what could not be, and why."""
    try:
        outputs.close()
    except (FileError, OSError) as fault:
        return {"an output": str(fault)}
    return {}


def _wait_for(viewed: ViewListeners) -> None:
    """Keep a browser's view until Ctrl-C."""
    click.echo("The view stays until Ctrl-C.")
    with suppress(KeyboardInterrupt):
        viewed.wait()
