"""`uav-bt lab schema`: the JSON schema of lab files, for editors."""

from __future__ import annotations

from pathlib import Path

import click

from uav_bt.cli.command import Command
from uav_bt.cli.options import output_option
from uav_bt.files import writing
from uav_bt.lab.schema import lab_schema


@click.command(cls=Command)
@output_option("--out", "Write the schema there; it is printed if not given.", suffix=".json")
def schema(*, out: Path | None) -> None:
    """Write a JSON schema of lab files.

    YAML editors complete, explain and check lab files with it. They find it by this line at the
    head of a lab file:

    \b
      # yaml-language-server: $schema=lab.schema.json
    """  # noqa: D301  (click needs the backspace)
    text = lab_schema()
    if out is None:
        click.echo(text, nl=False)
        return
    with writing(out):
        out.write_text(text, encoding="utf-8")
    click.echo(f"written: {out}")
