"""Types of values on the command line, and which of them a Python type has."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin

import click
from annotated_types import Ge, Gt, Le

from uav_bt.option import Option


class WholeNumber(click.IntRange):
    """A whole number in a range."""

    name = "integer"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the number; fails when it is not a number, or out of range."""
        try:
            return super().convert(value, param, ctx)
        except click.BadParameter:
            self.fail(f"expected a whole number{_range(self)}, got '{value}'", param, ctx)


class Number(click.FloatRange):
    """A finite number in a range."""

    name = "number"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the number; fails when it is not a number, or out of range."""
        try:
            number = super().convert(value, param, ctx)
        except click.BadParameter:
            number = math.nan
        if not math.isfinite(number):
            self.fail(f"expected a number{_range(self)}, got '{value}'", param, ctx)
        return number


def _range(kind: click.IntRange | click.FloatRange) -> str:
    """Return where a number must lie, in words that begin with a space."""
    words = ""
    if kind.min is not None:
        words += f" {'above' if kind.min_open else 'from'} {kind.min:g}"
    if kind.max is not None:
        words += f" to {kind.max:g}"
    elif kind.min is not None and not kind.min_open:
        words += " on"
    return words


class OutputFile(click.Path):
    """A file that the command writes; `suffix` is how its name must end."""

    def __init__(self, suffix: str = "") -> None:
        super().__init__(dir_okay=False, path_type=Path)
        self.suffix = suffix


class OutputFolder(click.Path):
    """A folder that the command writes into; it is made if it does not exist."""

    def __init__(self) -> None:
        super().__init__(file_okay=False, path_type=Path)


def first_type(kind: Any) -> Any:
    """Return the first type of a union, as None is no text and most values can be texts."""
    return get_args(kind)[0] if get_origin(kind) in {Union, UnionType} else kind


def is_repeated(kind: Any) -> bool:
    """Return whether values of a type are given by several words."""
    origin = get_origin(kind)
    return origin in {Sequence, Mapping} or (origin is tuple and get_args(kind)[-1] is Ellipsis)


def type_of(kind: Any, notes: Sequence[Any], about: Option) -> click.ParamType[Any]:
    """Return click's type for a value, from the other notes of its `Annotated` type."""
    if about.path:
        return {
            "read": click.Path(dir_okay=False, path_type=Path),
            "written": OutputFile(about.suffix),
            "folder": OutputFolder(),
        }[about.path]
    if is_repeated(kind):
        kind = first_type(get_args(kind)[0])
    if kind is Path:
        return click.Path(path_type=Path)
    if get_origin(kind) is Literal:
        return click.Choice(get_args(kind))
    if about.read is not None or kind not in {int, float}:
        return click.STRING
    bounds = dict(pair for note in notes for pair in _bounds(note))
    return (WholeNumber if kind is int else Number)(**bounds)


def _bounds(note: object) -> Iterator[tuple[str, Any]]:
    if isinstance(note, Ge):
        yield "min", note.ge
    elif isinstance(note, Gt):
        yield from (("min", note.gt), ("min_open", True))
    elif isinstance(note, Le):
        yield "max", note.le
