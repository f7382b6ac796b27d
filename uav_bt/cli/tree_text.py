"""`uav-bt tree format`."""

from __future__ import annotations

from pathlib import Path

import click

from uav_bt.cli.command import Command
from uav_bt.errors import FileError, InputError, UavBtError
from uav_bt.files import write_whole
from uav_bt.tree.editing.layout import format_source
from uav_bt.tree.loading.source import read_source
from uav_bt.tree.shipped import tree_files


@click.command("format", cls=Command)
@click.argument("trees", metavar="TREE...", nargs=-1, required=True)
@click.option("--write", is_flag=True, help="Write each file anew where its layout differs.")
@click.option("--check", is_flag=True, help="Only name what would change; exit with 1 then.")
@click.pass_context
def format_trees(ctx: click.Context, *, trees: tuple[str, ...], write: bool, check: bool) -> None:
    """Lay tree files out: one element a line, two blanks a level.

    TREE is a file, or a folder with tree files. Without an option the one file is printed. What the
    file says stays as it is, comments, order and single blank lines too; a file that is laid out
    already does not change. Exits with 2 when a file is no well-formed XML; the others are
    formatted all the same.
    """
    if write and check:
        raise click.UsageError("--write and --check exclude each other", ctx)
    paths = [path for tree in trees for path in _files(tree, write=write)]
    if len(paths) > 1 and not (write or check):
        raise click.UsageError(f"{len(paths)} files; give --write or --check", ctx)
    code = 0
    for path in paths:
        try:
            code = max(code, _format(path, write=write, check=check))
        except FileError as error:
            click.echo(f"Error: {error}", err=True)
            code = InputError.exit_code
    ctx.exit(code)


def _files(tree: str, *, write: bool) -> tuple[Path, ...]:
    """Return the named files; a shipped mission's file is not written by its name.

    Raises:
        FileError: no file was found.
    """
    if write and not Path(tree).exists():
        raise FileError(tree, "no such file or folder to write")
    return tree_files(tree)


def _format(path: Path, *, write: bool, check: bool) -> int:
    """Return the exit code for one file.

    Raises:
        FileError: it cannot be read, formatted or written.
    """
    before = read_source(path)
    after = format_source(before, path)
    if not (write or check):
        click.echo(after, nl=False)
    elif after != before:
        if write:
            write_whole(path, after)
        click.echo(f"{path}: {'formatted' if write else 'would be formatted'}")
        return 0 if write else UavBtError.exit_code
    return 0
