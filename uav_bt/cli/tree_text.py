"""`uav-bt tree format`, `migrate` and `diff`: tree files as text."""

from __future__ import annotations

from pathlib import Path
from typing import Final

import click

from uav_bt.cli.command import Command
from uav_bt.cli.options import INPUT, output_option
from uav_bt.errors import FileError, InputError, UavBtError
from uav_bt.files import write_whole, writing
from uav_bt.tree.editing.difference import Change, Difference, differences
from uav_bt.tree.editing.layout import format_source
from uav_bt.tree.editing.migration import migrate_source
from uav_bt.tree.loading.source import parse_source, read_source
from uav_bt.tree.shipped import resolve_tree, tree_files


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
    """Return the files that are meant; a shipped mission's is not to be written by its name.

    Raises:
        FileError: there are none.
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


@click.command(cls=Command)
@click.argument("file", type=INPUT)
@output_option(
    "--out", "Write the new file there; it is printed if not given. A file that exists stays."
)
@click.pass_context
def migrate(ctx: click.Context, *, file: Path, out: Path | None) -> None:
    """Make a tree file of BehaviorTree.CPP 3 one of version 4.

    Names and attributes are changed as the engine's migration guide has it; comments and layout
    stay. What has no equal in version 4, or ticks otherwise there, is listed with its line in FILE,
    and the exit code is 1 then. FILE itself is never changed.
    """
    migrated = migrate_source(read_source(file), file)
    if out is None:
        click.echo(migrated.data, nl=False)
    else:
        _write_new(out, migrated.data)
        click.echo(f"written: {out} (what is wrong with it: uav-bt check {out})")
    for finding in migrated.findings:
        click.echo(str(finding), err=True)
    ctx.exit(UavBtError.exit_code if migrated.findings else 0)


def _write_new(path: Path, data: bytes) -> None:
    with writing(path):
        try:
            with path.open("xb") as file:
                file.write(data)
        except FileExistsError as error:
            message = "there is such a file, and it is not overwritten; choose another name"
            raise FileError(path, message) from error


_COLOURS: Final = {
    Change.ADDED: "green",
    Change.REMOVED: "red",
    Change.MOVED: "cyan",
    Change.CHANGED: "yellow",
}


@click.command(cls=Command)
@click.argument("before")
@click.argument("after")
@click.pass_context
def diff(ctx: click.Context, *, before: str, after: str) -> None:
    """Say what two tree files differ in, node by node.

    BEFORE and AFTER are files, or names of missions that ship with uav-bt. Layout, comments, the
    order of trees and what editors write for themselves (_uid and the like) are no difference;
    included files are not read. Exits with 0 when the files are the same, 1 when they differ, 2
    when one cannot be read.
    """
    paths = [resolve_tree(before), resolve_tree(after)]
    roots = [parse_source(read_source(path), path) for path in paths]
    found = differences(*roots)
    if found:
        click.echo(f"--- {paths[0]}\n+++ {paths[1]}")
    for difference in found:
        click.secho(_line(difference), fg=_COLOURS[difference.change])
    ctx.exit(UavBtError.exit_code if found else 0)


def _line(difference: Difference) -> str:
    lines = [
        str(place.line) for place in (difference.before, difference.after) if place is not None
    ]
    line = f"{difference.change.value:8} {difference.path} (line {' -> '.join(lines)})"
    return ": ".join(filter(None, (line, ", ".join(difference.details))))
