"""`uav-bt campaign`: many flights, on all cores or on a cluster."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import click
from annotated_types import Ge, Gt, Le

from uav_bt import campaign as campaigns
from uav_bt.app.options import SHARED, FlightOptions
from uav_bt.campaign import CampaignResult
from uav_bt.campaign.plan import CampaignPlan
from uav_bt.campaign.report.sources import by_tree
from uav_bt.campaign.report.statistics import (
    SUCCESS,
    spread,
    success_interval,
    success_words,
    successes,
    values_of,
)
from uav_bt.campaign.runner import Backend, LocalBackend
from uav_bt.campaign.store import METRICS
from uav_bt.cli.declare import command
from uav_bt.cli.progress import campaign_progress
from uav_bt.cli.shared import RUNS, Workers
from uav_bt.errors import MissionError
from uav_bt.option import Option

_OPTIONS: Final = (*(name for name in SHARED if name != "record_quality"), "params")


def _flown(
    *,
    scenes: Annotated[
        tuple[str, ...],
        Option(
            "Scenes by name, file or pattern, with commas between. Repeatable; default: those of "
            "--lab, else val-*.",
            "GLOB",
        ),
    ] = (),
    flights: Annotated[
        int | None,
        Ge(1),
        Option("Flights of each tree in each scene, one seed each; default: 10."),
    ] = None,
    seed_from: Annotated[int, Ge(0), Option("The first seed.")] = 0,
    timeout_s: Annotated[float, Gt(0), Option("Wall time after which a flight counts as hung.")] = (
        CampaignPlan.timeout_s
    ),
    record: Annotated[bool, Option("Keep a record of every flight in DIR/records.")] = False,
) -> dict[str, Any]:
    """Return which flights a campaign has, as `make_plan` takes them."""
    more: dict[str, Any] = {"scenes": scenes or None, "seed_from": seed_from, "record": record}
    return {**more, "flights": flights or 10, "timeout_s": timeout_s}


def _backend(
    *,
    workers: Workers = None,
    backend: Annotated[
        Literal["local", "dask"], Option("This machine's cores, or a Dask cluster.")
    ] = "local",
    address: Annotated[str | None, Option("Address of the Dask scheduler.", "HOST:PORT")] = None,
) -> Backend:
    """Return what flies: `workers` of this machine, None for one on each core, or a cluster."""
    if backend == "dask" and workers is not None:
        raise click.UsageError("--workers is for this machine; a cluster has its workers")
    if (backend == "dask") != (address is not None):
        raise click.UsageError("--backend dask and --address belong together")
    if address is None:
        return LocalBackend(workers)
    from uav_bt.campaign.cluster import DaskBackend  # noqa: PLC0415  (another extra)

    return DaskBackend(address)


@command()
def campaign(
    ctx: click.Context,
    trees: Annotated[tuple[str, ...], Option(form="TREE...")] = (),
    *,
    flown: Annotated[dict[str, Any], Option(parts=_flown)],
    flight: Annotated[FlightOptions, Option(parts=FlightOptions, only=_OPTIONS)],
    backend: Annotated[Backend, Option(parts=_backend)],
    out: Annotated[
        Path | None,
        Option("Where the plan and the flights are kept; default: runs/TREE.", path="folder"),
    ] = None,
    resume: Annotated[
        Path | None,
        Option(
            "Continue the campaign in this folder, with the plan that is kept there.", path="folder"
        ),
    ] = None,
    fail_under: Annotated[
        float | None, Ge(0), Le(100), Option("Exit with 1 when fewer flights succeed.", "PERCENT")
    ] = None,
) -> None:
    """Fly missions many times and keep every flight.

    TREE is a tree file, or the name of a mission that ships with uav-bt; each flies in every scene.
    With `variants` in the file of --params, each tree flies with the values of each variant.
    Flights are kept one by one in DIR/flights.jsonl. The same command continues a campaign that was
    stopped; more --flights add to it. A flight that crashes or hangs its process counts as
    `error`. `uav-bt report DIR` writes the report. A flight with networks takes 30 to 60 s of a
    core, and a fifth of that with `--drone plain`, which draws no images.

    \b
    Examples:
      uav-bt campaign land_only --scenes val-a,val-b --flights 50 --out runs/land
      uav-bt campaign --resume runs/land

    Exits with 0 when all flights were flown, whatever their outcome (but see --fail-under), with 1
    when it was stopped, and with 2 when something given was refused.
    """  # noqa: D301  (click needs the backspace)
    if resume is not None:
        _only_resume(ctx)
        plan, folder = campaigns.plan_of(resume), resume
    elif trees:
        plan = campaigns.make_plan(trees, flight, **flown)
        folder = out or RUNS / "-".join(dict.fromkeys(Path(tree.path).stem for tree in plan.trees))
    else:
        raise click.UsageError("which TREE is to be flown? or --resume DIR")
    with campaign_progress(len(plan)) as progress:
        try:
            result = campaigns.run(
                plan, folder, backend=backend, on_flight=progress.add, on_note=progress.note
            )
        except KeyboardInterrupt:
            progress.note(
                f"stopped; {progress.done} of {len(plan)} flights are kept in {folder}, "
                "and the same command continues from there"
            )
            ctx.exit(MissionError.exit_code)
    _print_result(result, folder)
    good = 100.0 * successes(result.flights) / len(result.flights)
    if fail_under is not None and good < fail_under:
        ctx.exit(MissionError.exit_code)


def _only_resume(ctx: click.Context) -> None:
    """Refuse options that the folder's plan decides."""
    may = {"resume", "workers", "backend", "address", "fail_under"}
    given = [
        param.opts[0] if isinstance(param, click.Option) else "TREE"
        for param in ctx.command.params
        if param.name is not None
        and param.name not in may
        and ctx.get_parameter_source(param.name) is click.core.ParameterSource.COMMANDLINE
    ]
    if given:
        raise click.UsageError(
            f"--resume takes the plan from its folder, so leave out {', '.join(given)}"
        )


def _print_result(result: CampaignResult, folder: Path) -> None:
    for tree, flights in by_tree(result.flights).items():
        low, high = success_interval(flights)
        ends = Counter(flight["outcome"] for flight in flights if flight["outcome"] != SUCCESS)
        failures = "".join(f"; {name} {count}" for name, count in ends.most_common())
        success = (
            f"success {success_words(flights)} (95 % Wilson interval {low:.1f} to {high:.1f} %)"
        )
        click.echo(f"{tree}: {success}{failures}")
        heads = ("mean", "median", "p5", "p95", "least", "most")
        click.echo(f"  {'unit':>25}{'n':>5}" + "".join(f"{head:>8}" for head in heads))
        for name, metric in METRICS.items():
            if values := values_of(flights, name):
                numbers = spread(values).values()
                cells = "".join(" " * 8 if each is None else f"{each:>8.2f}" for each in numbers)
                click.echo(f"  {name:<22}{metric.unit:>3}{len(values):>5}{cells}")
    click.echo(f"flights: {folder / 'flights.jsonl'}")
