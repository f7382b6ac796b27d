"""Parameters of a mission: values of ports and of variables that a caller gives, not the file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from uav_bt.errors import ValueRangeError
from uav_bt.tree.mission_tree import Place

WHICH_PORTS: Final = (
    "Let a port of one node, by name or path, have another value than in the tree file: "
    "ExploreFor.min_gain=0.01. Repeatable."
)
WHICH_VARIABLES: Final = (
    "Give a variable of the main tree its first value: a number or a text. Repeatable."
)
WHICH_PARAMS: Final = (
    "A file with such values: YAML with the keys `set` and `var`, in a campaign also `variants`. "
    "--set and --var take precedence."
)
"""Descriptions of the options of flights and commands."""

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
