"""`uav-bt shrink`: the fewest objects, movers and faults with which a flight still fails."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Final

import click

from sim_bridge.twin.scene_file import scene_text
from uav_bt.app.options import FlightOptions
from uav_bt.campaign.report.sources import read_sources
from uav_bt.campaign.shrinking import FailedFlight, shrink
from uav_bt.cli.command import Command
from uav_bt.cli.options import FOLDER
from uav_bt.cli.values import WholeNumber
from uav_bt.errors import InputError, MissionError
from uav_bt.files import check_empty_folder, write_whole, writing
from uav_bt.lab.lab import Lab
from uav_bt.lab.shipped import lab_address
from uav_bt.mission.judge import Outcome

SCENE_FILE: Final = "scene.yaml"
FAULTS_FILE: Final = "faults.txt"


@click.command("shrink", cls=Command)
@click.argument("source", metavar="DIR", type=click.Path(path_type=Path))
@click.option("--tree", "tree_name", metavar="NAME", help="Of the flight; default: any.")
@click.option("--scene", metavar="NAME", help="Of the flight; default: any.")
@click.option("--seed", type=WholeNumber(min=0), help="Of the flight; default: any.")
@click.option(
    "--out",
    metavar="DIR",
    type=FOLDER,
    required=True,
    help="A new or empty folder for scene and faults.",
)
@click.option(
    "--twin", is_flag=True, help="Fly the result in the twin, too; exit with 1 if it does not fail."
)
@click.pass_context
def shrink_command(
    ctx: click.Context,
    *,
    source: Path,
    tree_name: str | None,
    scene: str | None,
    seed: int | None,
    out: Path,
    twin: bool,
) -> None:
    """Reduce a failed flight to the fewest causes that still make it fail.

    DIR is the folder of a `uav-bt campaign`, or a file with one flight per line. The first flight
    that failed is taken, unless --tree, --scene and --seed name another. Boxes, movers and faults
    are left out as long as the flight ends with the same outcome. The rest is written as a
    scene file and a fault file, with the command that flies them in the twin with images.

    \b
    Example:
      uav-bt campaign land_only --drone plain --faults random --out runs/soak
      uav-bt shrink runs/soak --out runs/soak/smallest
    """  # noqa: D301  (click needs the backspace)
    check_empty_folder(out, "shrink")
    flight = _failed(source, {"tree": tree_name, "scene": scene, "seed": seed})
    click.echo(
        f"{flight.outcome}: {flight.reason}; {len(flight.parts())} objects, movers and faults"
    )
    small = shrink(flight, lambda left, fails: click.echo(f"  {left}: {_outcome(fails=fails)}"))
    with writing(out):
        out.mkdir(parents=True, exist_ok=True)
    write_whole(out / SCENE_FILE, scene_text(small.scene))
    write_whole(out / FAULTS_FILE, "".join(f"{fault}\n" for fault in small.faults))
    left = ", ".join(
        f"{what} {len(some)}"
        for what, some in (
            ("faults", small.faults),
            ("movers", small.scene.movers),
            ("boxes", small.scene.boxes),
            *((("objects", small.scene.objects),) if flight.scene.objects else ()),
        )
    )
    click.echo(f"left: {left}; {out / SCENE_FILE}, {out / FAULTS_FILE}")
    options = small.options
    words = ["uav-bt", "fly", small.tree, "--scene", str(out / SCENE_FILE)]
    words += ["--seed", str(options.seed), "--profile", options.profile]
    words += ["--lab", lab_address(options.lab)] if isinstance(options.lab, Lab) else []
    words += ["--faults", f"@{out / FAULTS_FILE}"] if small.faults else []
    for option, values in (("--set", options.ports), ("--var", options.variables)):
        words += [word for name, value in values.items() for word in (option, f"{name}={value}")]
    click.echo(shlex.join(words))
    if twin and not small.fails("twin"):
        click.echo("it does not fail in the twin")
        ctx.exit(MissionError.exit_code)


def _outcome(*, fails: bool) -> str:
    return "fails" if fails else "does not fail"


def _failed(source: Path, wanted: dict[str, object]) -> FailedFlight:
    """Return the first failed flight that has the wanted tree, scene and seed.

    Raises:
        InputError: no flight failed so.
    """
    named = {name: value for name, value in wanted.items() if value is not None}
    for one in read_sources([source]).sets:
        for line in one.flights:
            facts = {**line, "tree": Path(line["tree"]).stem}
            named_tree = Path(str(named.get("tree", facts["tree"]))).stem
            if any(facts[name] != value for name, value in {**named, "tree": named_tree}.items()):
                continue
            if line["outcome"] == Outcome.SUCCESS.value and "seed" not in named:
                continue
            plan = one.source.plan
            options = FlightOptions() if plan is None else plan.options
            return FailedFlight.of(
                line, one.tree_path(), one.scene_path(str(line["scene"])), options
            )
    asked = ", ".join(f"{name} {value}" for name, value in named.items())
    raise InputError(f"{source} has no failed flight{f' with {asked}' if asked else ''}")
