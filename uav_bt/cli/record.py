"""`uav-bt record info`, `view` and `replay`: commands for records of flights."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, Final

import click
from annotated_types import Ge

from uav_bt.app.replay import Difference, ReplayOptions, ReplayReport
from uav_bt.app.replay import replay as replay_record
from uav_bt.app.replay.differences import LOSSY_NUMBERS, LOSSY_TICKS
from uav_bt.app.view.recorded import WITHOUT_DISPLAY, RecordedFlight
from uav_bt.cli.declare import command
from uav_bt.cli.progress import progress_bars
from uav_bt.cli.shared import TextFormat, table
from uav_bt.display.rerun import sinks
from uav_bt.option import Option
from uav_bt.record.info import record_info

_METADATA: Final = (
    *("tree", "lab", "scene", "seed", "drone", "profile", "record_quality", "started"),
    *("uav_bt", "git"),
)
_IN_REPLAY: Final = ("tree", "tree_folders", "leaves", "policies", "masks")  # no registry
_MAX_PRINTED: Final = 20  # differing ticks, and nodes that differ

_Record = Annotated[Path, Option(path="read")]


@command()
def info(file: _Record, *, format_: TextFormat = "text") -> None:
    """Print the content of a record: duration, rates, losses, and whether it is whole."""
    found = record_info(file)
    click.echo(json.dumps(found, indent=2) if format_ == "json" else "\n".join(_described(found)))


def _described(found: dict[str, Any]) -> Iterator[str]:
    state = "whole" if found["finished"] and not found["damages"] else "NOT WHOLE"
    yield f"{found['path']}: {state}, {found['duration_s']:.1f} s, {found['bytes'] / 1e6:.1f} MB"
    known = found["metadata"]
    yield from (f"  {name}: {known[name]}" for name in _METADATA if name in known)
    if not found["finished"]:
        yield "  unfinished: no index, no summary; `mcap recover` makes it whole"
    if found["end"] is not None:
        yield f"  outcome: {found['end'].get('outcome')}, {found['end'].get('reason')}"
    if found["lost_ticks"]:
        yield f"  {found['lost_ticks']} ticks lost"
    yield from (f"  attached: {name}, {size} bytes" for name, size in found["attachments"].items())
    rows = [("channel", "content", "messages", "Hz", "kB", "left out")]
    for each in found["channels"]:
        size = (f"{each['rate_hz']:.1f}", f"{each['bytes'] / 1e3:.1f}", each["dropped"])
        rows.append((each["topic"], each["content"], each["messages"], *size))
    yield table(rows, left=2, indent="  ")
    yield from (f"  damage: {damage}" for damage in found["damages"])


@command()
def view(
    file: _Record,
    *,
    save: Annotated[Path | None, Option(path="written", suffix=".rrd")] = None,
    web: bool = False,
    from_s: Annotated[float | None, Ge(0), Option(form="--from SECONDS")] = None,
    to_s: Annotated[float | None, Ge(0), Option(form="--to SECONDS")] = None,
) -> None:
    """Show a record of `uav-bt fly --record` in Rerun.

    Camera with overlays, mask, metric depth, the lab and the path in 3D, the tree with its
    statuses, and plots, on one timeline. Opens a window unless --web or --save is given.
    A record that was cut short is shown as far as it goes.

    Options:
        save: Keep the view: an rrd file, which `rerun FILE` opens anywhere.
        web: Show it in a browser on this machine, until Ctrl-C.
        from_s: Begin here, from the record's start.
        to_s: End here, from the record's start.
    """
    if from_s is not None and to_s is not None and from_s >= to_s:
        raise click.UsageError(f"--from {from_s:g} must lie before --to {to_s:g}")
    flight = RecordedFlight(file, from_s=from_s, to_s=to_s)
    if save is not None:
        with progress_bars() as advance:
            flight.save(save, advance=advance)
        click.echo(f"view: {save}")
    if web or save is None:
        _show(flight, web=web)
    for damage in flight.damages:
        click.echo(f"{file}: {damage}", err=True)


def _show(flight: RecordedFlight, *, web: bool) -> None:
    with sinks.shown(web=web, instead=WITHOUT_DISPLAY) as viewer:
        if viewer.url is not None:
            click.echo(f"{viewer.url}\nCtrl-C ends it.")
        with progress_bars() as advance:
            flight.draw(viewer.stream, advance=advance, stopped=lambda: viewer.closed)
        try:
            viewer.process.wait()
        except KeyboardInterrupt:
            click.echo("", err=True)


@command()
def replay(
    file: _Record,
    *,
    changes: Annotated[ReplayOptions, Option(parts=ReplayOptions, only=_IN_REPLAY)],
    format_: TextFormat = "text",
) -> bool:
    """Feed recorded frames through perception and tree, and print what differs.

    New decisions do not change the recorded frames. Exits with 0 when statuses and
    commands are the recorded ones (of a lossy record: within the tolerance that is printed), 1 when
    they differ, and 2 when the record or an option is refused.
    """
    report = replay_record(file, changes)
    if format_ == "json":
        click.echo(json.dumps(report.to_json(), indent=2))
    else:
        click.echo("\n".join(_report_lines(report)))
    return report.same


def _report_lines(report: ReplayReport) -> Iterator[str]:
    for difference in report.differences[:_MAX_PRINTED]:
        yield from _difference_lines(difference)
    if report.differing_ticks > _MAX_PRINTED:
        yield f"... and {report.differing_ticks - _MAX_PRINTED} more ticks (--format json has them)"
    for path, count in list(report.nodes.items())[:_MAX_PRINTED]:
        yield f"{count:>6} ticks differ at {path}"
    yield from (f"only in the recording: {path}" for path in report.only_recorded)
    yield from (f"only in the replay: {path}" for path in report.only_replayed)
    yield from (f"damage: {damage}" for damage in report.damages)
    if report.missing_images:
        yield f"{report.missing_images} frames lack their image: the disk was too slow"
    if report.masks == "recorded":
        yield "class maps: the recorded ones"
    if report.ended is not None:
        yield f"ended early: {report.ended}"
    verdict = "the same" if report.same else "different"
    tolerance = (
        ""
        if report.exact
        else f" (the record is not exact: {100 * LOSSY_TICKS:.0f} % of the ticks and "
        f"{LOSSY_NUMBERS} m or rad of a command may differ)"
    )
    yield (
        f"{report.ticks} ticks: {report.status_ticks} differ in statuses, "
        f"{report.command_ticks} in commands; {verdict}{tolerance}"
    )


def _difference_lines(difference: Difference) -> Iterator[str]:
    head = f"{difference.time_s:8.2f} s"
    for path, (recorded, replayed) in difference.statuses.items():
        yield f"{head}  {path}: {recorded} -> {replayed}"
    if difference.proposed_by is not None:
        recorded_by, replayed_by = (name or "nobody" for name in difference.proposed_by)
        yield f"{head}  proposed by {recorded_by} -> {replayed_by}"
    if difference.command is not None:
        yield f"{head}  command: {difference.command[0]} -> {difference.command[1]}"
