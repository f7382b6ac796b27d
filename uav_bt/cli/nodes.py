"""`uav-bt nodes`: what a tree file can be composed of."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

if TYPE_CHECKING:
    from uav_bt.tree.describe import NodeInfo, PortInfo

__all__ = ["nodes"]


@click.command()
@click.argument("names", metavar="[NODE]...", nargs=-1)
@click.option("--xml", is_flag=True, help="Write a node model that graphical tree editors load.")
def nodes(*, names: tuple[str, ...], xml: bool) -> None:
    """List the nodes that tree files can use.

    With each node go its attributes and the board keys it reads and writes.
    """
    from uav_bt.tree import NodeRegistry  # noqa: PLC0415 - `--help` need not wait for it
    from uav_bt.tree.describe import describe, describe_all, palette_xml  # noqa: PLC0415

    registry = NodeRegistry.installed()
    if xml:
        chosen = NodeRegistry(registry[name] for name in names) if names else registry
        click.echo(palette_xml(chosen), nl=False)
        return
    infos = [describe(registry[name]) for name in names] if names else describe_all(registry)
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
