"""Script files: what the leaves of a mission answer in a dry run.

A YAML file:

    leaves:                  # by path, name or node id, as `uav-bt render` shows them
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
from typing import Any, Final

import yaml

from uav_bt.errors import FileError, ValueRangeError, did_you_mean
from uav_bt.tree.scripted import AnswerScript

__all__ = ["Plain", "Scalar", "SimulationScript", "read_script"]

Plain = bool | int | float | str
"""What a variable or a board key can be given in a script file."""

_MAX_BYTES: Final = 1_000_000
_SECTIONS: Final = ("leaves", "default", "outputs", "variables", "board")


@dataclass(frozen=True)
class Scalar:
    """A value with the line that has it."""

    value: Plain
    line: int


@dataclass(frozen=True, kw_only=True)
class SimulationScript:
    """What a script file says; selectors are paths, names or node ids of leaves."""

    path: Path
    leaves: Mapping[str, Scalar] = field(default_factory=dict)  # answers by selector
    default: str | None = None  # answers of all other leaves
    outputs: Mapping[str, Mapping[str, Scalar]] = field(default_factory=dict)  # by port
    variables: Mapping[str, Scalar] = field(default_factory=dict)
    board: Mapping[str, Scalar] = field(default_factory=dict)


def read_script(path: Path) -> SimulationScript:
    """Read a script file.

    Raises:
        FileError: it cannot be read, is no YAML, or says something that no script can say; with
            the line.
    """
    reader = _Reader(path)
    root = reader.root()
    sections = reader.entries(root, "the script file")
    for name, (key, _) in sections.items():
        if name not in _SECTIONS:
            raise reader.error(key, f"unknown entry '{name}'{did_you_mean(name, _SECTIONS)}")
    leaves = reader.scalars(sections, "leaves")
    for answers in leaves.values():
        reader.check_answers(answers)
    default = None
    if "default" in sections:
        default = reader.check_answers(reader.scalar(sections["default"][1], "default"))
    if not leaves and default is None:
        raise reader.error(root, "expected 'leaves' with answers of leaves, or a 'default'")
    outputs = {
        selector: reader.scalars({"ports": entry}, "ports")
        for selector, entry in reader.section(sections, "outputs").items()
    }
    return SimulationScript(
        path=path,
        leaves=leaves,
        default=default,
        outputs=outputs,
        variables=reader.scalars(sections, "variables"),
        board=reader.scalars(sections, "board"),
    )


_Entries = dict[str, tuple[yaml.Node, yaml.Node]]  # key node and value node, by the key's text


class _Reader:
    """Composed YAML with its lines; nothing in it is turned into an object but plain scalars."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._construct = yaml.constructor.SafeConstructor()

    def root(self) -> yaml.Node:
        try:
            if self._path.stat().st_size > _MAX_BYTES:
                raise FileError(self._path, f"larger than {_MAX_BYTES} bytes")
            text = self._path.read_text(encoding="utf-8")
        except UnicodeDecodeError as error:
            raise FileError(self._path, f"no UTF-8 text: {error.reason}") from error
        except OSError as error:
            raise FileError(self._path, f"cannot be read: {error.strerror}") from error
        try:
            root = yaml.compose(text, Loader=yaml.SafeLoader)
        except yaml.MarkedYAMLError as error:
            mark = error.problem_mark or error.context_mark
            line = mark.line + 1 if mark is not None else None
            raise FileError(self._path, f"no YAML: {error.problem}", line) from error
        except (yaml.YAMLError, RecursionError) as error:
            raise FileError(self._path, f"no YAML: {error}") from error
        if root is None:
            raise FileError(self._path, "empty: expected 'leaves' or 'default'", 1)
        return root

    def error(self, node: yaml.Node, message: str) -> FileError:
        return FileError(self._path, message, node.start_mark.line + 1)

    def entries(self, node: yaml.Node, what: str) -> _Entries:
        if not isinstance(node, yaml.MappingNode):
            raise self.error(node, f"{what}: expected entries such as 'name: value'")
        entries: _Entries = {}
        for key, value in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise self.error(key, f"{what}: expected a name before the colon")
            if key.value in entries:
                raise self.error(key, f"{what}: '{key.value}' is there twice")
            entries[key.value] = (key, value)
        return entries

    def section(self, sections: _Entries, name: str) -> _Entries:
        return self.entries(sections[name][1], name) if name in sections else {}

    def scalars(self, sections: _Entries, name: str) -> dict[str, Scalar]:
        return {
            key: self.scalar(value, key) for key, (_, value) in self.section(sections, name).items()
        }

    def scalar(self, node: yaml.Node, what: str) -> Scalar:
        value: Any = None
        if isinstance(node, yaml.ScalarNode):
            try:
                value = self._construct.construct_object(node)
            except (yaml.YAMLError, ValueError) as error:
                raise self.error(node, f"'{what}': {error}") from error
        if not isinstance(value, (bool, int, float, str)):
            raise self.error(node, f"'{what}': expected a number, a text, true or false")
        return Scalar(value, node.start_mark.line + 1)

    def check_answers(self, answers: Scalar) -> str:
        text = str(answers.value)
        try:
            AnswerScript.parse(text)
        except ValueRangeError as error:
            raise FileError(self._path, str(error), answers.line) from error
        return text
