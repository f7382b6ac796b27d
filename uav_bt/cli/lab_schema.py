"""`uav-bt lab new` and `lab schema`: a lab file to begin with, and its JSON schema for editors."""

from __future__ import annotations

from pathlib import Path

import click

from uav_bt.cli.command import Command
from uav_bt.cli.options import output_option
from uav_bt.files import writing
from uav_bt.lab.lab_file import lab_schema
from uav_bt.lab.shipped import write_lab


@click.command(cls=Command)
@click.argument("name")
@click.option(
    "--in",
    "folder",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("labs"),
    help="Folder of your labs; it is made if it is absent.",
)
def new(*, name: str, folder: Path) -> None:
    """Write a commented lab file for a place of yours.

    NAME is the place, such as hall: its folder is labs/hall, and --lab hall finds it. A folder that
    exists is not changed.
    """
    path = write_lab(name, folder)
    click.echo(f"written: {path} (edit it, then try: uav-bt check land_only --lab {path.parent})")


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
