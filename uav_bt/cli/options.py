"""Options that several commands take, and what checks their values."""

from __future__ import annotations

import os
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import click

from uav_bt.files import writing

if TYPE_CHECKING:
    from uav_bt.tree import NodeRegistry

__all__ = [
    "groot_port",
    "image_size_option",
    "output_option",
    "palette_option",
    "policy_option",
    "profile_option",
    "registry_with",
    "seed_option",
    "tell_or_write",
    "threads_option",
    "views_option",
]

_MAX_GROOT_PORT: Final = 65_534  # notifications have the next one

_Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


def _picture_size(ctx: click.Context, param: click.Parameter, value: str) -> tuple[int, int]:
    """Return width and height in pixels of a WIDTHxHEIGHT.

    Raises:
        BadParameter: it is none.
    """
    match = re.fullmatch(r"([1-9]\d{0,4})[xX]([1-9]\d{0,4})", value)
    if match is None:
        raise click.BadParameter(f"expected a size such as 640x360, got '{value}'", ctx, param)
    return int(match[1]), int(match[2])


def groot_port(ctx: click.Context, param: click.Parameter, value: str | None) -> int | None:
    """Return a port whose neighbour exists, too.

    Raises:
        BadParameter: it is none.
    """
    if value is None:
        return None
    if not re.fullmatch(r"[1-9]\d{0,4}", value) or int(value) > _MAX_GROOT_PORT:
        # `--groot` takes the next word for its port; the mission's name may be meant.
        raise click.BadParameter(
            f"expected a port from 1 to {_MAX_GROOT_PORT} or nothing, got '{value}'; "
            "write a --groot without a port after TREE",
            ctx,
            param,
        )
    return int(value)


def _node_policies(
    ctx: click.Context, param: click.Parameter, values: tuple[str, ...]
) -> dict[str, str]:
    """Return policies' names by node of several NODE=NAME.

    Raises:
        BadParameter: one is malformed, or two are about the same node.
    """
    policies: dict[str, str] = {}
    for value in values:
        node, _, policy = value.rpartition("=")
        if not (node and policy):
            raise click.BadParameter(
                f"expected NODE=NAME, such as Explore=segmentation, got '{value}'", ctx, param
            )
        if node in policies:
            raise click.BadParameter(f"node '{node}' is given two policies", ctx, param)
        policies[node] = policy
    return policies


def _writable(ctx: click.Context, param: click.Parameter, value: Path | None) -> Path | None:
    """Refuse, before any work is done, a file whose folder is absent or does not let us write."""
    if value is None:
        return None
    if not value.parent.is_dir():
        raise click.BadParameter(
            f"folder '{value.parent}' does not exist; create it first", ctx, param
        )
    if not os.access(value.parent, os.W_OK):
        raise click.BadParameter(f"folder '{value.parent}' cannot be written to", ctx, param)
    return value


def output_option(name: str, help_: str) -> _Decorator:
    """Return an option for a file that will be written."""
    return click.option(
        name,
        metavar="FILE",
        type=click.Path(dir_okay=False, writable=True, path_type=Path),
        callback=_writable,
        help=help_,
    )


def tell_or_write(text: str, out: Path | None) -> None:
    """Print a text, or write it into a file.

    Raises:
        FileError: the file cannot be written.
    """
    if out is None:
        click.echo(text, nl=False)
        return
    with writing(out):
        out.write_text(text, encoding="utf-8")
    click.echo(f"written: {out}")


def palette_option() -> _Decorator:
    """Return the option for a palette of nodes that are not installed."""
    return click.option(
        "--palette",
        metavar="FILE",
        type=click.Path(dir_okay=False, path_type=Path),
        help="A file with a TreeNodesModel, such as Groot2 exports or saves in its tree files, of "
        "nodes that are not installed here.",
    )


def registry_with(palette: Path | None) -> NodeRegistry:
    """Return the installed nodes, with those of a palette.

    Raises:
        TreeError: the palette cannot be read or makes no sense.
    """
    from uav_bt.tree import NodeRegistry  # noqa: PLC0415 - `--help` need not wait for it
    from uav_bt.tree.loading.palette import read_palette, with_palette  # noqa: PLC0415

    installed = NodeRegistry.installed()
    return installed if palette is None else with_palette(installed, read_palette(palette))


def seed_option(default: int = 0) -> _Decorator:
    """Return the option for the seed."""
    return click.option(
        "--seed",
        type=click.IntRange(min=0),
        default=default,
        show_default=True,
        help="Of everything random.",
    )


def views_option(default: int) -> _Decorator:
    """Return the options that say which pictures of the twin are taken."""

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        scenes = click.option(
            "--scene",
            "scenes",
            metavar="SCENE",
            multiple=True,
            help="Take pictures of this scene, by name or file, not of the usual ones. Repeatable.",
        )
        views = click.option(
            "--views",
            type=click.IntRange(min=1),
            default=default,
            show_default=True,
            help="Pictures of each scene.",
        )
        return scenes(views(command))

    return decorate


def image_size_option() -> _Decorator:
    """Return the option for the size of the camera's pictures."""
    return click.option(
        "--image-size",
        metavar="WxH",
        callback=_picture_size,
        default="640x360",
        show_default=True,
        help="Of the camera's pictures, 16:9.",
    )


def policy_option() -> _Decorator:
    """Return the repeatable option that swaps leaf policies; the parameter is `policies`."""
    return click.option(
        "--policy",
        "policies",
        metavar="NODE=NAME",
        multiple=True,
        callback=_node_policies,
        help="Let a node, by name or path, use another leaf policy. Repeatable.",
    )


def profile_option() -> _Decorator:
    """Return the option for how imperfect the twin is."""
    return click.option(
        "--profile",
        default="lab",
        show_default=True,
        help="How imperfect the twin is: ideal, lab or harsh.",
    )


def threads_option() -> _Decorator:
    """Return the option for the threads of inference."""
    return click.option(
        "--threads",
        type=click.IntRange(min=1),
        default=1,
        show_default=True,
        help="Of the networks' inference.",
    )
