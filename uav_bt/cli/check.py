"""`uav-bt check` and `new`: they import little, so that they answer at once."""

from __future__ import annotations

import json
from pathlib import Path

import click

from uav_bt.cli.command import Command, note_input
from uav_bt.cli.options import INPUT, format_option
from uav_bt.errors import FileError, InputError
from uav_bt.tree import NodeRegistry
from uav_bt.tree.loading.findings import Finding
from uav_bt.tree.loading.loader import check_file, findings_of
from uav_bt.tree.loading.palette import read_palette, with_palette
from uav_bt.tree.shipped import STARTERS, tree_files, write_starter


def _with_palette(ctx: click.Context, param: click.Parameter, value: Path | None) -> NodeRegistry:
    """Return the installed nodes and those of a palette.

    Raises:
        TreeError: the palette cannot be read or makes no sense.
    """
    del param
    installed = NodeRegistry.installed()
    if value is None:
        return installed
    note_input(ctx, value)
    return with_palette(installed, read_palette(value))


palette_option = click.option(
    "--palette",
    "registry",
    metavar="FILE",
    type=INPUT,
    callback=_with_palette,
    help="A file with a TreeNodesModel, such as Groot2 exports or saves in its tree files, of "
    "nodes that are not installed here.",
)


@click.command(cls=Command)
@click.argument("trees", metavar="TREE...", nargs=-1, required=True)
@palette_option
@format_option("text", "json", help_="json: one object a line and file, with its findings.")
@click.pass_context
def check(
    ctx: click.Context, *, trees: tuple[str, ...], registry: NodeRegistry, format_: str
) -> None:
    """Check tree files and report all that is wrong.

    TREE is a file, a folder with tree files, or the name of a mission that ships with uav-bt. Exits
    with 2 when there is something to report.

    \b
    As JSON, each line is an object with
      file      the file's path
      ok        true or false
      findings  objects with path, line, column, node and message; path is
                another one than the file's in what it includes, line and
                column count from 1 and are null for the file as a whole
    """  # noqa: D301  (click needs the backspace)
    refused = 0
    for tree in trees:
        try:
            reports = [(path, check_file(path, registry)) for path in tree_files(tree)]
        except FileError as error:
            reports = [(Path(tree), findings_of(error, Path(tree)))]
        for path, findings in reports:
            refused += bool(findings)
            if format_ == "json":
                click.echo(_as_json(path, findings))
                continue
            for finding in findings:
                click.echo(str(finding), err=True)
            if not findings:
                click.echo(f"{path}: good")
    if refused:
        ctx.exit(InputError.exit_code)


def _as_json(path: Path, findings: tuple[Finding, ...]) -> str:
    return json.dumps(
        {
            "file": str(path),
            "ok": not findings,
            "findings": [
                {
                    "path": finding.path,
                    # A position of 0 means the whole file.
                    "line": finding.position.line or None,
                    "column": finding.position.column or None,
                    "node": finding.node,
                    "message": finding.message,
                }
                for finding in findings
            ],
        }
    )


@click.command(cls=Command)
@click.argument("file", type=click.Path(path_type=Path))
@click.option(
    "--from",
    "start",
    type=click.Choice(list(STARTERS)),
    default="hover",
    show_default=True,
    help="hover: up, look round, down; land: find the helipad, land; explore: the whole mission.",
)
def new(*, file: Path, start: str) -> None:
    """Write a commented mission file to begin with.

    FILE is the new file, such as my_mission.xml. A file that exists is not overwritten.
    """
    write_starter(file, start)
    click.echo(f"written: {file} (fly it: uav-bt fly {file})")
