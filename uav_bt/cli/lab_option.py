"""The option `--lab` of commands that do not fly."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import click

from uav_bt.cli.options import Decorator
from uav_bt.lab.lab import Lab
from uav_bt.tree import NodeRegistry
from uav_bt.tree.loading.lookup import TreeFolders
from uav_bt.tree.loading.parameters import Parameters

lab_option: Final[Decorator] = click.option(
    "--lab",
    metavar="NAME",
    help="Check the mission in this lab, too: a shipped lab, a folder of labs/, or a path.",
)


def refuse_in_lab(
    lab: Lab,
    registry: NodeRegistry,
    tree: Path | str,
    *,
    tree_id: str | None,
    tree_folders: TreeFolders,
    parameters: Sequence[Parameters | None],
) -> None:
    """Refuse a mission that does not fit a lab.

    Args:
        lab: The lab.
        registry: Nodes that the tree may use.
        tree: Tree file, or its text.
        tree_id: Which of the file's trees.
        tree_folders: Where else trees are.
        parameters: Sets of values from outside, each of which is checked; None: no values.

    Raises:
        InputError: A setting of the lab or the mission was refused.
    """
    # Late: `uav-bt check` answers at once, and these import the parts of a flight.
    from uav_bt.app.flight import check  # noqa: PLC0415

    for each in parameters:
        given = each or Parameters()
        check(
            tree,
            registry,
            lab=lab,
            tree_id=tree_id,
            tree_folders=tree_folders,
            ports=given.ports,
            variables=given.variables,
        )
