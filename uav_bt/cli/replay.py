"""`uav-bt replay`: a recorded flight through perception and tree again."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Final, Literal

import click

from uav_bt.cli.options import policy_option
from uav_bt.errors import MissionError

if TYPE_CHECKING:
    from uav_bt.app.replay import Difference, ReplayReport

__all__ = ["replay"]

_SHOWN: Final = 20  # differing ticks that are told one by one


@click.command()
@click.argument("file", type=click.Path(dir_okay=False, path_type=Path))
@click.option("--tree", metavar="TREE", help="Replay this mission, not the recorded one.")
@policy_option()
@click.option(
    "--masks",
    type=click.Choice(["network", "recorded"]),
    help="Where class maps come from; default: the tree's network, or the record if the flight "
    "flew on exact masks.",
)
@click.option(
    "--format",
    "form",
    type=click.Choice(["text", "json"]),
    default="text",
    show_default=True,
    help="For people, or one JSON object with all differences.",
)
@click.pass_context
def replay(
    ctx: click.Context,
    *,
    file: Path,
    tree: str | None,
    policies: dict[str, str],
    masks: Literal["network", "recorded"] | None,
    form: str,
) -> None:
    """Feed recorded frames through perception and tree, and print what differs.

    What is decided now changes nothing of what was seen then. Exits with 0 when statuses and
    commands are the recorded ones (of a lossy record: within the tolerance that is printed), 1 when
    they differ, and 2 when the record or what was given is refused.
    """
    from uav_bt.app.replay import ReplayOptions, replay  # noqa: PLC0415 - for --help

    report = replay(file, ReplayOptions(tree=tree, policies=policies, masks=masks))
    if form == "json":
        click.echo(json.dumps(report.to_json(), indent=2))
    else:
        for line in _text(report):
            click.echo(line)
    if not report.same:
        ctx.exit(MissionError.exit_code)


def _text(report: ReplayReport) -> Iterator[str]:
    for difference in report.differences[:_SHOWN]:
        yield from _told(difference)
    if report.differing_ticks > _SHOWN:
        yield f"... and {report.differing_ticks - _SHOWN} more ticks (--format json has them)"
    for path, count in list(report.nodes.items())[:_SHOWN]:
        yield f"{count:>6} ticks differ at {path}"
    yield from (f"only in the recording: {path}" for path in report.only_recorded)
    yield from (f"only in the replay: {path}" for path in report.only_replayed)
    yield from (f"damage: {damage}" for damage in report.damages)
    if report.missing_pictures:
        yield f"{report.missing_pictures} frames lack their picture: the disk was too slow then"
    if report.masks == "recorded":
        yield "class maps: the recorded ones"
    if report.ended is not None:
        yield f"ended early: {report.ended}"
    verdict = "the same" if report.same else "different"
    yield (
        f"{report.ticks} ticks: {report.status_ticks} differ in statuses, "
        f"{report.command_ticks} in commands; {verdict}{_tolerance(report)}"
    )


def _tolerance(report: ReplayReport) -> str:
    from uav_bt.app.replay.differences import LOSSY_NUMBERS, LOSSY_TICKS  # noqa: PLC0415 - late

    if report.exact:
        return ""
    return (
        f" (the record is not exact: {100 * LOSSY_TICKS:.0f} % of the ticks and {LOSSY_NUMBERS} m "
        "or rad of a command may differ)"
    )


def _told(difference: Difference) -> Iterator[str]:
    head = f"{difference.time_s:8.2f} s"
    for path, (recorded, replayed) in difference.statuses.items():
        yield f"{head}  {path}: {recorded} -> {replayed}"
    if difference.proposed_by is not None:
        recorded_by, replayed_by = (name or "nobody" for name in difference.proposed_by)
        yield f"{head}  proposed by {recorded_by} -> {replayed_by}"
    if difference.command is not None:
        yield f"{head}  command: {difference.command[0]} -> {difference.command[1]}"
