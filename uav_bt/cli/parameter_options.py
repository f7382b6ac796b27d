"""Options with values of ports and of variables, for commands that do not fly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

import click

from uav_bt.cli.options import INPUT, grouped
from uav_bt.cli.values import node_ports, variables
from uav_bt.tree.loading.parameters import (
    WHICH_PARAMS,
    WHICH_PORTS,
    WHICH_VARIABLES,
    Parameters,
    Plain,
)


def _given(
    ports: Mapping[str, str], variables: Mapping[str, Plain], params: Path | None
) -> tuple[Parameters, ...]:
    """Return the values of the command line: none, one set, or one for each variant of the file."""
    own = Parameters(ports=ports, variables=variables)
    if params is None:
        return (own,) if ports or variables else ()
    from uav_bt.tree.loading.parameter_file import read_parameters  # noqa: PLC0415  (reads YAML)

    file = read_parameters(params)
    variants = file.variants.values() or [file.common]
    return tuple(own.over(each) for each in variants)


def single(parameters: Sequence[Parameters]) -> Parameters | None:
    """Return the one set of values of a command that takes no variants; None without values.

    Raises:
        UsageError: the file of --params has variants.
    """
    if len(parameters) > 1:
        raise click.UsageError(
            f"the file of --params has {len(parameters)} variants, which a campaign flies and "
            "`uav-bt check` checks: give a file with `set` and `var` only"
        )
    return next(iter(parameters), None)


parameter_options: Final = grouped(
    "parameters",
    _given,
    ports=click.option(
        "--set",
        "ports",
        metavar="NODE.PORT=VALUE",
        multiple=True,
        callback=node_ports,
        help=WHICH_PORTS,
    ),
    variables=click.option(
        "--var",
        "variables",
        metavar="NAME=VALUE",
        multiple=True,
        callback=variables,
        help=WHICH_VARIABLES,
    ),
    params=click.option("--params", metavar="FILE.yaml", type=INPUT, help=WHICH_PARAMS),
)
