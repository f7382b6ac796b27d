"""`uav-bt record`: what is in a flight's record, and what can be made of it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from uav_bt.cli.options import output_option
from uav_bt.errors import FileError

if TYPE_CHECKING:
    from uav_bt.record.info import RecordInfo

__all__ = ["record"]

_SHOWN = ("tree", "scene", "seed", "drone", "profile", "record_quality", "started", "uav_bt", "git")
_FILE = click.Path(dir_okay=False, path_type=Path)


@click.group()
def record() -> None:
    """Look at records of flights, repair them, cut them."""


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


@record.command()
@click.argument("file", type=_FILE)
@output_option("--out", "The repaired record; default: FILE with `.repaired` in its name.")
def repair(*, file: Path, out: Path | None) -> None:
    """Write a whole record of all that is whole in an unfinished or damaged one."""
    from uav_bt.record.copying import repair_record  # noqa: PLC0415 - late, as above

    target = file.with_name(f"{file.stem}.repaired{file.suffix}") if out is None else out
    if out is None and target.exists():
        raise FileError(target, "exists already; name another file with --out")
    result = repair_record(file, target)
    for damage in result.damages:
        click.echo(f"{file}: {damage}", err=True)
    click.echo(f"written: {result.path} ({result.messages} messages)")


@record.command()
@click.argument("file", type=_FILE)
@click.option("--from", "from_s", type=float, default=0.0, show_default=True, help="Seconds.")
@click.option("--to", "to_s", type=float, required=True, help="Seconds since the record began.")
@click.option("--out", type=_FILE, required=True, help="The new record.")
def cut(*, file: Path, from_s: float, to_s: float, out: Path) -> None:
    """Write a part of a record. A cut from its beginning can be replayed, others only be viewed."""
    from uav_bt.record.copying import cut_record  # noqa: PLC0415 - late, as above

    result = cut_record(file, out, from_s=from_s, to_s=to_s)
    click.echo(f"written: {result.path} ({result.messages} messages)")


def _text(found: RecordInfo) -> str:
    state = "whole" if found.finished and not found.damages else "NOT WHOLE"
    lines = [f"{found.path}: {state}, {found.duration_s:.1f} s, {found.bytes / 1e6:.1f} MB"]
    lines += [f"  {name}: {found.metadata[name]}" for name in _SHOWN if name in found.metadata]
    if found.end is None:
        lines.append("  unfinished: no index, no summary; `uav-bt record repair` makes it whole")
    else:
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
