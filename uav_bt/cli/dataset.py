"""`uav-bt dataset`: what records hold, for training."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from uav_bt.cli.progress import progress_bars

if TYPE_CHECKING:
    from uav_bt.learning.dataset.summary import DatasetSummary

__all__ = ["dataset"]


@click.group()
def dataset() -> None:
    """Flight records as training sets."""


@dataset.command()
@click.argument(
    "files", nargs=-1, required=True, metavar="FILES...", type=click.Path(path_type=Path)
)
@click.option(
    "--index",
    "folder",
    metavar="DIR",
    type=click.Path(file_okay=False, path_type=Path),
    help="Where indices are kept; beside each record if not given.",
)
@click.option(
    "--format",
    "form",
    type=click.Choice(["text", "json"]),
    default="text",
    show_default=True,
    help="For people, or one JSON object.",
)
def info(*, files: tuple[Path, ...], folder: Path | None, form: str) -> None:
    """Count flights, frames, hours, scenes, outcomes and commands.

    FILES are records of `uav-bt fly --record`. Each is read once; what it says beside its pictures
    is kept in an index.
    """
    from uav_bt.learning.dataset.index_file import flight_data  # noqa: PLC0415 - `--help` need not wait
    from uav_bt.learning.dataset.summary import summarise  # noqa: PLC0415

    flights = []
    with progress_bars() as advance:
        for done, file in enumerate(files, start=1):
            flights.append(flight_data(file, folder))
            advance("records", done, len(files))
    found = summarise(flights)
    click.echo(json.dumps(asdict(found)) if form == "json" else _text(found))


def _text(found: DatasetSummary) -> str:
    gigabytes = found.picture_bytes / 1e9
    lines = [
        f"flights   {found.flights}",
        f"frames    {found.frames} ({gigabytes:.2f} GB decoded)",
        f"hours     {found.hours:.3f}",
        f"ticks     {found.ticks}",
        f"cameras   {found.cameras}",
        f"scenes    {_counts(found.scenes)}",
        f"outcomes  {_counts(found.outcomes)}",
        "commands",
    ]
    lines += [
        f"  {name:<10} {count:>8}  {100.0 * count / found.ticks:5.1f} %"
        for name, count in found.commands.items()
    ]
    if found.cameras > 1:
        lines.append(
            "a data set takes the flights of one camera: these cannot be trained on at once"
        )
    return "\n".join(lines)


def _counts(found: Mapping[str, int]) -> str:
    return ", ".join(f"{name} {count}" for name, count in found.items())
