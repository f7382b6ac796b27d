"""`uav-bt shrink`: the fewest objects, movers and faults with which a flight still fails."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Final

import click
from annotated_types import Ge

from sim_bridge.twin.scene_file import scene_text
from uav_bt.app.options import FlightOptions
from uav_bt.campaign.report.repeat import fly_command
from uav_bt.campaign.report.sources import read_sources
from uav_bt.campaign.shrinking import FailedFlight, shrink
from uav_bt.cli.declare import command
from uav_bt.errors import InputError, MissionError
from uav_bt.files import check_empty_folder, write_whole, writing
from uav_bt.mission.judge import Outcome
from uav_bt.option import Option

SCENE_FILE: Final = "scene.yaml"
FAULTS_FILE: Final = "faults.txt"
_NAMED: Final = 5  # flights that an error names, at most
_TWIN: Final = "twin"


@command()
def shrink_command(
    ctx: click.Context,
    source: Annotated[Path, Option(form="DIR")],
    *,
    tree_name: Annotated[str | None, Option("Of the flight; default: any.", "--tree NAME")] = None,
    scene: Annotated[str | None, Option("Of the flight; default: any.", "NAME")] = None,
    seed: Annotated[int | None, Ge(0), Option("Of the flight; default: any.")] = None,
    out: Annotated[Path, Option("A new or empty folder for scene and faults.", path="folder")],
    twin: Annotated[
        bool, Option("Fly the result in the twin, too; exit with 1 if it does not fail.")
    ] = False,
) -> None:
    """Reduce a failed flight to the fewest causes that still make it fail.

    DIR is the folder of a `uav-bt campaign`, or a file with one flight per line. The first flight
    that failed is taken, unless --tree, --scene and --seed name another. Boxes, movers and faults
    are left out as long as the flight ends with the same outcome and reason; numbers may differ.
    The rest is written as a scene file and a fault file, with the commands that fly them: with the
    drone that failed, and in the twin with images.

    \b
    Example:
      uav-bt campaign land_only --drone plain --faults random --out runs/soak
      uav-bt shrink runs/soak --out runs/soak/smallest

    Exits with 0 when the flight was reduced, with 1 when it was stopped or does not fail in the
    twin (--twin), and with 2 when something given was refused.
    """  # noqa: D301  (click needs the backspace)
    check_empty_folder(out, "shrink")
    flight = _failed(source, {"tree": tree_name, "scene": scene, "seed": seed})
    click.echo(f"{flight.ending}; {len(flight.parts())} parts: boxes, objects, movers and faults")
    click.echo("  parts  end of the flight")
    small = shrink(flight, lambda count, ending: click.echo(f"  {count:>5}  {ending}"))
    with writing(out):
        out.mkdir(parents=True, exist_ok=True)
    write_whole(out / SCENE_FILE, scene_text(small.scene))
    write_whole(out / FAULTS_FILE, "".join(f"{fault}\n" for fault in small.faults))
    remaining = ", ".join(
        f"{what} {len(some)}"
        for what, some in (
            ("faults", small.faults),
            ("movers", small.scene.movers),
            ("boxes", small.scene.boxes),
            *((("objects", small.scene.objects),) if flight.scene.objects else ()),
        )
    )
    click.echo(f"remaining: {remaining}; {out / SCENE_FILE}, {out / FAULTS_FILE}")
    options = small.options
    flown: dict[str, Any] = {
        "seed": options.seed,
        "profile": options.profile,
        "faults": [f"@{out / FAULTS_FILE}"] if small.faults else [],
        "ports": options.ports,
        "variables": options.variables,
    }
    for drone in dict.fromkeys((options.drone_name, _TWIN)):
        changes = flown | {"drone": drone}
        file, folder = str(out / SCENE_FILE), str(out / drone)
        command = fly_command(small.tree, file, changes, options, out=folder)
        images = ", with images" if drone == _TWIN else ""
        click.echo(f"command to repeat it, drone {drone}{images}:\n  {command}")
    if not twin:
        return
    ending = small.fly(_TWIN)
    click.echo(f"in the twin: {ending}")
    if not ending.agrees(small.ending):
        ctx.exit(MissionError.exit_code)


def _failed(source: Path, wanted: dict[str, object]) -> FailedFlight:
    """Return the first failed flight that has the wanted tree, scene and seed.

    Raises:
        InputError: no flight failed so.
    """
    named = {name: value for name, value in wanted.items() if value is not None}
    others: dict[str, list[str]] = {"succeeded": [], "failed": []}
    for one in read_sources([source]).sets:
        for line in one.flights:
            is_wanted = all(_plain(line[name]) == _plain(value) for name, value in named.items())
            which = f"{line['tree']} in {line['scene']}, seed {line['seed']}"
            if line["outcome"] == Outcome.SUCCESS.value:
                if named and is_wanted:
                    others["succeeded"].append(which)
            elif not is_wanted:
                others["failed"].append(which)
            else:
                plan = one.source.plan
                options = FlightOptions() if plan is None else plan.options
                return FailedFlight.of(
                    line, one.tree_path(), one.scene_path(str(line["scene"])), options
                )
    asked = ", ".join(f"{name} {value}" for name, value in named.items())
    known = "".join(
        f"; {kind}: {'; '.join(some[:_NAMED])}" for kind, some in others.items() if some
    )
    raise InputError(f"{source} has no failed flight{f' with {asked}' if asked else ''}{known}")


def _plain(value: object) -> object:
    """Return a tree's name without its file's ending, and any other value as it is."""
    return value.removesuffix(".xml") if isinstance(value, str) else value
