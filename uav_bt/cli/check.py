"""`uav-bt check`: is a mission file good?"""

from __future__ import annotations

import click

from uav_bt.errors import FileError, InputError

__all__ = ["check"]


@click.command()
@click.argument("trees", metavar="TREE...", nargs=-1, required=True)
@click.pass_context
def check(ctx: click.Context, trees: tuple[str, ...]) -> None:
    """Check tree files and tell all that is wrong.

    TREE is a file, or the name of a mission that ships with uav-bt. Exits with 2 when there is
    something to report.
    """
    from uav_bt.app import resolve_tree  # noqa: PLC0415 - `--help` need not wait for it
    from uav_bt.checking import tree_findings  # noqa: PLC0415
    from uav_bt.tree import NodeRegistry  # noqa: PLC0415

    registry = NodeRegistry.installed()
    refused = 0
    for tree in trees:
        try:
            path = resolve_tree(tree)
            findings = tree_findings(path, registry)
        except FileError as error:
            findings = (str(error),)
        for finding in findings:
            click.echo(finding, err=True)
        refused += bool(findings)
        if not findings:
            click.echo(f"{path}: good")
    if refused:
        ctx.exit(InputError.exit_code)
