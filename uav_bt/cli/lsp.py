"""`uav-bt lsp`: the language server of tree files, for editors."""

from __future__ import annotations

from pathlib import Path

import click

from uav_bt.cli.command import Command
from uav_bt.cli.registry_options import leaves_option, palette_option
from uav_bt.lsp.server import serve
from uav_bt.tree import NodeRegistry


@click.command(cls=Command)
@leaves_option
@palette_option
def lsp(*, registry: NodeRegistry, palette: Path | None) -> None:
    """Check and complete tree files in editors.

    An editor starts this and speaks the Language Server Protocol with it over standard input and
    output: findings while one types, completion, hover, definitions, renaming, formatting and quick
    fixes. SubTrees are looked up in all files of the editor's folder, as `uav-bt check FOLDER`
    does. A palette that is refused is shown as a finding. docs/editors.md has the settings of VS
    Code, Neovim and Emacs.
    """
    serve(registry, palette)
