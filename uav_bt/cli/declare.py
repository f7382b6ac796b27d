"""Commands made of functions: parameters before the star are arguments, the others are options.

@command()
def count(lab: str, *, most: Annotated[int, Ge(1)] = 300) -> None:

What an option is for stands in the docstring, in a last section `Options:`, or in its `Option`.
"""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, Final, Literal, Union, get_args, get_origin, get_type_hints

import click
from annotated_types import Ge, Gt, Le

from uav_bt.cli.interrupts import let_work_clean_up
from uav_bt.errors import InputError, MissionError
from uav_bt.files import check_output, check_output_folder
from uav_bt.inputs import refuse_inputs, same_file
from uav_bt.option import Option, text_below
from uav_bt.tree.loading.lookup import shipped_trees

_NOTHING: Final = inspect.Parameter.empty
_PLACEHOLDERS: Final = {"read": "FILE", "written": "FILE", "folder": "DIR"}
_OUTPUTS: Final = {"written", "folder"}


class WholeNumber(click.IntRange):
    """A whole number in a range."""

    name = "integer"


class Number(click.FloatRange):
    """A finite number in a range."""

    name = "number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the number; fails when it is not a finite one, or out of range."""
        number = super().convert(value, param, ctx)
        if not math.isfinite(number):
            self.fail(f"'{value}' is not a finite number", param, ctx)
        return number


class Command(click.Command):
    """A command made of a function; it checks its outputs first.

    `about` has the declarations of its arguments and options by their names; `sections` are
    headings of the help, under which the options of these groups stand.
    """

    def __init__(
        self, function: Callable[..., bool | None], name: str, sections: Sequence[str]
    ) -> None:
        call = _Call(function)
        super().__init__(
            name or function.__name__.replace("_", "-"),
            params=call.params,
            callback=lambda **values: call(values),
            help=_texts(function)[0],
        )
        self.about = call.about
        self._sections = sections

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the options of each section, then the others."""
        rows: dict[str, list[tuple[str, str]]] = {head: [] for head in (*self._sections, "Options")}
        for param in self.get_params(ctx):
            if isinstance(param, click.Option) and (row := param.get_help_record(ctx)):
                group = self.about.get(str(param.name), Option()).group
                rows[group if group in rows else "Options"].append(row)
        for heading, options in rows.items():
            with formatter.section(heading):
                formatter.write_dl(options)

    def invoke(self, ctx: click.Context) -> None:
        """Run the command; refuses an output that cannot be written, or is one of the inputs."""
        inputs = [
            value for name, value in ctx.params.items() if self.about[name].path not in _OUTPUTS
        ]
        written: dict[str, Path] = {}
        for param in self.params:
            about, path = self.about[str(param.name)], ctx.params[str(param.name)]
            if about.path not in _OUTPUTS or path is None:
                continue
            source = ctx.get_parameter_source(str(param.name))
            is_default = source is click.core.ParameterSource.DEFAULT
            try:
                _check_output(path, about, inputs, new_folders=is_default)
            except InputError as error:
                raise click.BadParameter(str(error), ctx, param) from error
            for other, taken in written.items():
                if same_file(path, taken):
                    raise click.UsageError(f"{other} and {param.opts[0]} name the same file", ctx)
            if about.path == "written":
                written[param.opts[0]] = path
        let_work_clean_up()
        if super().invoke(ctx) is False:
            ctx.exit(MissionError.exit_code)


def _check_output(
    path: Path, about: Option, inputs: Sequence[object], *, new_folders: bool
) -> None:
    if about.path == "folder":
        check_output_folder(path)
        return
    if about.suffix and path.suffix.lower() != about.suffix:
        raise InputError(f"the name must end in {about.suffix}, got '{path}'")
    check_output(path, new_folders=new_folders)
    refuse_inputs(path, inputs, shipped_trees())


def command(
    name: str = "", *, sections: Sequence[str] = ()
) -> Callable[[Callable[..., bool | None]], Command]:
    """Return a decorator that makes a command of a function, and of its name if none is given.

    A function that returns False ends the command with exit code 1.
    """
    return lambda function: Command(function, name, sections)


class _Call:
    """A function whose parameters come from the command line; `about`: which of them."""

    def __init__(self, function: Callable[..., Any], about: Option = Option()) -> None:  # noqa: B008
        self.params: list[click.Parameter] = []
        self.about: dict[str, Option] = {}
        self._function = function
        self._own: list[str] = []
        self._parts: dict[str, _Call] = {}
        hints = get_type_hints(function, include_extras=True)
        for each in inspect.signature(function).parameters.values():
            if not about.only or each.name in about.only:
                self._add(each, hints[each.name], about.defaults.get(each.name, each.default))

    def __call__(self, values: dict[str, Any]) -> Any:
        """Call the function with values by parameter, and take them out."""
        given = {name: values.pop(name) for name in self._own}
        return self._function(**given, **{name: part(values) for name, part in self._parts.items()})

    def _add(self, each: inspect.Parameter, hint: Any, default: Any) -> None:
        kind, *notes = get_args(hint) if get_origin(hint) is Annotated else (hint,)
        about = next((note for note in notes if isinstance(note, Option)), Option())
        if about.parts is not None:
            self._parts[each.name] = part = _Call(about.parts, about)
            self.params += part.params
            self.about |= part.about
            return
        text = _texts(self._function)[1].get(each.name)
        text = text or about.help or text_below(self._function, each.name)
        self._own.append(each.name)
        self.about[each.name] = about = replace(about, help=text)
        made = _option if each.kind is each.KEYWORD_ONLY else _argument
        self.params.append(made(each.name, _first_type(kind), notes, about, default))


def _texts(function: Callable[..., Any]) -> tuple[str, dict[str, str]]:
    """Return the help of a command, and that of its options by their names."""
    text, _, options = inspect.cleandoc(function.__doc__ or "").partition("\n\nOptions:\n")
    found = re.findall(r"^ {4}(\w+): (.+(?:\n {8}.+)*)", options, re.MULTILINE)
    return text, {name: " ".join(words.split()) for name, words in found}


def _argument(
    name: str, kind: Any, notes: Sequence[Any], about: Option, default: Any
) -> click.Argument:
    return click.Argument(
        [name],
        metavar=about.metavar,
        type=_type_of(kind, notes, about),
        nargs=-1 if _is_repeated(kind) else 1,
        required=default is _NOTHING,
    )


def _option(
    name: str, kind: Any, notes: Sequence[Any], about: Option, default: Any
) -> click.Option:
    flag = about.flag_of(name)
    if kind is bool:
        flag += "" if default is False else f"/--no-{flag[2:]}"
        return click.Option([flag, name], default=default, is_flag=True, help=about.help)
    repeated = _is_repeated(kind)
    more: dict[str, Any] = {"required": default is _NOTHING}
    if default is not _NOTHING and (not repeated or isinstance(default, tuple)):
        more["default"] = default if about.write is None else about.write(default)
    if about.alone is not None:
        more |= {"is_flag": False, "flag_value": about.alone}
    if about.read is not None:
        more["callback"] = partial(_read, about.read)
    return click.Option(
        [flag, name],
        metavar=about.metavar or _PLACEHOLDERS.get(about.path),
        type=_type_of(kind, notes, about),
        multiple=repeated,
        help=about.help,
        **more,
    )


def _read(
    read: Callable[[Any], Any], ctx: click.Context, param: click.Parameter, value: Any
) -> Any:
    try:
        return None if value is None else read(value)
    except InputError as error:
        raise click.BadParameter(str(error), ctx, param) from error


def _first_type(kind: Any) -> Any:
    """Return the first type of a union, as None is no text and most values can be texts."""
    return get_args(kind)[0] if get_origin(kind) in {Union, UnionType} else kind


def _is_repeated(kind: Any) -> bool:
    """Return whether values of a type are given by several words."""
    origin = get_origin(kind)
    return origin in {Sequence, Mapping} or (origin is tuple and get_args(kind)[-1] is Ellipsis)


def _type_of(kind: Any, notes: Sequence[Any], about: Option) -> click.ParamType[Any]:
    """Return click's type for a value, from the other notes of its `Annotated` type."""
    if _is_repeated(kind):
        kind = _first_type(get_args(kind)[0])
    if about.path or kind is Path:
        return click.Path(
            dir_okay=about.path in {"", "folder"},
            file_okay=about.path != "folder",
            path_type=Path,
        )
    if get_origin(kind) is Literal:
        return click.Choice(get_args(kind))
    if about.read is not None or kind not in {int, float}:
        return click.STRING
    bounds: dict[str, Any] = {}
    for note in notes:
        if isinstance(note, Ge):
            bounds["min"] = note.ge
        elif isinstance(note, Gt):
            bounds |= {"min": note.gt, "min_open": True}
        elif isinstance(note, Le):
            bounds["max"] = note.le
    return (WholeNumber if kind is int else Number)(**bounds)
