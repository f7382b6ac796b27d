"""`uav-bt lsp`: the language server of tree files, for editors."""

from __future__ import annotations

import click

from uav_bt.cli.command import Command
from uav_bt.cli.registry_options import registry_options
from uav_bt.lsp.server import serve
from uav_bt.tree import NodeRegistry


@click.command(cls=Command)
@registry_options
def lsp(*, registry: NodeRegistry) -> None:
    """Check and complete tree files in editors.

    An editor starts this and speaks the Language Server Protocol with it over standard input and
    output: findings while one types, completion and hover. SubTrees are looked up in all files of
    the editor's folder as they were saved, as `uav-bt check FOLDER` does. docs/editors.md has the
    settings of VS Code, Neovim and Emacs.
    """
    serve(registry)
