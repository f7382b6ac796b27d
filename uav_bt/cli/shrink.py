"""`uav-bt shrink`: the fewest objects, movers and faults with which a flight still fails."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Final

import click
from annotated_types import Ge

from sim_bridge.twin.scene_file import scene_text
from uav_bt.app.options import FlightOptions
from uav_bt.campaign.report.sources import fly_command, read_sources
from uav_bt.campaign.shrinking import FailedFlight, same_cause, shrink
from uav_bt.cli.declare import command
from uav_bt.errors import InputError, MissionError
from uav_bt.files import check_empty_folder, write_whole, writing
from uav_bt.mission.judge import Outcome
from uav_bt.option import Option

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
    wanted = {"tree": tree_name, "scene": scene, "seed": seed}
    flight = _failed(source, {name: value for name, value in wanted.items() if value is not None})
    click.echo(f"{flight.ending}; {len(flight.parts())} parts: boxes, objects, movers and faults")
    click.echo("  parts  end of the flight")
    small = shrink(flight, lambda count, ending: click.echo(f"  {count:>5}  {ending}"))
    with writing(out):
        out.mkdir(parents=True, exist_ok=True)
    file, faults = out / "scene.yaml", out / "faults.txt"
    write_whole(file, scene_text(small.scene))
    write_whole(faults, "".join(f"{fault}\n" for fault in small.options.faults))
    had = flight.things()
    kept = (
        f"{kind} {len(some)}"
        for kind, some in small.things().items()
        if had[kind] or kind != "objects"
    )
    click.echo(f"remaining: {', '.join(kept)}; {file}, {faults}")
    options = small.options
    flown: dict[str, Any] = {
        "seed": options.seed,
        "profile": options.profile,
        "faults": [f"@{faults}"] if small.options.faults else [],
        "ports": options.ports,
        "variables": options.variables,
    }
    for drone in dict.fromkeys((options.drone_name, _TWIN)):
        changes = flown | {"drone": drone}
        command = fly_command(small.tree, str(file), changes, options, out=str(out / drone))
        images = ", with images" if drone == _TWIN else ""
        click.echo(f"command to repeat it, drone {drone}{images}:\n  {command}")
    if twin:
        ending = small.fly(_TWIN)
        click.echo(f"in the twin: {ending}")
        if not same_cause(ending, small.ending):
            ctx.exit(MissionError.exit_code)


def _failed(source: Path, wanted: dict[str, str | int]) -> FailedFlight:
    """Return the first failed flight that has the wanted tree, scene and seed."""
    succeeded, failed = [], []
    for one in read_sources([source]):
        for line in one.flights:
            is_wanted = all(_plain(line[name]) == _plain(value) for name, value in wanted.items())
            which = f"{line['tree']} in {line['scene']}, seed {line['seed']}"
            if line["outcome"] == Outcome.SUCCESS.value:
                succeeded += [which] if wanted and is_wanted else []
            elif not is_wanted:
                failed.append(which)
            else:
                plan = one.plan
                options = FlightOptions() if plan is None else plan.options
                scene = one.scene_path(str(line["scene"]))
                return FailedFlight.of(line, one.tree_path(), scene, options)
    asked = ", ".join(f"{name} {value}" for name, value in wanted.items())
    with_these = f" with {asked}" if asked else ""
    others = (("succeeded", succeeded), ("failed", failed))
    known = "".join(f"; {kind}: {'; '.join(some[:_NAMED])}" for kind, some in others if some)
    raise InputError(f"{source} has no failed flight{with_these}{known}")


def _plain(value: object) -> object:
    """Return a tree's name without its file's ending, and any other value as it is."""
    return value.removesuffix(".xml") if isinstance(value, str) else value
