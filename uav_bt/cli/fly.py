"""`uav-bt fly`: fly a mission, watch it, keep its report; the keys of the person who watches."""

from __future__ import annotations

import os
import select
import sys
import termios
import threading
import tty
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Annotated, Final, Literal

import click
from annotated_types import Ge, Le
from rich.console import Console

from uav_bt import app
from uav_bt.app import film
from uav_bt.app.options import IN_COMMANDS
from uav_bt.app.view.live import live_view
from uav_bt.cli.declare import command
from uav_bt.cli.interrupts import stopped_by
from uav_bt.display.status import OrderLines, summary
from uav_bt.errors import FileError, MissionError
from uav_bt.groot import watched_live
from uav_bt.mission.judge import Outcome
from uav_bt.mission.runner import MissionRunner
from uav_bt.mission.tick import TickListener
from uav_bt.option import Option
from uav_bt.protocols import Drone

KEYS_HELP: Final = (
    "keys: m takes over and hands back, l lands, X (shift) cuts the motors in flight, Ctrl-C lands"
)
_WAIT_S: Final = 0.1  # for a key, at most, so that the end of a flight is noticed
_GROOT_PORT: Final = "1667"  # the default of Groot2; notifications have the next one


@command(sections=("Mission", "Outputs", "Watching", "Simulated room", "Place", "Real drone"))
def fly(
    tree: str,
    *,
    out: Annotated[Path | None, Option(group="Outputs", path="folder")] = None,
    report: Annotated[Path | None, Option(group="Outputs", path="written")] = None,
    video: Annotated[Path | None, Option(group="Outputs", path="written", suffix=".mp4")] = None,
    btlog: Annotated[Path | None, Option(group="Outputs", path="written", suffix=".btlog")] = None,
    flight: Annotated[app.FlightOptions, Option(parts=app.FlightOptions, only=IN_COMMANDS)],
    view: Annotated[
        Literal["window", "web"] | None, Option("", "[WHERE]", "Watching", alone="window")
    ] = None,
    groot: Annotated[
        int | None, Ge(1), Le(65_534), Option("", "[PORT]", "Watching", alone=_GROOT_PORT)
    ] = None,
    watch: Annotated[bool, Option(group="Watching")] = False,
) -> bool:
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

    Options:
        out: A new or empty folder for the report, the map's objects, and what leaves such as
            TakePhoto write.
        report: Write the flight's report there, as JSON; default: report.json in --out.
        video: Make a video of the flight: an mp4 file.
        btlog: Log what each node does: a .btlog file, which Groot2 replays.
        view: Show the flight in Rerun: in a window, or with `web` in a browser on this machine.
        groot: Let Groot2 on this machine watch, on port 1667 or PORT and on the next one. Without
            a port it stands after TREE.
        watch: Read TREE again whenever it is edited while it flies; for simulated drones.
    """  # noqa: D301  (click needs the backspace)
    if watch and (view or groot or btlog):
        raise click.UsageError(
            "--view, --groot and --btlog show the one tree that a flight began with, and with "
            "--watch it may change: leave them out"
        )
    begun: list[app.Flight[Drone]] = []
    with ExitStack() as stack:
        follow = stack.enter_context(watched_live(btlog=btlog, groot=groot))

        def listen(flown: app.Flight[Drone]) -> list[TickListener]:
            begun.append(flown)
            orders = [OrderLines(click.echo)] if flight.rehearse else []
            return [*orders, *follow(flown.mission, flown.context)]

        watchers: list[app.Listeners] = [stack.enter_context(film.live_status()), listen]
        viewed = None
        if view is not None:
            # Lives as long as the command: a browser still shows it when the summary is printed.
            shown = live_view(web=view == "web", on_url=click.echo)
            viewed = click.get_current_context().with_resource(shown)
            watchers.append(viewed)
        try:
            flown = app.fly(
                tree,
                flight,
                out=out,
                report=report,
                video=video,
                listeners=watchers,
                on_check=click.echo,
                controls=pilot_keys,
                watch=partial(click.echo, err=True) if watch else None,
            )
        except KeyboardInterrupt as stop:
            when = "again while it landed" if begun else "before take-off: nothing flew"
            raise MissionError(f"{stopped_by(stop)} {when}") from stop
        Console().print(summary(flown, begun[0].held.mark))
        lost = dict(flown.lost_outputs)
        try:
            stack.close()
        except (FileError, OSError) as fault:
            lost["an output"] = str(fault)
    files = {"record": flight.record, "out": out, "report": report, "video": video, "btlog": btlog}
    _name_files(files, lost)
    if viewed is not None and view == "web":
        click.echo("The view stays until Ctrl-C.")
        with suppress(KeyboardInterrupt):
            viewed.wait()
    if flown.airborne_at_end:
        click.secho(app.STILL_IN_THE_AIR, fg="red", bold=True, err=True)
    return not lost and flown.outcome == Outcome.SUCCESS.value


def _name_files(written: Mapping[str, str | Path | None], lost: Mapping[str, str]) -> None:
    """Print the written outputs and the lost ones."""
    for what, path in written.items():
        if path is not None and Path(path).exists():
            click.echo(f"{what}: {path}")
    for what, why in lost.items():
        click.echo(f"Error: {what} was lost: {why}", err=True)


def obey(key: str, runner: MissionRunner) -> None:
    """Carry out the action of a key; other keys do nothing."""
    if key == "m":
        runner.manual = not runner.manual
    elif key == "l":
        runner.manual = False
        runner.abort.request("a person pressed l")
    elif key == "X":
        runner.abort.cut_motors("a person cut the motors")


@contextmanager
def pilot_keys(runner: MissionRunner) -> Iterator[None]:
    """Print the keys and obey them while a mission flies. Without a terminal this does nothing."""
    if sys.stdin is None or not sys.stdin.isatty():  # None: the standard input was closed
        yield
        return
    click.echo(KEYS_HELP, err=True)
    terminal = sys.stdin.fileno()
    before = termios.tcgetattr(terminal)
    stop = threading.Event()
    reader = threading.Thread(target=_read, args=(terminal, stop, runner), name="keys", daemon=True)
    try:
        tty.setcbreak(terminal)  # keys without Enter; Ctrl-C still is a signal
        reader.start()
        yield
    finally:
        stop.set()
        reader.join()
        termios.tcsetattr(terminal, termios.TCSADRAIN, before)


def _read(terminal: int, stop: threading.Event, runner: MissionRunner) -> None:
    while not stop.is_set():
        if select.select([terminal], [], [], _WAIT_S)[0]:
            pressed = os.read(terminal, 1)
            if not pressed:  # the terminal went away
                return
            obey(pressed.decode("latin-1"), runner)
