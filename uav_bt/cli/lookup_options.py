"""The options for where the trees and included files are that a tree file does not hold."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click

from uav_bt.tree.loading.folders import TreeFolders


def _packages(
    ctx: click.Context, param: click.Parameter, values: tuple[str, ...]
) -> dict[str, Path]:
    """Return the folders of several NAME=DIR.

    Raises:
        BadParameter: one is malformed or no folder, or two are about the same package.
    """
    packages: dict[str, Path] = {}
    for value in values:
        name, _, folder = value.partition("=")
        if not name or not Path(folder or "?").is_dir():
            message = f"expected NAME=DIR, a folder that exists; got '{value}'"
            raise click.BadParameter(message, ctx, param)
        if name in packages:
            raise click.BadParameter(f"package '{name}' is given two folders", ctx, param)
        packages[name] = Path(folder)
    return packages


def lookup_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Add the options for where trees and included files are, as the parameter `tree_folders`."""
    folder = click.Path(exists=True, file_okay=False, path_type=Path)

    @click.option(
        "--trees",
        "libraries",
        metavar="DIR",
        type=folder,
        multiple=True,
        help="Look for trees that a file does not hold in the files of this folder. Repeatable.",
    )
    @click.option(
        "--include-root",
        metavar="DIR",
        type=folder,
        help="Files may be included from this folder and below, not only from beside the file.",
    )
    @click.option(
        "--ros-pkg",
        "packages",
        metavar="NAME=DIR",
        multiple=True,
        callback=_packages,
        help='The folder of a ROS package, for <include ros_pkg="NAME"/>. Repeatable.',
    )
    @functools.wraps(command)
    def with_folders(
        *args: Any,
        libraries: tuple[Path, ...],
        include_root: Path | None,
        packages: dict[str, Path],
        **kwargs: Any,
    ) -> Any:
        folders = TreeFolders(trees=libraries, include_root=include_root, packages=packages)
        return command(*args, tree_folders=folders, **kwargs)

    return with_folders
