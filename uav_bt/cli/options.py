"""Options that several commands take, and groups of options as one object."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import click

from uav_bt.cli.command import OutputFile, OutputFolder
from uav_bt.cli.values import WholeNumber, ros_packages
from uav_bt.tree.loading.lookup import WHICH_TREE, TreeFolders

INPUT: Final = click.Path(dir_okay=False, path_type=Path)
FOLDER: Final = OutputFolder()
RUNS: Final = Path("runs")  # the folder of results; git ignores it

records_argument = click.argument(
    "records", nargs=-1, required=True, metavar="RECORDS...", type=click.Path(path_type=Path)
)

Decorator = Callable[[Callable[..., Any]], Callable[..., Any]]


def grouped(name: str, make: Callable[..., Any], **options: Decorator) -> Decorator:
    """Return a decorator that adds options and hands the command one object of their values.

        @grouped("training", Training, seed=seed_option(), steps=steps_option(4000))

    Args:
        name: the command's parameter for the object.
        make: takes the options' values by name and returns the object.
        options: click's decorators by the parameter that each of them adds, in the help's order.
    """

    def decorate(command: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(command)
        def with_object(*args: Any, **values: Any) -> Any:
            given = {each: values.pop(each) for each in options}
            return command(*args, **{name: make(**given)}, **values)

        decorated: Callable[..., Any] = with_object
        for option in reversed(options.values()):
            decorated = option(decorated)
        return decorated

    return decorate


tree_option: Final[Decorator] = click.option("--tree", "tree_id", metavar="ID", help=WHICH_TREE)

_FOLDER: Final = click.Path(exists=True, file_okay=False, path_type=Path)


def _folders(
    libraries: tuple[Path, ...], include_root: Path | None, packages: dict[str, Path]
) -> TreeFolders:
    return TreeFolders(trees=libraries, include_root=include_root, packages=packages)


tree_folders_option: Final = grouped(
    "tree_folders",
    _folders,
    libraries=click.option(
        "--trees",
        "libraries",
        metavar="DIR",
        type=_FOLDER,
        multiple=True,
        help="Look for trees that a file does not hold in the files of this folder. Repeatable.",
    ),
    include_root=click.option(
        "--include-root",
        metavar="DIR",
        type=_FOLDER,
        help="Files may be included from this folder and below, not only from beside the file.",
    ),
    packages=click.option(
        "--ros-pkg",
        "packages",
        metavar="NAME=DIR",
        multiple=True,
        callback=ros_packages,
        help='The folder of a ROS package, for <include ros_pkg="NAME"/>. Repeatable.',
    ),
)

workers_option = click.option(
    "--workers", type=WholeNumber(min=1), help="Flights at a time; default: all cores."
)


def output_option(
    name: str, help_: str, *, default: Path | None = None, suffix: str = ""
) -> Decorator:
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
        help=help_,
    )


def format_option(*choices: str, help_: str) -> Decorator:
    """Return the option for the output format, the parameter `format_`.

    Args:
        choices: the forms; the first is the default.
        help_: its line in the help.
    """
    return click.option(
        "--format",
        "format_",
        type=click.Choice(choices),
        default=choices[0],
        help=help_,
    )
