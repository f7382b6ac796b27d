"""`uav-bt log`: what a logged flight's nodes did, and how long."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from uav_bt.errors import FileError

if TYPE_CHECKING:
    from uav_bt.groot.btlog import BtlogReader
    from uav_bt.groot.durations import NodeDurations
    from uav_bt.groot.logged_tree import LoggedNode
    from uav_bt.groot.transitions import Transition

__all__ = ["log"]


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--durations", is_flag=True, help="For each node: how often it ran, how long, how it ended."
)
@click.option(
    "--format",
    "form",
    type=click.Choice(["table", "jsonl"]),
    default="table",
    show_default=True,
    help="For people, or a JSON object a line.",
)
def log(*, file: Path, durations: bool, form: str) -> None:
    """Print a log of `uav-bt fly --btlog`, or of any engine that writes FileLogger2.

    A line is a node whose status changed; times are seconds since the log began. A log that was cut
    short is printed as far as it goes.
    """
    from uav_bt.groot.btlog import BtlogReader  # noqa: PLC0415 - `--help` need not wait for these
    from uav_bt.groot.durations import node_durations  # noqa: PLC0415
    from uav_bt.groot.logged_tree import read_logged_tree  # noqa: PLC0415

    with BtlogReader(file) as reader:
        nodes = read_logged_tree(reader.xml, file)
        known = _known(reader, nodes, file)
        rows = (
            _duration_rows(node_durations(known).values(), nodes)
            if durations
            else _transition_rows(known, nodes)
        )
        show = _json_lines if form == "jsonl" else _table
        for line in show(rows, _DURATION_FORMAT if durations else _TRANSITION_FORMAT):
            click.echo(line)
        if reader.partial_bytes:
            message = (
                f"{file}: cut short; its last {reader.partial_bytes} bytes are no whole record"
            )
            click.echo(message, err=True)


# How a row is laid out, and its columns' heads.
_TRANSITION_FORMAT: Final = (
    "{time_s:>10} {uid:>5}  {status:<8} {node}",
    ("time_s", "uid", "status"),
)
_COUNTS: Final = ("activations", "successes", "failures", "halts")
_DURATION_FORMAT: Final = (
    "{running_s:>10} {longest_s:>10} "
    + " ".join(f"{{{name}:>8}}" for name in _COUNTS)
    + "  {node}",
    ("running_s", "longest_s", *_COUNTS),
)
_HEADS: Final = {
    "time_s": "time s",
    "running_s": "running s",
    "longest_s": "longest s",
    "activations": "starts",
    "successes": "success",
    "failures": "failure",
    "halts": "halted",
}


def _known(reader: BtlogReader, nodes: dict[int, LoggedNode], file: Path) -> Iterator[Transition]:
    """Pass transitions on; refuse one of a node that the log's tree does not have."""
    from uav_bt.groot.transitions import RECORD_BYTES  # noqa: PLC0415

    for transition in reader:
        if transition.uid not in nodes:
            raise FileError(
                file,
                f"byte {reader.offset - RECORD_BYTES}: a transition of node {transition.uid}, "
                "which the log's tree does not have",
            )
        yield transition


def _transition_rows(
    transitions: Iterable[Transition], nodes: dict[int, LoggedNode]
) -> Iterator[dict[str, Any]]:
    for time_us, uid, status in transitions:
        yield {
            "time_s": time_us / 1e6,
            "uid": uid,
            "status": status.name,
            "node": nodes[uid].path,
        }


def _duration_rows(
    durations: Iterable[NodeDurations], nodes: dict[int, LoggedNode]
) -> Iterator[dict[str, Any]]:
    for item in sorted(durations, key=lambda item: item.uid):
        yield {
            "uid": item.uid,
            "node": nodes[item.uid].path,
            "activations": item.activations,
            "running_s": item.running_us / 1e6,
            "longest_s": item.longest_us / 1e6,
            "successes": item.successes,
            "failures": item.failures,
            "halts": item.halts,
            "still_running": item.still_running,
        }


def _json_lines(rows: Iterable[dict[str, Any]], _layout: object) -> Iterator[str]:
    return (json.dumps(row) for row in rows)


def _table(rows: Iterable[dict[str, Any]], layout: tuple[str, tuple[str, ...]]) -> Iterator[str]:
    line, columns = layout
    heads = {name: _HEADS.get(name, name) for name in columns}
    yield line.format(**heads, node="node")
    for row in rows:
        cells = {
            name: f"{value:.3f}" if isinstance(value, float) else value
            for name, value in row.items()
        }
        running = "  (still running)" if row.get("still_running") else ""
        yield line.format(**cells) + running
