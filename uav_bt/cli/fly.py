"""`uav-bt fly`: fly a mission, watch it, keep its report."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack, suppress
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

import click

from uav_bt.cli.options import (
    groot_port,
    image_size_option,
    output_option,
    policy_option,
    profile_option,
    seed_option,
    threads_option,
)
from uav_bt.errors import MissionError

if TYPE_CHECKING:
    from uav_bt.app.view.live import ViewListeners

__all__ = ["fly"]

_GROOT_PORT: Final = 1667  # what Groot2 itself asks for


@click.command()
@click.argument("tree")
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
    type=click.Path(dir_okay=False, path_type=Path),
    help="A site file: heights, camera, classes and limits of the place.",
)
@click.option(
    "--rehearse",
    is_flag=True,
    help="Motors off: perception and tree see the live video, and show what would be sent.",
)
@profile_option()
@policy_option()
@click.option(
    "--camera",
    metavar="FILE",
    type=click.Path(dir_okay=False, path_type=Path),
    help="A camera file of `uav-bt calibrate`: frames are undistorted with it.",
)
@output_option("--report", "Write the flight's report there, as JSON.")
@output_option("--record", "Keep the flight's record: an MCAP file, for viewers and for replay.")
@click.option(
    "--quality",
    type=click.Choice(["lossless", "high"]),
    default="lossless",
    show_default=True,
    help="Of the record's pictures: exact, or small.",
)
@output_option("--video", "Film the flight: an mp4 file.")
@click.option(
    "--view",
    metavar="[WHERE]",
    type=click.Choice(["window", "web"]),
    is_flag=False,
    flag_value="window",
    help="Show the flight in Rerun: in a window, or with `web` in a browser on this machine.",
)
@output_option("--btlog", "Log what each node does: a .btlog file, which Groot2 replays.")
@click.option(
    "--groot",
    metavar="[PORT]",
    is_flag=False,
    flag_value=str(_GROOT_PORT),
    callback=groot_port,
    help=f"Let Groot2 on this machine watch, on port {_GROOT_PORT} or PORT and on the next one.",
)
@click.option("--realtime", is_flag=True, help="Let the twin keep pace with the clock on the wall.")
@image_size_option()
@threads_option()
@click.pass_context
def fly(
    ctx: click.Context,
    *,
    tree: str,
    scene: str | None,
    seed: int,
    drone: str,
    profile: str,
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
    image_size: tuple[int, int],
    threads: int,
) -> None:
    """Fly a mission.

    TREE is a tree file, or the name of a mission that ships with uav-bt. Ctrl-C lands the drone and
    the report is still written. At a terminal m takes over (the drone hovers, the mission waits)
    and hands back, l lands, and X cuts the motors in flight. A real drone is checked before it
    takes off. Exits with 0 when the mission succeeded, 1 when it did not, and 2
    when nothing was flown because something given was refused.
    """
    written = {
        "report": report,
        "record": record,
        "video": video,
        "btlog": btlog,
    }
    files = {what: path for what, path in written.items() if path is not None}
    _refuse_clashes(files)

    from rich.console import Console  # noqa: PLC0415 - `--help` need not wait for all of these

    from uav_bt import app  # noqa: PLC0415
    from uav_bt.app import film  # noqa: PLC0415
    from uav_bt.app.site import load_site  # noqa: PLC0415
    from uav_bt.app.view.live import live_view  # noqa: PLC0415
    from uav_bt.cli.keys import pilot_keys  # noqa: PLC0415
    from uav_bt.display.status import summary  # noqa: PLC0415
    from uav_bt.groot import GrootConfig, watched_live  # noqa: PLC0415
    from uav_bt.mission.judge import Outcome  # noqa: PLC0415

    options = app.FlightOptions(
        scene=scene,
        seed=seed,
        drone=drone,
        profile=profile,
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
        watchers: list[film.Listeners] = [stack.enter_context(film.live_status())]
        filmed = None
        title = f"{Path(tree).stem}, {scene or drone}, seed {seed}"
        if video is not None:
            filmed = stack.enter_context(film.flight_video(video, title=title))
            watchers.append(filmed)
        viewed = None
        if view is not None:
            # Of the command, not of the flight: a browser still looks when the summary is printed.
            viewed = ctx.with_resource(live_view(web=view == "web", title=title, told=click.echo))
            watchers.append(viewed)
        tree_watchers: list[film.TreeListeners] = [
            stack.enter_context(
                watched_live(btlog=btlog, groot=None if groot is None else GrootConfig(port=groot))
            )
        ]
        if filmed is not None:
            tree_watchers.append(filmed.show_tree)
        if viewed is not None:
            tree_watchers.append(viewed.show_tree)
        flown = app.fly(
            tree,
            options,
            report=report,
            listeners=film.all_of(*watchers),
            tree_listeners=film.all_of_trees(*tree_watchers),
            told=click.echo,
            controls=pilot_keys,
        )
        if filmed is not None:
            filmed.conclude(flown)
    Console().print(summary(flown))
    for what, path in files.items():
        click.echo(f"{what}: {path}")
    if viewed is not None and view == "web":
        _wait_for(viewed)
    if flown.outcome != Outcome.SUCCESS.value:
        ctx.exit(MissionError.exit_code)


def _refuse_clashes(files: Mapping[str, Path]) -> None:
    """Refuse two files that are one."""
    for one, other in combinations(files, 2):
        if files[one] == files[other]:
            raise click.UsageError(f"--{one} and --{other} name the same file")


def _wait_for(viewed: ViewListeners) -> None:
    """Keep a browser's view until somebody has seen enough."""
    click.echo("The view stays until Ctrl-C.")
    with suppress(KeyboardInterrupt):
        viewed.wait()
