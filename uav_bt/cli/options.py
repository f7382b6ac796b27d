"""Options that several commands take, and what checks their values."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import click

from uav_bt.cli.command import OutputFile, OutputFolder
from uav_bt.cli.ranges import WholeNumber

INPUT: Final = click.Path(dir_okay=False, path_type=Path)
FOLDER: Final = OutputFolder()
RUNS: Final = Path("runs")  # the folder of results; git ignores it

records_argument = click.argument(
    "records", nargs=-1, required=True, metavar="RECORDS...", type=click.Path(path_type=Path)
)

_Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


def _image_size(ctx: click.Context, param: click.Parameter, value: str) -> tuple[int, int]:
    """Return width and height in pixels of a WIDTHxHEIGHT.

    Raises:
        BadParameter: it is none.
    """
    match = re.fullmatch(r"([1-9]\d{0,4})[xX]([1-9]\d{0,4})", value)
    if match is None:
        raise click.BadParameter(f"expected a size such as 640x360, got '{value}'", ctx, param)
    return int(match[1]), int(match[2])


def _node_policies(
    ctx: click.Context, param: click.Parameter, values: tuple[str, ...]
) -> dict[str, str]:
    """Return the names of policies by node of several NODE=NAME.

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


image_size_option = click.option(
    "--image-size",
    metavar="WxH",
    callback=_image_size,
    default="640x360",
    show_default=True,
    help="Size of the camera's frames, 16:9.",
)
tree_option = click.option(
    "--tree",
    "tree_id",
    metavar="ID",
    help="Which of the file's trees; default: the one that it names, or that no other uses.",
)
policy_option = click.option(
    "--policy",
    "policies",
    metavar="NODE=NAME",
    multiple=True,
    callback=_node_policies,
    help="Let a node, by name or path, use another leaf policy. Repeatable.",
)
profile_option = click.option(
    "--profile",
    metavar="NAME",
    default="lab",
    show_default=True,
    help="How imperfect the twin is: ideal, lab or harsh; lab-instant and harsh-instant have "
    "telemetry without delay.",
)
movers_option = click.option(
    "--movers",
    metavar="N",
    type=WholeNumber(min=0),
    default=0,
    show_default=True,
    help="So many people and carts, drawn from the seed, move in the twin's scene besides its own; "
    "8 together at most.",
)
threads_option = click.option(
    "--threads",
    type=WholeNumber(min=1),
    default=1,
    show_default=True,
    help="Threads of the networks' inference.",
)
workers_option = click.option(
    "--workers", type=WholeNumber(min=1), help="Flights at a time; default: all cores."
)


def output_option(
    name: str, help_: str, *, default: Path | None = None, suffix: str = ""
) -> _Decorator:
    """Return an option for a file that will be written.

    Args:
        name: of the option, with its dashes.
        help_: its line in the help.
        default: the file without the option; None for no file.
        suffix: how the file's name must end.
    """
    return click.option(
        name,
        metavar="FILE",
        type=OutputFile(suffix),
        default=default,
        show_default=default is not None,
        help=help_,
    )


def format_option(*choices: str, help_: str) -> _Decorator:
    """Return the option for the form of what is printed, the parameter `format_`.

    Args:
        choices: the forms; the first is the default.
        help_: its line in the help.
    """
    return click.option(
        "--format",
        "format_",
        type=click.Choice(choices),
        default=choices[0],
        show_default=True,
        help=help_,
    )


def seed_option(default: int = 0) -> _Decorator:
    """Return the option for the seed."""
    return click.option(
        "--seed",
        type=WholeNumber(min=0),
        default=default,
        show_default=True,
        help="Seed of everything random.",
    )


def views_option(default: int) -> _Decorator:
    """Return the options for which images of the twin are drawn, and how many of each scene."""

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        scenes = click.option(
            "--scene",
            "scenes",
            metavar="SCENE",
            multiple=True,
            help="Draw images of this scene, by name or file, not of the default ones. Repeatable.",
        )
        views = click.option(
            "--views",
            type=WholeNumber(min=1),
            default=default,
            show_default=True,
            help="Images of each scene.",
        )
        return scenes(views(command))

    return decorate


def run_option(name: str, content: str) -> _Decorator:
    """Return the option for the folder of a training.

    Args:
        name: of its default, a folder in `RUNS`.
        content: what is kept there.
    """
    return click.option(
        "--run",
        metavar="DIR",
        type=FOLDER,
        default=RUNS / name,
        show_default=True,
        help=f"Where {content} are kept; the same command continues a training from there.",
    )


def device_option() -> _Decorator:
    """Return the option for the device that a network is trained on."""
    return click.option(
        "--device",
        type=click.Choice(["cpu", "cuda"]),
        default="cpu",
        show_default=True,
        help="Where PyTorch trains; 'cuda' needs a GPU and a PyTorch built for it.",
    )


def batch_option(default: int, what: str) -> _Decorator:
    """Return the option for the size of a batch; `what` it is made of."""
    return click.option(
        "--batch",
        type=WholeNumber(min=2),
        default=default,
        show_default=True,
        help=f"{what} in a step.",
    )


def steps_option(default: int) -> _Decorator:
    """Return the option for the steps of a training."""
    return click.option(
        "--steps",
        type=WholeNumber(min=1),
        default=default,
        show_default=True,
        help="Steps of training.",
    )
