"""`uav-bt campaign`: many flights, on all cores or on a cluster."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import click

from uav_bt import campaign as campaigns
from uav_bt.campaign import CampaignResult
from uav_bt.campaign.plan import CampaignPlan
from uav_bt.campaign.report.statistics import by_tree, summarise
from uav_bt.campaign.runner import Backend, LocalBackend
from uav_bt.cli.command import Command
from uav_bt.cli.lookup_options import lookup_options
from uav_bt.cli.options import (
    FOLDER,
    RUNS,
    image_size_option,
    movers_option,
    policy_option,
    profile_option,
    tree_option,
    workers_option,
)
from uav_bt.cli.progress import campaign_progress
from uav_bt.cli.ranges import Number, WholeNumber
from uav_bt.errors import MissionError
from uav_bt.tree.loading.folders import TreeFolders


@click.command(cls=Command)
@click.argument("trees", metavar="TREE...", nargs=-1)
@click.option(
    "--scenes",
    metavar="GLOB",
    multiple=True,
    help="Scenes by name, file or pattern, with commas between. Repeatable; default: val-*.",
)
@click.option(
    "--flights",
    type=WholeNumber(min=1),
    help="Flights of each tree in each scene, one seed each; default: 10.",
)
@click.option(
    "--seed-from", type=WholeNumber(min=0), default=0, show_default=True, help="The first seed."
)
@workers_option
@profile_option
@click.option("--exact-masks", is_flag=True, help="Fly on exact masks instead of a network's.")
@movers_option
@tree_option
@lookup_options
@image_size_option
@policy_option
@click.option(
    "--out",
    metavar="DIR",
    type=FOLDER,
    help="Where the plan and the flights are kept; default: runs/TREE.",
)
@click.option(
    "--resume",
    metavar="DIR",
    type=FOLDER,
    help="Continue the campaign in this folder, with the plan that is kept there.",
)
@click.option(
    "--backend",
    type=click.Choice(["local", "dask"]),
    default="local",
    show_default=True,
    help="This machine's cores, or a Dask cluster.",
)
@click.option("--address", metavar="HOST:PORT", help="Address of the Dask scheduler.")
@click.option(
    "--timeout-s",
    type=Number(min=0.0, min_open=True),
    default=900.0,
    show_default=True,
    help="Wall time after which a flight counts as hung.",
)
@click.option("--record", is_flag=True, help="Keep a record of every flight in DIR/records.")
@click.option(
    "--fail-under",
    metavar="PERCENT",
    type=Number(min=0.0, max=100.0),
    help="Exit with 1 when fewer flights succeed.",
)
@click.pass_context
def campaign(
    ctx: click.Context,
    *,
    trees: tuple[str, ...],
    scenes: tuple[str, ...],
    flights: int | None,
    seed_from: int,
    workers: int | None,
    profile: str,
    exact_masks: bool,
    movers: int,
    tree_id: str | None,
    tree_folders: TreeFolders,
    image_size: tuple[int, int],
    policies: dict[str, str],
    out: Path | None,
    resume: Path | None,
    backend: str,
    address: str | None,
    timeout_s: float,
    record: bool,
    fail_under: float | None,
) -> None:
    """Fly missions many times and keep every flight.

    TREE is a tree file, or the name of a mission that ships with uav-bt; each flies in every scene.
    Flights are kept one by one in DIR/flights.jsonl. The same command continues a campaign that was
    stopped; more --flights add to it. A flight that crashes or hangs its process counts as
    `error`. `uav-bt report DIR` shows what came of it. A flight with networks takes about 45 s of a
    core: fifty in each of two scenes are more than an hour on one.

    \b
    Examples:
      uav-bt campaign land_only --scenes val-a,val-b --flights 50 --out runs/land
      uav-bt campaign --resume runs/land

    Exits with 0 when all flights were flown, whatever their outcome (but see --fail-under), with 1
    when it was stopped, and with 2 when something given was refused.
    """  # noqa: D301  (click needs the backspace)
    if backend == "dask" and workers is not None:
        raise click.UsageError("--workers is for this machine; a cluster knows its own")
    if (backend == "dask") != (address is not None):
        raise click.UsageError("--backend dask and --address belong together")
    if resume is not None:
        _only_resume(ctx)
    elif not trees:
        raise click.UsageError("which TREE is to be flown? or --resume DIR")
    if resume is not None:
        plan, folder = campaigns.plan_of(resume), resume
    else:
        plan = campaigns.make_plan(
            trees,
            scenes=scenes or ("val-*",),
            flights=flights or 10,
            policies=policies,
            seed_from=seed_from,
            profile=profile,
            image_size_px=image_size,
            exact_masks=exact_masks,
            movers=movers,
            tree_id=tree_id,
            tree_folders=tree_folders,
            timeout_s=timeout_s,
            record=record,
        )
        folder = out or RUNS / "-".join(Path(tree.name).stem for tree in plan.trees)
    result = _fly(ctx, plan, folder, _backend(workers, address))
    _print_result(result, folder)
    good = sum(flight["outcome"] == "success" for flight in result.flights)
    if fail_under is not None and 100.0 * good / len(result.flights) < fail_under:
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


def _backend(workers: int | None, address: str | None) -> Backend:
    if address is not None:
        from uav_bt.campaign.cluster import DaskBackend  # noqa: PLC0415  (an extra of its own)

        return DaskBackend(address)
    return LocalBackend(workers)


def _fly(ctx: click.Context, plan: CampaignPlan, folder: Path, backend: Backend) -> CampaignResult:
    with campaign_progress(len(plan)) as progress:
        try:
            return campaigns.run(
                plan, folder, backend=backend, on_flight=progress.add, on_note=progress.note
            )
        except KeyboardInterrupt:
            progress.note(
                f"stopped; {progress.done} of {len(plan)} flights are kept in {folder}, "
                "and the same command continues from there"
            )
            ctx.exit(MissionError.exit_code)


def _print_result(result: CampaignResult, folder: Path) -> None:
    for tree, flights in by_tree(result.flights).items():
        _print_tree(tree, flights)
    click.echo(f"flights: {folder / 'flights.jsonl'}")


def _print_tree(tree: str, flights: Iterable[dict[str, Any]]) -> None:
    summary = summarise(flights)
    low, high = summary.success_95
    outcomes = ", ".join(f"{name} {count}" for name, count in summary.outcomes.items())
    click.echo(
        f"{tree}: {summary.flights} flights, {outcomes}; success {100 * summary.success:.1f} % "
        f"(95 % Wilson interval {100 * low:.1f} to {100 * high:.1f} %)"
    )
    heads = ("mean", "median", "p5", "p95", "least", "most")
    click.echo(f"  {'':23}{'n':>5}" + "".join(f"{head:>8}" for head in heads))
    for name, found in summary.metrics.items():
        if found is not None:
            numbers = (found.mean, found.median, found.p5, found.p95, found.least, found.most)
            click.echo(
                f"  {name:<23}{found.count:>5}" + "".join(f"{value:>8.2f}" for value in numbers)
            )
