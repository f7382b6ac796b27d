"""`uav-bt record`: what is in a flight's record."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from uav_bt.record.info import RecordInfo

__all__ = ["record"]

_SHOWN = ("tree", "scene", "seed", "drone", "profile", "record_quality", "started", "uav_bt", "git")
_FILE = click.Path(dir_okay=False, path_type=Path)


@click.group()
def record() -> None:
    """Look into records of flights."""


@record.command()
@click.argument("file", type=_FILE)
@click.option(
    "--format",
    "form",
    type=click.Choice(["text", "json"]),
    default="text",
    show_default=True,
    help="For people, or one JSON object.",
)
def info(*, file: Path, form: str) -> None:
    """Print content, duration, rates and losses of a record, and whether it is whole."""
    from uav_bt.record.info import record_info  # noqa: PLC0415 - `--help` need not wait for it

    found = record_info(file)
    click.echo(json.dumps(found.to_json(), indent=2) if form == "json" else _text(found))


def _text(found: RecordInfo) -> str:
    state = "whole" if found.finished and not found.damages else "NOT WHOLE"
    lines = [f"{found.path}: {state}, {found.duration_s:.1f} s, {found.bytes / 1e6:.1f} MB"]
    lines += [f"  {name}: {found.metadata[name]}" for name in _SHOWN if name in found.metadata]
    if not found.finished:
        lines.append("  unfinished: no index, no summary; `mcap recover` makes it whole")
    if found.end is not None:
        lines.append(f"  outcome: {found.end.get('outcome')}, {found.end.get('reason')}")
    if found.lost_ticks:
        lines.append(f"  {found.lost_ticks} ticks lost")
    lines += [f"  attached: {name}, {size} bytes" for name, size in found.attachments.items()]
    row = "  {:<28} {:<26} {:>8} {:>8} {:>10} {:>8}"
    lines.append(row.format("channel", "content", "messages", "Hz", "kB", "left out"))
    lines += [
        row.format(
            channel.topic,
            channel.content,
            channel.messages,
            f"{channel.rate_hz:.1f}",
            f"{channel.bytes / 1e3:.1f}",
            channel.dropped,
        )
        for channel in found.channels
    ]
    lines += [f"  damage: {damage}" for damage in found.damages]
    return "\n".join(lines)
