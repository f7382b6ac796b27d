"""`uav-bt new`: a mission file to begin with."""

from __future__ import annotations

from pathlib import Path

import click

__all__ = ["new"]


@click.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--from",
    "start",
    type=click.Choice(["hover", "land", "explore"]),
    default="hover",
    show_default=True,
    help="hover: up, look round, down; land: find the helipad, land; explore: the whole mission.",
)
def new(*, file: Path, start: str) -> None:
    """Write a commented mission file to begin with.

    FILE is the new file, such as my_mission.xml. A file that exists is not overwritten.
    """
    from uav_bt.tree.starter import write_starter  # noqa: PLC0415 - `--help` need not wait for it

    write_starter(file, start)
    click.echo(f"written: {file} (fly it: uav-bt fly {file})")
