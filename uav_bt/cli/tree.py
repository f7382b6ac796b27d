"""`uav-bt check`, `new` and `tree ...`: the tools around tree files.

They import neither simulator nor networks, so that they answer at once.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import click

from uav_bt.cli.options import INPUT, format_option, output_option
from uav_bt.errors import FileError, InputError
from uav_bt.files import writing
from uav_bt.tree import NodeRegistry, load_tree
from uav_bt.tree.describe import NodeInfo, PortInfo, describe, describe_all, palette_xml
from uav_bt.tree.loading.findings import Finding
from uav_bt.tree.loading.palette import read_palette, with_palette
from uav_bt.tree.loading.schema import schema_xml
from uav_bt.tree.policy_check import check_file, findings_of
from uav_bt.tree.render import render as draw
from uav_bt.tree.shipped import resolve_tree, tree_files
from uav_bt.tree.starter import STARTERS, write_starter

__all__ = ["check", "new", "nodes", "palette_option", "render", "schema"]


def _with_palette(ctx: click.Context, param: click.Parameter, value: Path | None) -> NodeRegistry:
    """Return the installed nodes and those of a palette.

    Raises:
        TreeError: the palette cannot be read or makes no sense.
    """
    del ctx, param
    installed = NodeRegistry.installed()
    return installed if value is None else with_palette(installed, read_palette(value))


palette_option = click.option(
    "--palette",
    "registry",
    metavar="FILE",
    type=INPUT,
    callback=_with_palette,
    help="A file with a TreeNodesModel, such as Groot2 exports or saves in its tree files, of "
    "nodes that are not installed here.",
)


@click.command()
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


@click.command()
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


@click.command()
@click.argument("names", metavar="[NODE]...", nargs=-1)
@format_option(
    "text",
    "json",
    "xml",
    help_="xml: a node model (TreeNodesModel) that graphical tree editors load.",
)
def nodes(*, names: tuple[str, ...], format_: str) -> None:
    """List the nodes that tree files can use.

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
    """  # noqa: D301  (click needs the backspace)
    registry = NodeRegistry.installed()
    if format_ == "xml":
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


@click.command()
@click.argument("tree")
@format_option(
    "ascii",
    "svg",
    help_="The form of the drawing.",
)
@output_option("--out", "Write the drawing there; it is printed if not given.")
@palette_option
def render(*, tree: str, format_: str, out: Path | None, registry: NodeRegistry) -> None:
    """Draw a tree file, with its subtrees in place.

    TREE is a file, or the name of a mission that ships with uav-bt. Each node shows its name and
    what the file gives it; svg also shows the board keys that it reads and writes.
    """
    _print_or_write(draw(load_tree(resolve_tree(tree), registry), format_), out)


@click.command()
@output_option("--out", "Write the schema there; it is printed if not given.")
@palette_option
def schema(*, out: Path | None, registry: NodeRegistry) -> None:
    """Write an XML Schema of tree files with all installed nodes.

    XML editors complete, explain and check tree files with it. They find it by their settings, or
    by this line at the head of a tree file: <?xml-model href="uav-bt.xsd"?>
    """
    _print_or_write(schema_xml(registry), out)


def _print_or_write(text: str, out: Path | None) -> None:
    if out is None:
        click.echo(text, nl=False)
        return
    with writing(out):
        out.write_text(text, encoding="utf-8")
    click.echo(f"written: {out}")
