"""`uav-bt campaign`, `report` and `shrink`: many flights, results, causes of a failure."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import Annotated, Final, Literal

import click
from annotated_types import Ge, Le

from sim_bridge.twin.scene_file import scene_text
from uav_bt import campaign as campaigns
from uav_bt.app.options import SHARED, FlightOptions
from uav_bt.campaign import CampaignResult
from uav_bt.campaign.plan import CampaignPlan
from uav_bt.campaign.report import statistics as stats
from uav_bt.campaign.report.paired import losses_of
from uav_bt.campaign.report.sources import by_tree, fly_command, read_sources
from uav_bt.campaign.runner import Backend, LocalBackend
from uav_bt.campaign.shrinking import FailedFlight, same_cause
from uav_bt.campaign.shrinking import shrink as shrink_flight
from uav_bt.campaign.store import METRICS
from uav_bt.cli.declare import command
from uav_bt.cli.progress import campaign_progress
from uav_bt.cli.shared import RUNS, OutputFolder, Positive, Workers, table
from uav_bt.errors import InputError
from uav_bt.files import check_empty_folder, write_whole, writing
from uav_bt.option import Option

_OPTIONS: Final = (*(name for name in SHARED if name != "record_quality"), "params")
_RESUMED: Final = {"resume", "workers", "backend", "address", "fail_under"}  # may go together
_TWIN: Final = "twin"


def _backend(
    *,
    workers: Workers = None,
    backend: Literal["local", "dask"] = "local",
    address: Annotated[str | None, Option(form="HOST:PORT")] = None,
) -> Backend:
    """Return what flies: `workers` of this machine, None for one on each core, or a cluster.

    Options:
        backend: This machine's cores, or a Dask cluster.
        address: Address of the Dask scheduler.
    """
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
    trees: Annotated[tuple[str, ...], Option(form="TREE...")] = (),
    *,
    scenes: Annotated[tuple[str, ...], Option(form="GLOB")] = (),
    flights: Annotated[int | None, Ge(1)] = None,
    seed_from: Annotated[int, Ge(0)] = 0,
    timeout_s: Positive = CampaignPlan.timeout_s,
    record: bool = False,
    flight: Annotated[FlightOptions, Option(parts=FlightOptions, only=_OPTIONS)],
    backend: Annotated[Backend, Option(parts=_backend)],
    out: OutputFolder = None,
    resume: OutputFolder = None,
    fail_under: Annotated[float | None, Ge(0), Le(100), Option(form="PERCENT")] = None,
) -> bool:
    """Fly missions many times and keep every flight.

    TREE is a tree file, or the name of a mission that ships with uav-bt; each flies in every scene.
    With `variants` in the file of --params, each tree flies with the values of each variant.
    Flights are kept one by one in DIR/flights.jsonl. The same command continues a campaign that was
    stopped; more --flights add to it. A flight that crashes or hangs its process counts as
    `error`. `uav-bt report DIR` writes the report. A flight with networks takes 30 to 60 s of a
    core, and a fifth of that with `--drone plain`, which draws no images.

    Exits with 0 when all flights were flown, whatever their outcome (but see --fail-under), with 1
    when it was stopped, and with 2 when something given was refused.

    Options:
        scenes: Scenes by name, file or pattern, with commas between. Repeatable; default: those of
            --lab, else val-*.
        flights: Flights of each tree in each scene, one seed each; default: 10.
        seed_from: The first seed.
        timeout_s: Wall time after which a flight counts as hung.
        record: Keep a record of every flight in DIR/records.
        out: Where the plan and the flights are kept; default: runs/TREE.
        resume: Continue the campaign in this folder, with the plan that is kept there.
        fail_under: Exit with 1 when fewer flights succeed.
    """
    if resume is not None:
        _only_resume(click.get_current_context())
        plan, folder = campaigns.plan_of(resume), resume
    elif trees:
        plan = campaigns.make_plan(
            trees,
            flight,
            scenes=scenes or None,
            flights=flights or 10,
            seed_from=seed_from,
            timeout_s=timeout_s,
            record=record,
        )
        folder = out or RUNS / "-".join(dict.fromkeys(Path(tree.path).stem for tree in plan.trees))
    else:
        raise click.UsageError("which TREE is to be flown? or --resume DIR")
    with campaign_progress(len(plan), folder) as progress:
        result = campaigns.run(
            plan, folder, backend=backend, on_flight=progress.add, on_note=progress.note
        )
    _print_result(result)
    click.echo(f"flights: {folder / 'flights.jsonl'}")
    good = 100.0 * stats.successes(result.flights) / len(result.flights)
    return fail_under is None or good >= fail_under


def _only_resume(ctx: click.Context) -> None:
    """Refuse options that the folder's plan decides."""
    given = [
        param.opts[0] if isinstance(param, click.Option) else "TREE"
        for param in ctx.command.params
        if (name := str(param.name)) not in _RESUMED
        and ctx.get_parameter_source(name) is click.core.ParameterSource.COMMANDLINE
    ]
    if given:
        raise click.UsageError(
            f"--resume takes the plan from its folder, so leave out {', '.join(given)}"
        )


def _print_result(result: CampaignResult) -> None:
    for tree, flights in by_tree(result.flights).items():
        low, high = stats.success_interval(flights)
        ends = Counter(flight["outcome"] for flight in flights)
        del ends[stats.SUCCESS]
        failures = "".join(f"; {name} {count}" for name, count in ends.most_common())
        success = f"success {stats.success_words(flights)}"
        click.echo(f"{tree}: {success} (95 % Wilson interval {low:.1f} to {high:.1f} %){failures}")
        rows = [["", "unit", "n", "mean", "median", "p5", "p95", "least", "most"]]
        for name, metric in METRICS.items():
            if values := stats.values_of(flights, name):
                numbers = stats.spread(values).values()
                cells = ("" if each is None else f"{each:.2f}" for each in numbers)
                rows.append([name, metric.unit, str(len(values)), *cells])
        click.echo(table(rows, indent="  "))


@command()
def report(
    sources: Annotated[tuple[Path, ...], Option(form="DIR...")],
    *,
    out: Annotated[Path | None, Option(path="written", suffix=".html")] = None,
    figures: Literal["png", "svg", "pdf", "none"] = "png",
    all_pairs: bool = False,
    not_worse: bool = False,
) -> bool:
    """Write the report of campaigns, their trees side by side.

    DIR is the folder of a `uav-bt campaign`, or a file with one flight per line. The page is
    self-contained. Its figures are also written to the folder report-figures beside it, and its
    tables (CSV) beside it.

    Trees that flew in the same scenes with the same seeds are compared flight by flight: McNemar's
    test of success, and paired differences of coverage, clearance, landing error and duration.
    Worse, for --not-worse, is a tree with two more failures among these flights, a median coverage
    more than 2 points lower or a 5th percentile of the clearance more than 2 cm lower.

    Options:
        out: The HTML page; figures and tables go beside it. Default: DIR/report.html
        figures: Form of the files of figures; the page always has PNGs inside.
        all_pairs: Compare all trees with each other, not only the first with each other one.
        not_worse: Exit with 1 if a tree is worse than the first on the same flights.
    """
    # Late: it imports matplotlib, which takes a second.
    from uav_bt.campaign.report.campaign_report import write_report  # noqa: PLC0415

    losses = losses_of(read_sources(sources)) if not_worse else []
    written = write_report(
        sources,
        out,
        figures=None if figures == "none" else figures,
        all_pairs=all_pairs,
        on_note=lambda note: click.echo(f"note: {note}", err=True),
    )
    for file in (written.page, *written.images, *written.tables):
        click.echo(file)
    for loss in losses:
        click.echo(f"worse: {loss}", err=True)
    return not losses


@command()
def shrink(
    source: Annotated[Path, Option(form="DIR")],
    *,
    tree_name: Annotated[str | None, Option(form="--tree NAME")] = None,
    scene: Annotated[str | None, Option(form="NAME")] = None,
    seed: Annotated[int | None, Ge(0)] = None,
    out: Annotated[Path, Option(path="folder")],
    twin: bool = False,
) -> bool:
    """Reduce a failed flight to the fewest causes that still make it fail.

    DIR is the folder of a `uav-bt campaign`, or a file with one flight per line. The first flight
    that failed is taken, unless --tree, --scene and --seed name another. Boxes, movers and faults
    are left out as long as the flight ends with the same outcome and reason; numbers may differ.
    The rest is written as a scene file and a fault file, with the commands that fly them: with the
    drone that failed, and in the twin with images.

    Exits with 0 when the flight was reduced, with 1 when it was stopped or does not fail in the
    twin (--twin), and with 2 when something given was refused.

    Options:
        tree_name: Of the flight; default: any.
        scene: Of the flight; default: any.
        seed: Of the flight; default: any.
        out: A new or empty folder for scene and faults.
        twin: Fly the result in the twin, too; exit with 1 if it does not fail.
    """
    check_empty_folder(out, "shrink")
    flight, others = _failed(source, tree_name, scene, seed)
    click.echo(f"{flight.ending}; {len(flight.parts())} parts: objects, movers and faults")
    click.echo("  parts  end of the flight")
    small = shrink_flight(flight, lambda count, ending: click.echo(f"  {count:>5}  {ending}"))
    with writing(out):
        out.mkdir(parents=True, exist_ok=True)
    file, faults = out / "scene.yaml", out / "faults.txt"
    write_whole(file, scene_text(small.scene))
    write_whole(faults, "".join(f"{fault}\n" for fault in small.options.faults))
    kept = (f"{kind} {len(some)}" for kind, some in small.things().items())
    click.echo(f"remaining: {', '.join(kept)}; {file}, {faults}")
    options = small.options
    given = [f"@{faults}"] if options.faults else []
    for drone in dict.fromkeys((options.drone_name, _TWIN)):
        flown = {**vars(options), "faults": given, "drone": drone}
        repeat = fly_command(small.tree, str(file), flown, options, out=str(out / drone))
        images = ", with images" if drone == _TWIN else ""
        click.echo(f"command to repeat it, drone {drone}{images}:\n  {repeat}")
    if others:
        click.echo(f"failed, too, and not reduced: {others}; --tree, --scene and --seed choose one")
    if not twin:
        return True
    ending = small.fly(_TWIN)
    click.echo(f"in the twin: {ending}")
    return same_cause(ending, small.ending)


def _failed(
    source: Path, tree: str | None, scene: str | None, seed: int | None
) -> tuple[FailedFlight, int]:
    """Return the first failed flight of this tree, scene and seed, and the number of others.

    None stands for any. An InputError says that there is none.
    """
    found = [
        (one, line)
        for one in read_sources([source])
        for line in one.flights
        if tree in {None, one.tree, Path(one.tree).stem}
        and scene in {None, line["scene"]}
        and seed in {None, line["seed"]}
        and line["outcome"] != stats.SUCCESS
    ]
    if not found:
        raise InputError(
            f"{source} has no failed flight of this tree, scene and seed; `uav-bt report` lists "
            "those that failed"
        )
    one, line = found[0]
    path = one.scene_path(str(line["scene"]))
    return FailedFlight.of(line, one.tree_path(), path, one.options), len(found) - 1
