"""`uav-bt render`: what a mission file looks like as a tree."""

from __future__ import annotations

from pathlib import Path

import click

from uav_bt.cli.options import output_option, palette_option, registry_with, tell_or_write

__all__ = ["render"]


@click.command()
@click.argument("tree")
@click.option(
    "--format",
    "format_",
    type=click.Choice(["ascii", "svg"]),
    default="ascii",
    show_default=True,
)
@output_option("--out", "Write the picture there; it is printed if not given.")
@palette_option()
def render(*, tree: str, format_: str, out: Path | None, palette: Path | None) -> None:
    """Draw a tree file, with its subtrees in place.

    TREE is a file, or the name of a mission that ships with uav-bt. Each node shows its name and
    what the file gives it; svg also shows the board keys that it reads and writes.
    """
    from uav_bt.tree import load_tree  # noqa: PLC0415 - `--help` need not wait for it
    from uav_bt.tree.render import render as draw  # noqa: PLC0415
    from uav_bt.tree.shipped import resolve_tree  # noqa: PLC0415

    mission = load_tree(resolve_tree(tree), registry_with(palette))
    tell_or_write(draw(mission, format_), out)
