"""`uav-bt schema`: what an XML editor wants to know about tree files."""

from __future__ import annotations

from pathlib import Path

import click

from uav_bt.cli.options import output_option, palette_option, registry_with, tell_or_write

__all__ = ["schema"]


@click.command()
@output_option("--out", "Write the schema there; it is printed if not given.")
@palette_option()
def schema(*, out: Path | None, palette: Path | None) -> None:
    """Write an XML Schema of tree files with all installed nodes.

    XML editors complete, explain and check tree files with it. They find it by their settings, or
    by this line at the head of a tree file: <?xml-model href="uav-bt.xsd"?>
    """
    from uav_bt.tree.loading.schema import schema_xml  # noqa: PLC0415 - `--help` need not wait for it

    tell_or_write(schema_xml(registry_with(palette)), out)
