"""Parameters of a mission: values of ports and of variables that a caller gives, not the file."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Final

from uav_bt.errors import InputError, ValueRangeError
from uav_bt.option import Option, pairs
from uav_bt.tree.mission_tree import Place
from uav_bt.tree.nodes.base import entry_value

SET: Final = "set"
VAR: Final = "var"

Plain = bool | int | float | str
"""Values of a variable that files can hold."""


@dataclass(frozen=True, kw_only=True)
class Parameters:
    """Values that a mission gets from outside.

    Attributes:
        ports: Texts as in a tree file, by NODE.PORT.
        variables: First values of variables of the main tree.
        places: Where a parameter file has them: `("set", NODE.PORT)` and `("var", NAME)`.
    """

    ports: Mapping[str, str] = field(default_factory=dict)
    variables: Mapping[str, Plain] = field(default_factory=dict)
    places: Mapping[tuple[str, str], Place] = field(default_factory=dict, compare=False)

    def over(self, other: Parameters) -> Parameters:
        """Return the values of both; where both have one, that of this object."""
        mine = {*((SET, name) for name in self.ports), *((VAR, name) for name in self.variables)}
        theirs = {one: place for one, place in other.places.items() if one not in mine}
        return Parameters(
            ports={**other.ports, **self.ports},
            variables={**other.variables, **self.variables},
            places={**theirs, **self.places},
        )


def split_port(name: str) -> tuple[str, str]:
    """Return node and port of a NODE.PORT, split at the last dot, or raise a ValueRangeError."""
    node, _, port = name.rpartition(".")
    if not (node and port):
        raise ValueRangeError(f"expected NODE.PORT, such as TakeOff.height_m, got '{name}'")
    return node, port


_PORT: Final = "NODE.PORT=VALUE, such as TakeOff.height_m=1.2"


def _ports(texts: Iterable[str]) -> dict[str, str]:
    found = pairs(texts, "port", _PORT)
    for name, value in found.items():
        if not all(name.rpartition(".")[::2]):
            raise InputError(f"expected {_PORT}, got '{name}={value}'")
    return found


def _variables(texts: Iterable[str]) -> dict[str, Plain]:
    found = pairs(texts, "variable", "NAME=VALUE, such as laps=3")
    return {name: entry_value(text) for name, text in found.items()}


Ports = Annotated[
    Mapping[str, str],
    Option(
        "Let a port of one node, by name or path, have another value than in the tree file: "
        "ExploreFor.min_gain=0.01. Repeatable.",
        "--set NODE.PORT=VALUE",
        "Mission",
        read=_ports,
    ),
]
Variables = Annotated[
    Mapping[str, Plain],
    Option(
        "Give a variable of the main tree its first value: a number or a text. Repeatable.",
        "--var NAME=VALUE",
        "Mission",
        read=_variables,
    ),
]
PARAMS: Final = Option(
    "A file with such values: YAML with the keys `set` and `var`, in a campaign also `variants`. "
    "--set and --var take precedence.",
    "FILE.yaml",
    "Mission",
    path="read",
)
Params = Annotated[Path | None, PARAMS]
