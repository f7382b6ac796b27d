"""`uav-bt nodes`: what a tree file can be composed of."""

from __future__ import annotations

import json
from dataclasses import asdict
from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from uav_bt.tree.describe import NodeInfo, PortInfo

__all__ = ["nodes"]


@click.command()
@click.argument("names", metavar="[NODE]...", nargs=-1)
@click.option(
    "--format",
    "format_",
    type=click.Choice(["text", "json", "xml"]),
    help="xml: a node model (TreeNodesModel) that graphical tree editors load.",
)
@click.option("--xml", is_flag=True, help="The same as --format xml.")
def nodes(*, names: tuple[str, ...], format_: str | None, xml: bool) -> None:
    r"""List the nodes that tree files can use.

    With each node go its attributes and the board keys it reads and writes.

    \b
    As JSON, one array of objects with
      node_id, kind  Action, Condition, Control, Decorator or SubTree
      doc            one line
      ports          objects with name, type, default (null: none), doc,
                     direction (input, output, inout), choices, required
      reads, writes  names of board keys
      builtin        true for nodes of the format itself
      origin         module and class
    """
    from uav_bt.tree import NodeRegistry  # noqa: PLC0415 - `--help` need not wait for it
    from uav_bt.tree.describe import describe, describe_all, palette_xml  # noqa: PLC0415

    if xml and format_ not in {None, "xml"}:
        raise click.UsageError(f"--xml and --format {format_} exclude each other")
    registry = NodeRegistry.installed()
    if xml or format_ == "xml":
        chosen = NodeRegistry(registry[name] for name in names) if names else registry
        click.echo(palette_xml(chosen), nl=False)
        return
    infos = [describe(registry[name]) for name in names] if names else describe_all(registry)
    if format_ == "json":
        click.echo(json.dumps([asdict(info) for info in infos], indent=2))
        return
    click.echo("\n\n".join(_described(info) for info in infos))


def _described(info: NodeInfo) -> str:
    origin = "of the format" if info.builtin else info.origin
    lines = [f"{info.node_id}  ({info.kind.lower()}, {origin})"]
    if info.doc:
        lines.append(f"    {info.doc}")
    lines += [f"    {_attribute(port)}" for port in info.ports]
    if info.reads:
        lines.append(f"    reads {', '.join(info.reads)}")
    if info.writes:
        lines.append(f"    writes {', '.join(info.writes)}")
    return "\n".join(lines)


def _attribute(port: PortInfo) -> str:
    given = f'{port.name}="{port.default}"' if port.default is not None else port.name
    kind = " or ".join(port.choices) or port.type
    direction = "" if port.direction == "input" else f", {port.direction}"
    return f"{given}  {kind}{direction}" + (f": {port.doc}" if port.doc else "")
