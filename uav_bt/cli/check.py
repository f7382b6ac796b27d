"""`uav-bt check`: is a mission file good?"""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING

import click

from uav_bt.cli.options import palette_option, registry_with
from uav_bt.errors import FileError, InputError

if TYPE_CHECKING:
    from uav_bt.tree.loading.findings import Finding

__all__ = ["check"]


@click.command()
@click.argument("trees", metavar="TREE...", nargs=-1, required=True)
@palette_option()
@click.option(
    "--format",
    "format_",
    type=click.Choice(["text", "json"]),
    default="text",
    show_default=True,
    help="json: one object a line and file, with its findings.",
)
@click.pass_context
def check(ctx: click.Context, trees: tuple[str, ...], palette: Path | None, format_: str) -> None:
    r"""Check tree files and tell all that is wrong.

    TREE is a file, a folder with tree files, or the name of a mission that ships with uav-bt. Exits
    with 2 when there is something to report.

    \b
    As JSON, each line is an object with
      file      the file's path
      ok        true or false
      findings  objects with path, line, column, node and message; path is
                another one than the file's in what it includes, line and
                column count from 1 and are null for the file as a whole
    """
    from uav_bt.tree.policy_check import check_file, findings_of  # noqa: PLC0415 - `--help` need not wait
    from uav_bt.tree.shipped import tree_files  # noqa: PLC0415

    registry = registry_with(palette)
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
