"""YAML files as typed values: every problem of a file at once, each with its line.

A file's form is a dataclass (or any type that pydantic knows); pydantic checks the values, PyYAML
knows the lines. Checks of a dataclass itself go into its `__post_init__` and raise ValueRangeError:

    @dataclass(frozen=True, kw_only=True)
    class Room:
        width_m: Annotated[float, Field(gt=0.0)]
        doors: tuple[str, ...] = ()

    room = read_yaml(Path("room.yaml"), Room, "room file").value
"""

from __future__ import annotations

import functools
import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Generic, NamedTuple, TypeVar

import yaml
from pydantic import ConfigDict, TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from uav_bt.errors import FileError, did_you_mean
from uav_bt.files import reading

__all__ = ["YamlFile", "read_yaml"]

T = TypeVar("T")
Step = str | int  # a key of a mapping, an index of a list

_MAX_BYTES: Final = 1_000_000
_MAX_VALUES: Final = 100_000  # aliases of aliases make billions of a few lines
_COLLECTIONS: Final = ("tag:yaml.org,2002:map", "tag:yaml.org,2002:seq")
_EXPECTED: Final = {
    **dict.fromkeys(("float_type", "float_parsing"), "a number"),
    **dict.fromkeys(("int_type", "int_parsing", "int_from_float"), "a whole number"),
    **dict.fromkeys(("list_type", "tuple_type"), "a list"),
    "bool_type": "true or false",
    "string_type": "a text",
    "finite_number": "a finite number",
    "path_type": "the path of a file",
}


class Problem(NamedTuple):
    """Something in a file that cannot be used."""

    line: int
    text: str


@dataclass(frozen=True)
class YamlFile(Generic[T]):
    """What a file says, with the lines where it says so.

    Attributes:
        path: the file.
        value: its content.
        root: its nodes; None for an empty file.
        failure: what `error` returns.
    """

    path: Path
    value: T
    root: yaml.Node | None
    failure: type[FileError]

    def line(self, *steps: Step) -> int:
        """Return the line of a value, by the keys and indices that lead to it."""
        return _find(self.root, steps).line

    def error(self, message: str, *steps: Step) -> FileError:
        """Return an error about a value, by the keys and indices that lead to it."""
        place = _find(self.root, steps)
        return self.failure(self.path, _located(place.where, message), place.line)


def read_yaml(
    path: Path,
    form: type[T],
    what: str,
    *,
    failure: type[FileError] = FileError,
    remedy: str = "",
) -> YamlFile[T]:
    """Read a YAML file; JSON is YAML too. An empty file is an empty mapping.

    Args:
        path: the file. Validators find its folder in their context, as `folder`.
        form: the type of its content; keys that it does not have are refused.
        what: the kind of file, for messages.
        failure: the error that is raised.
        remedy: what to do when there is no such file.

    Raises:
        FileError: the file is absent, no YAML, or not of that form; every problem on a line.
    """
    if not path.exists():
        raise failure(path, f"there is no such {what}{'; ' if remedy else ''}{remedy}")
    with reading(path, failure):
        if path.stat().st_size > _MAX_BYTES:
            raise failure(path, f"larger than {_MAX_BYTES} bytes")
        text = path.read_text(encoding="utf-8")
    try:
        root = yaml.compose(text, Loader=yaml.SafeLoader)
        content = {} if root is None else _Plain().value(root, "")
    except _ProblemError as error:
        raise failure(path, error.problem.text, error.problem.line) from error
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = mark.line + 1 if mark is not None else None
        raise failure(path, f"not valid YAML: {error.problem}", line) from error
    except (yaml.YAMLError, RecursionError) as error:
        raise failure(path, f"not valid YAML: {error}") from error
    try:
        # JSON in strict mode: lists for tuples, texts for paths, but no number for a text.
        key: Any = form  # mypy takes no type[T] for hashable
        (value,) = _adapter(key).validate_json(
            json.dumps([content]), context={"folder": path.parent}
        )
    except ValidationError as error:
        first, *others = _problems(root, error, form)
        lines = [first.text, *(f"{path}:{line}: {text}" for line, text in others)]
        raise failure(path, "\n".join(lines), first.line) from error
    return YamlFile(path, value, root, failure)


@functools.cache
def _adapter(form: Any) -> TypeAdapter[tuple[Any]]:
    # A dataclass cannot be given a config from outside; what stands in a tuple inherits it.
    config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)
    one: Any = tuple[form]
    return TypeAdapter(one, config=config)


# --- nodes to plain values ------------------------------------------------------------------------


class _ProblemError(Exception):
    def __init__(self, node: yaml.Node, text: str) -> None:
        super().__init__(text)
        self.problem = Problem(node.start_mark.line + 1, text)


class _Plain:
    """Turns nodes into numbers, texts, lists and mappings, and into nothing else."""

    def __init__(self) -> None:
        self._construct = yaml.constructor.SafeConstructor()
        self._count = 0

    def value(self, node: yaml.Node, where: str) -> Any:
        self._count += 1
        if self._count > _MAX_VALUES:
            raise _ProblemError(node, f"more than {_MAX_VALUES} values, aliases unfolded")
        if isinstance(node, yaml.ScalarNode):
            return self._scalar(node, where)
        if node.tag not in _COLLECTIONS:
            raise _ProblemError(node, f"not valid YAML: the tag {node.tag} is not allowed")
        if isinstance(node, yaml.SequenceNode):
            return [self.value(item, _joined(where, i)) for i, item in enumerate(node.value)]
        return self._mapping(node, where)

    def _mapping(self, node: yaml.Node, where: str) -> dict[str, Any]:
        content: dict[str, Any] = {}
        for key, item in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise _ProblemError(key, _located(where, "expected a name before the colon"))
            if key.value in content:
                raise _ProblemError(key, _located(where, f"the key '{key.value}' is given twice"))
            content[key.value] = self.value(item, _joined(where, key.value))
        return content

    def _scalar(self, node: yaml.ScalarNode, where: str) -> bool | float | str | None:
        try:
            value = self._construct.construct_object(node)
        except ValueError as error:  # the 45th of May
            raise _ProblemError(node, _located(where, f"{error}, got {_shown(node)}")) from error
        if value is None or isinstance(value, bool | int | float | str):
            return value
        expected = "expected a number, a text, true or false"
        raise _ProblemError(node, _located(where, f"{expected}, got {_shown(node)}"))


# --- pydantic's errors to problems ----------------------------------------------------------------


class _Place(NamedTuple):
    """A node of the file."""

    node: yaml.Node | None
    line: int
    where: str  # boxes[1].size_m


def _find(root: yaml.Node | None, steps: Iterable[Step]) -> _Place:
    node, where = root, ""
    line = 1 if root is None else root.start_mark.line + 1
    for step in steps:
        found = dict(_children(node)).get(step)
        if found is None:
            continue  # a key that is missing, or a name that pydantic gives a branch of a union
        mark, node = found
        line, where = mark.start_mark.line + 1, _joined(where, step)
    return _Place(node, line, where)


def _children(node: yaml.Node | None) -> Iterator[tuple[Step, tuple[yaml.Node, yaml.Node]]]:
    """Yield the children of a node: key or index, the node that has the line, the value."""
    if isinstance(node, yaml.SequenceNode):
        yield from ((index, (item, item)) for index, item in enumerate(node.value))
    elif isinstance(node, yaml.MappingNode):
        yield from ((key.value, (key, item)) for key, item in node.value)


def _problems(root: yaml.Node | None, error: ValidationError, form: Any) -> list[Problem]:
    """Return the problems of a file in the order of its lines."""
    expected: dict[_Place, list[str]] = {}  # the branches of a union fail at one place
    others: list[tuple[_Place, str]] = []
    for item in error.errors(include_url=False):
        kind, steps = item["type"], item["loc"][1:]
        place = _find(root, steps)
        if kind == "missing" and isinstance(steps[-1], str):
            others.append((place, f"lacks the key '{steps[-1]}'"))
        elif kind in ("unexpected_keyword_argument", "extra_forbidden"):
            known = _known(form, steps[:-1])
            hint = did_you_mean(str(steps[-1]), known)
            others.append((place, f"unknown key{hint} (known: {', '.join(known)})"))
        elif kind == "value_error":
            others.append((place, str(item["ctx"]["error"])))
        elif kind == "json_invalid":  # nested too deeply, half a surrogate pair
            others.append((place, f"not valid YAML: {item['ctx']['error']}"))
        elif steps[-1:] == ("[key]",):
            others.append((place, f"expected {_expected(item, form)} as key, got '{steps[-2]}'"))
        else:
            expected.setdefault(place, []).append(_expected(item, form))
    places = [*expected, *(place for place, _ in others)]
    for place, words in expected.items():
        # A branch that came further says better what is wrong.
        if not any(one.where.startswith((f"{place.where}[", f"{place.where}.")) for one in places):
            text = " or ".join(dict.fromkeys(words))
            others.append((place, f"expected {text}, got {_shown(place.node)}"))
    found = [Problem(place.line, _located(place.where, text)) for place, text in others]
    return sorted(dict.fromkeys(found), key=lambda problem: problem.line)


def _expected(item: ErrorDetails, form: Any) -> str:
    kind, steps = item["type"], item["loc"][1:]
    if kind == "missing":
        return f"a list of {_form_at(form, steps[:-1]).get('minItems', 'more')}"
    if kind == "too_short":
        return f"a list of at least {item['ctx']['min_length']}"
    if kind == "too_long":
        return f"a list of at most {item['ctx']['max_length']}"
    if kind in ("dict_type", "dataclass_type", "mapping_type"):
        known = _known(form, steps)
        return f"a mapping with {', '.join(known)}" if known else "a mapping"
    words = _EXPECTED.get(kind, item["msg"].removeprefix("Input should be "))
    return f"a number {words}" if "than" in kind else words


def _known(form: Any, steps: tuple[Step, ...]) -> list[str]:
    """Return the keys that a form has at a place."""
    return list(_form_at(form, steps).get("properties", ()))


def _form_at(form: Any, steps: tuple[Step, ...]) -> dict[str, Any]:
    """Return the JSON schema of a place."""
    whole = TypeAdapter(form).json_schema()
    part = whole
    for step in (*steps, None):
        while "$ref" in part or "anyOf" in part:
            if "$ref" in part:
                part = whole["$defs"][part["$ref"].rpartition("/")[2]]
            else:
                branches = part["anyOf"]
                nested = (one for one in branches if one.get("type") in (None, "array", "object"))
                part = next(nested, branches[0])
        if isinstance(step, str):
            part = part.get("properties", {}).get(step, part)
        elif isinstance(step, int):
            part = part.get("items") or part["prefixItems"][step]
    return part


def _located(where: str, text: str) -> str:
    return text if not where or text.startswith(where) else f"{where}: {text}"


def _joined(where: str, step: Step) -> str:
    if isinstance(step, int):
        return f"{where}[{step}]"
    return f"{where}.{step}" if where else step


def _shown(node: yaml.Node | None) -> str:
    if isinstance(node, yaml.ScalarNode):
        return f"'{node.value}'" if node.value else "nothing"
    if isinstance(node, yaml.SequenceNode):
        return f"a list of {len(node.value)}"
    return "a mapping" if node is not None else "nothing"
