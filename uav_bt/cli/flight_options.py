"""The command line's options of a flight, made from what `FlightOptions` declares."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import click

from uav_bt.app.options import FlightOptions, declared
from uav_bt.cli.command import OutputFile
from uav_bt.cli.options import INPUT, Decorator, grouped, tree_folders_option, tree_option
from uav_bt.cli.values import Number, WholeNumber, image_size, node_policies, node_ports, variables
from uav_bt.mission.judge import JudgeConfig


def flight_options(*names: str) -> Decorator:
    """Return the options of a flight with these names, as the one parameter `flight`."""
    return grouped("flight", FlightOptions, **{name: flight_option(name) for name in names})


def flight_option(name: str, **changes: Any) -> Decorator:
    """Return one option of a flight, as a parameter of the field's name.

    Args:
        name: of a field of `FlightOptions`.
        changes: attributes of `click.option` that this command has otherwise.
    """
    if name in _OF_TREE_FILES:
        return _OF_TREE_FILES[name]
    about, default = declared(name)
    attributes: dict[str, Any] = {"metavar": about.metavar, "help": about.help}
    if isinstance(default, bool):
        attributes["is_flag"] = True
    elif name in _FORMS:
        attributes |= _FORMS[name]
    else:
        attributes["default"] = default
    if about.file is not None:
        attributes["type"] = INPUT if about.file == "read" else OutputFile(about.suffix)
    elif about.least is not None:
        attributes["type"] = WholeNumber(min=about.least)
    elif about.choices:
        attributes["type"] = click.Choice(about.choices)
    return click.option(str(about.flag), name, **{**attributes, **changes})


def _judge(ctx: click.Context, param: click.Parameter, value: float | None) -> JudgeConfig:
    del ctx, param
    return JudgeConfig(time_limit_s=value)


_OF_TREE_FILES: Final = {"tree_id": tree_option, "tree_folders": tree_folders_option}
# Values that the command line writes otherwise than Python does.
_FORMS: Final[Mapping[str, Mapping[str, Any]]] = {
    "image_size_px": {
        "callback": image_size,
        "default": "{}x{}".format(*FlightOptions.image_size_px),
    },
    "policies": {"callback": node_policies, "multiple": True},
    "ports": {"callback": node_ports, "multiple": True},
    "variables": {"callback": variables, "multiple": True},
    "params": {"type": INPUT},
    "leaves": {"type": INPUT, "multiple": True},
    "faults": {"multiple": True},
    "judge": {
        "callback": _judge,
        "type": Number(min=0.0, min_open=True),
        "metavar": "SECONDS",
        "help": "End the flight as a timeout this long after the take-off command. Default: as the "
        "mission's Rules say, else 300 s.",
    },
}
