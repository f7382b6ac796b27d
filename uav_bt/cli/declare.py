"""Commands made of functions: parameters before the star are arguments, the others are options.

@command()
def count(lab: str, *, most: Annotated[int, Ge(1), Option("Most images.")] = 300) -> None:
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Annotated, Any, Final, get_args, get_origin, get_type_hints

import click

from uav_bt.cli.command import Command
from uav_bt.cli.values import first_type, is_repeated, type_of
from uav_bt.errors import InputError
from uav_bt.option import Option, text_below

_NOTHING: Final = inspect.Parameter.empty
_PLACEHOLDERS: Final = {"read": "FILE", "written": "FILE", "folder": "DIR"}


def command(*, sections: Sequence[str] = ()) -> Callable[[Callable[..., None]], Command]:
    """Return a decorator that makes a command of a function.

    `sections` are headings of the help, under which the options of these groups stand.
    """

    def decorate(function: Callable[..., None]) -> Command:
        call = _Call(function)
        return Command(
            name=function.__name__.replace("_", "-"),
            params=call.params,
            callback=lambda **values: call(values),
            help=inspect.getdoc(function),
            sections={
                heading: [name for name, group in call.groups.items() if group == heading]
                for heading in sections
            },
        )

    return decorate


class _Call:
    """A function whose parameters come from the command line; `about`: which of them."""

    def __init__(self, function: Callable[..., Any], about: Option = Option()) -> None:  # noqa: B008
        self.params: list[click.Parameter] = []
        self.groups: dict[str, str] = {}  # heading of the help by option
        self._function = function
        self._own: list[str] = []
        self._parts: dict[str, _Call] = {}
        self._context = ""  # name of the parameter that is the context
        hints = get_type_hints(function, include_extras=True)
        for each in inspect.signature(function).parameters.values():
            if not about.only or each.name in about.only:
                self._add(each, hints[each.name], about.defaults.get(each.name, each.default))

    def __call__(self, values: dict[str, Any]) -> Any:
        """Call the function with values by parameter, and take them out."""
        given = {name: values.pop(name) for name in self._own}
        given |= {name: part(values) for name, part in self._parts.items()}
        if self._context:
            given[self._context] = click.get_current_context()
        return self._function(**given)

    def _add(self, each: inspect.Parameter, hint: Any, default: Any) -> None:
        kind, *notes = get_args(hint) if get_origin(hint) is Annotated else (hint,)
        about = next((note for note in notes if isinstance(note, Option)), Option())
        about = replace(about, help=about.help or text_below(self._function, each.name))
        if kind is click.Context:
            self._context = each.name
        elif about.parts is not None:
            self._parts[each.name] = part = _Call(about.parts, about)
            self.params += part.params
            self.groups |= part.groups
        else:
            self._own.append(each.name)
            self.groups[each.name] = about.group
            made = _option if each.kind is each.KEYWORD_ONLY else _argument
            self.params.append(made(each.name, first_type(kind), notes, about, default))


def _argument(
    name: str, kind: Any, notes: Sequence[Any], about: Option, default: Any
) -> click.Argument:
    more: dict[str, Any] = (
        {"nargs": -1, "required": default is _NOTHING} if is_repeated(kind) else {}
    )
    return click.Argument([name], metavar=about.metavar, type=type_of(kind, notes, about), **more)


def _option(
    name: str, kind: Any, notes: Sequence[Any], about: Option, default: Any
) -> click.Option:
    flag = about.flag_of(name)
    if kind is bool:
        flag += "" if default is False else f"/--no-{flag[2:]}"
        return click.Option([flag, name], default=default, is_flag=True, help=about.help)
    repeated = is_repeated(kind)
    more: dict[str, Any] = {"required": default is _NOTHING}
    if not (default is _NOTHING or repeated):
        more["default"] = default if about.write is None else about.write(default)
    if about.alone is not None:
        more |= {"is_flag": False, "flag_value": about.alone}
    if about.read is not None:
        more["callback"] = partial(_read, about.read)
    return click.Option(
        [flag, name],
        metavar=about.metavar or _PLACEHOLDERS.get(about.path),
        type=type_of(kind, notes, about),
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
