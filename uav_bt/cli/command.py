"""Base of all commands: it refuses outputs that cannot or must not be written."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click

from uav_bt.cli.interrupts import let_work_clean_up
from uav_bt.cli.values import OutputFile, OutputFolder
from uav_bt.errors import FileError
from uav_bt.files import check_output, check_output_folder
from uav_bt.inputs import refuse_inputs, same_file
from uav_bt.tree.loading.lookup import shipped_trees


class Command(click.Command):
    """A command that checks its outputs first.

    `sections` has names of options by the heading of the help under which they stand.
    """

    def __init__(self, sections: Mapping[str, Sequence[str]], **attributes: Any) -> None:
        super().__init__(**attributes)
        self._sections = sections

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options of each section, then the others."""
        rows = {
            str(param.name): row
            for param in self.get_params(ctx)
            if isinstance(param, click.Option) and (row := param.get_help_record(ctx))
        }
        for heading, names in self._sections.items():
            with formatter.section(heading):
                formatter.write_dl([rows.pop(name) for name in names])
        with formatter.section("Options"):
            formatter.write_dl(list(rows.values()))

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command; refuses an output that cannot be written, or is one of the inputs."""
        _check_outputs(ctx)
        let_work_clean_up()
        return super().invoke(ctx)


def _check_outputs(ctx: click.Context) -> None:
    written: dict[str, Path] = {}
    for param in ctx.command.params:
        path = ctx.params.get(str(param.name))
        if path is None:
            continue
        try:
            if isinstance(param.type, OutputFile):
                _check_file(ctx, param, path, param.type.suffix)
            elif isinstance(param.type, OutputFolder):
                check_output_folder(path)
                continue
            else:
                continue
            refuse_inputs(path, _inputs(ctx), shipped_trees())
        except FileError as error:
            raise click.BadParameter(str(error), ctx, param) from error
        name = param.opts[0]
        for other, taken in written.items():
            if same_file(path, taken):
                raise click.UsageError(f"{other} and {name} name the same file", ctx)
        written[name] = path


def _check_file(ctx: click.Context, param: click.Parameter, path: Path, suffix: str) -> None:
    if path.suffix.lower() != suffix and suffix:
        raise click.BadParameter(f"the name must end in {suffix}, got '{path}'", ctx, param)
    given = ctx.get_parameter_source(str(param.name)) is not click.core.ParameterSource.DEFAULT
    check_output(path, new_folders=not given)


def _inputs(ctx: click.Context) -> list[object]:
    """Return everything that the command was given and does not write."""
    return [
        ctx.params.get(str(param.name))
        for param in ctx.command.params
        if not isinstance(param.type, (OutputFile, OutputFolder))
    ]
