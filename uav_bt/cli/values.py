"""Types of values on the command line: numbers in a range, files and folders that are written."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import click


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
