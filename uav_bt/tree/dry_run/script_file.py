"""Script files: what the leaves of a mission answer in a dry run.

A YAML file:

    leaves:                  # by path, name or node id, as `uav-bt tree render` shows them
      TakeOff: RRS           # running, running, success; the last letter is answered for ever
      Explore: (RRS)         # letters in brackets are answered over and over
    default: S               # for all leaves without a script of their own
    outputs:                 # what a leaf writes to its output ports whenever it succeeds
      Measure: {depth_m: 1.5}
    variables: {laps: 3}     # of the main tree, before the first tick
    board: {phase: explore}  # keys of the mission board; numbers, texts, true and false

Only `leaves` or `default` must be there. The letters are those of `uav_bt.tree.scripted`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

from pydantic import AfterValidator, Field

from uav_bt.errors import ValueRangeError
from uav_bt.tree.scripted import AnswerScript
from uav_bt.yaml_file import read_yaml

Plain = bool | int | float | str
"""What a variable or a board key can be given in a script file."""


@dataclass(frozen=True)
class Scalar:
    """A value with the line that has it."""

    value: Plain
    line: int


@dataclass(frozen=True, kw_only=True)
class SimulationScript:
    """The content of a script file; selectors are paths, names or node ids of leaves."""

    path: Path
    leaves: Mapping[str, Scalar] = field(default_factory=dict)  # answers by selector
    default: str | None = None  # answers of all other leaves
    outputs: Mapping[str, Mapping[str, Scalar]] = field(default_factory=dict)  # by port
    variables: Mapping[str, Scalar] = field(default_factory=dict)
    board: Mapping[str, Scalar] = field(default_factory=dict)


def read_script(path: Path) -> SimulationScript:
    """Read a script file.

    Raises:
        FileError: it cannot be read, is no YAML, or has an entry that no script has; with
            the line.
    """
    file = read_yaml(path, _ScriptFile, "script file")
    found = file.value

    def scalars(*section: str) -> dict[str, Scalar]:
        values = found.outputs[section[1]] if len(section) > 1 else getattr(found, section[0])
        return {name: Scalar(value, file.line(*section, name)) for name, value in values.items()}

    return SimulationScript(
        path=path,
        leaves=scalars("leaves"),
        default=None if found.default is None else str(found.default),
        outputs={selector: scalars("outputs", selector) for selector in found.outputs},
        variables=scalars("variables"),
        board=scalars("board"),
    )


def _answers(value: Plain) -> Plain:
    AnswerScript.parse(str(value))
    return value


# A variable may be infinite; nothing else may.
_Value = bool | int | Annotated[float, Field(allow_inf_nan=True)] | str
_Answers = Annotated[_Value, AfterValidator(_answers)]


@dataclass(frozen=True, kw_only=True)
class _ScriptFile:
    leaves: dict[str, _Answers] = field(default_factory=dict)
    default: _Answers | None = None
    outputs: dict[str, dict[str, _Value]] = field(default_factory=dict)
    variables: dict[str, _Value] = field(default_factory=dict)
    board: dict[str, _Value] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.leaves and self.default is None:
            raise ValueRangeError("expected 'leaves' with answers of leaves, or a 'default'")
