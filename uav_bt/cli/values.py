"""Values on the command line: numbers, sizes and pairs; a wrong one is refused with a remedy."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from uav_bt.tree.nodes.base import entry_value


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
        words += f" {'below' if kind.max_open else 'to'} {kind.max:g}"
    elif kind.min is not None and not kind.min_open:
        words += " on"
    return words


def image_size(ctx: click.Context, param: click.Parameter, value: str) -> tuple[int, int]:
    """Return width and height in pixels of a WIDTHxHEIGHT.

    Raises:
        BadParameter: It is not a size.
    """
    match = re.fullmatch(r"([1-9]\d{0,4})[xX]([1-9]\d{0,4})", value)
    if match is None:
        raise click.BadParameter(f"expected a size such as 640x360, got '{value}'", ctx, param)
    return int(match[1]), int(match[2])


def node_policies(
    ctx: click.Context, param: click.Parameter, values: tuple[str, ...]
) -> dict[str, str]:
    """Return the names of policies by node of several NODE=NAME.

    Raises:
        BadParameter: one is malformed, or two are about the same node.
    """
    # The last sign counts: a path of a tree may hold others.
    pairs = [value.rpartition("=")[::2] for value in values]
    for value, (node, policy) in zip(values, pairs, strict=True):
        if not (node and policy):
            message = f"expected NODE=NAME, such as Explore=segmentation, got '{value}'"
            raise click.BadParameter(message, ctx, param)
    return _each_once(ctx, param, pairs, "node '{}' is given two policies")


def node_ports(
    ctx: click.Context, param: click.Parameter, values: tuple[str, ...]
) -> dict[str, str]:
    """Return the values of several NODE.PORT=VALUE, by NODE.PORT.

    Raises:
        BadParameter: one is malformed, or two are about the same port.
    """
    for value in values:
        name, equals, _ = value.partition("=")
        node, _, port = name.rpartition(".")
        if not (node and port and equals):
            message = f"expected NODE.PORT=VALUE, such as TakeOff.height_m=1.2, got '{value}'"
            raise click.BadParameter(message, ctx, param)
    pairs = [value.partition("=")[::2] for value in values]
    return _each_once(ctx, param, pairs, "port '{}' is given two values")


def variables(
    ctx: click.Context, param: click.Parameter, values: tuple[str, ...]
) -> dict[str, int | float | str]:
    """Return the values of several NAME=VALUE, by name: numbers, or texts.

    Raises:
        BadParameter: one is malformed, or two are about the same variable.
    """
    for value in values:
        name, equals, _ = value.partition("=")
        if not (name and equals):
            message = f"expected NAME=VALUE, such as laps=3, got '{value}'"
            raise click.BadParameter(message, ctx, param)
    pairs = [value.partition("=")[::2] for value in values]
    found = _each_once(ctx, param, pairs, "variable '{}' is given two values")
    return {name: entry_value(text) for name, text in found.items()}


def ros_packages(
    ctx: click.Context, param: click.Parameter, values: tuple[str, ...]
) -> dict[str, Path]:
    """Return the folders of several NAME=DIR.

    Raises:
        BadParameter: one is malformed or no folder, or two are about the same package.
    """
    pairs = [value.partition("=")[::2] for value in values]
    for value, (name, folder) in zip(values, pairs, strict=True):
        if not name or not Path(folder or "?").is_dir():
            message = f"expected NAME=DIR, a folder that exists; got '{value}'"
            raise click.BadParameter(message, ctx, param)
    folders = _each_once(ctx, param, pairs, "package '{}' is given two folders")
    return {name: Path(folder) for name, folder in folders.items()}


def _each_once(
    ctx: click.Context,
    param: click.Parameter,
    pairs: Sequence[tuple[str, str]],
    message: str,
) -> dict[str, str]:
    """Return pairs as a mapping; refuse a name that stands twice."""
    found: dict[str, str] = {}
    for name, value in pairs:
        if name in found:
            raise click.BadParameter(message.format(name), ctx, param)
        found[name] = value
    return found
