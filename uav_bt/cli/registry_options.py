"""Options for the nodes that tree files may use, for commands that do not fly."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import click

from uav_bt.cli.options import INPUT, Decorator, grouped
from uav_bt.tree import NodeRegistry
from uav_bt.tree.loading.findings import Findings
from uav_bt.tree.loading.models import with_palette
from uav_bt.tree.registry import LEAVES_FLAG, WHICH_LEAVES, with_leaves

_LEAVES: Final[Decorator] = click.option(
    LEAVES_FLAG, "leaves", metavar="FILE.py", type=INPUT, multiple=True, help=WHICH_LEAVES
)
_PALETTE: Final[Decorator] = click.option(
    "--palette",
    metavar="FILE",
    type=INPUT,
    help="A file with a TreeNodesModel, such as Groot2 exports or saves in its tree files, of "
    "nodes that are not installed here.",
)


def _with_leaves(leaves: tuple[Path, ...]) -> NodeRegistry:
    return with_leaves(NodeRegistry.installed(), leaves)


def registry_with(leaves: tuple[Path, ...], palette: Path | None) -> NodeRegistry:
    """Return the installed nodes, those of Python files and those of a palette.

    Raises:
        FileError: a file of leaves cannot be used.
        TreeError: the palette cannot be read or makes no sense.
    """
    registry = _with_leaves(leaves)
    if palette is None:
        return registry
    odd = Findings()
    registry = with_palette(registry, palette, odd)
    for finding in odd:
        click.echo(str(finding), err=True)
    return registry


leaves_option: Final = grouped("registry", _with_leaves, leaves=_LEAVES)
registry_options: Final = grouped("registry", registry_with, leaves=_LEAVES, palette=_PALETTE)
