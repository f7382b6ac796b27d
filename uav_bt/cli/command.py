"""What every command does first: it refuses outputs that cannot or must not be written."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

import click

from uav_bt.cli.interrupts import let_work_clean_up
from uav_bt.errors import FileError
from uav_bt.files import check_output, check_output_folder
from uav_bt.tree.shipped import shipped_trees

_READ_WHILE_PARSING: Final = "uav_bt.cli.read_while_parsing"
_NAMING: Final = {".xml", ".yaml", ".yml"}  # files that name further ones
# What a file may name: quoted in XML, after a colon or a dash in YAML.
_NAMED: Final = re.compile(r"""["']([^"'\n]+)["']|[:\-][ \t]+([^"'\n#]+)""")
# What commands read when they are given a folder.
_IN_FOLDERS: Final = {".mcap", ".jsonl", ".xml", ".jpg", ".jpeg", ".png", ".tif", ".tiff", ".bmp"}


class OutputFile(click.Path):
    """A file that the command writes.

    Args:
        suffix: how its name must end.
    """

    def __init__(self, suffix: str = "") -> None:
        super().__init__(dir_okay=False, path_type=Path)
        self.suffix = suffix


class OutputFolder(click.Path):
    """A folder that the command writes into; it is made where there is none."""

    def __init__(self) -> None:
        super().__init__(file_okay=False, path_type=Path)


class Command(click.Command):
    """A command that looks at its outputs first."""

    def invoke(self, ctx: click.Context) -> Any:
        """Run the command.

        Raises:
            BadParameter: an output cannot be written, or is one of the inputs.
        """
        _check_outputs(ctx)
        let_work_clean_up()
        return super().invoke(ctx)


def note_input(ctx: click.Context, path: Path) -> None:
    """Remember an input that a callback has read, and whose path the command does not see."""
    ctx.meta.setdefault(_READ_WHILE_PARSING, []).append(path)


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
        except FileError as error:
            raise click.BadParameter(str(error), ctx, param) from error
        name = param.opts[0]
        for other, taken in written.items():
            if _same(path, taken):
                raise click.UsageError(f"{other} and {name} name the same file", ctx)
        written[name] = path
        for source in _inputs(ctx) if path.exists() else ():
            if _same(path, source):
                raise click.BadParameter(
                    f"'{path}' is an input of this command and would be overwritten; "
                    "choose another name",
                    ctx,
                    param,
                )


def _check_file(ctx: click.Context, param: click.Parameter, path: Path, suffix: str) -> None:
    if path.suffix.lower() != suffix and suffix:
        raise click.BadParameter(f"the name must end in {suffix}, got '{path}'", ctx, param)
    given = ctx.get_parameter_source(str(param.name)) is not click.core.ParameterSource.DEFAULT
    check_output(path, new_folders=not given)


def _same(one: Path, other: Path) -> bool:
    if one.exists() and other.exists():
        return one.samefile(other)
    return one.resolve() == other.resolve()


def _inputs(ctx: click.Context) -> Iterator[Path]:
    """Yield every file that the command may read: those given, and those that these name."""
    found: dict[Path, None] = {}
    texts = [
        text
        for param in ctx.command.params
        if not isinstance(param.type, (OutputFile, OutputFolder))
        for text in _texts(ctx.params.get(str(param.name)))
    ]
    for text in (*texts, *map(str, ctx.meta.get(_READ_WHILE_PARSING, ()))):
        _add(_files(text, Path()), found)
        _add(_files(f"{Path(text).stem}.xml", shipped_trees()), found)
    yield from found


def _texts(value: object) -> Iterator[str]:
    """Yield a parameter's value, or the values in it."""
    if isinstance(value, (str, Path)):
        yield str(value)
    elif isinstance(value, Mapping):
        yield from (text for each in value.values() for text in _texts(each))
    elif isinstance(value, (tuple, list)):
        yield from (text for each in value for text in _texts(each))


def _add(paths: Iterable[Path], found: dict[Path, None]) -> None:
    for path in paths:
        if path in found:
            continue
        found[path] = None
        if path.suffix.lower() in _NAMING and os.access(path, os.R_OK):
            text = path.read_bytes().decode("utf-8", "replace")
            for match in _NAMED.finditer(text):
                name = match[1] or match[2]
                _add(_files(name.strip(), path.parent), found)
                _add(_files(name.strip(), Path()), found)


def _files(text: str, folder: Path) -> Iterator[Path]:
    """Yield the files that a text may mean: FILE, NAME:FILE, several with commas, a folder's."""
    for part in {text, text.partition(":")[2], *text.split(",")}:
        path = folder / part
        with suppress(OSError):  # no name that a file can have
            if part and path.is_file():
                yield path.resolve()
            elif part == text and folder == Path() and path.is_dir():
                inside = path.rglob("*")
                yield from (file for file in inside if file.suffix.lower() in _IN_FOLDERS)
