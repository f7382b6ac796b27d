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
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Generic, TypeVar, cast

import yaml
from pydantic import ConfigDict, TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from uav_bt.errors import FileError, did_you_mean
from uav_bt.files import reading

T = TypeVar("T")
Steps = tuple[str | int, ...]  # keys of mappings and indices of lists that lead to a value

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


@dataclass(frozen=True)
class YamlFile(Generic[T]):
    """The content of a file, with the line of each value.

    Attributes:
        path: the file.
        value: its content.
        places: all its values.
        failure: what `error` returns.
    """

    path: Path
    value: T
    places: _Places
    failure: type[FileError]

    def line(self, *steps: str | int) -> int:
        """Return the line of a value, by the keys and indices that lead to it."""
        return self.places.line(steps)

    def error(self, message: str, *steps: str | int) -> FileError:
        """Return an error about a value, by the keys and indices that lead to it."""
        return self.failure(self.path, _located(steps, message), self.line(*steps))


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
    places = _Places()
    try:
        root = yaml.compose(text, Loader=yaml.SafeLoader)
        content = {} if root is None else places.plain(root, ())
        # JSON in strict mode: lists for tuples, texts for paths, but no number for a text.
        validated = _adapter(cast("Any", form)).validate_json(
            json.dumps([content]), context={"folder": path.parent}
        )
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = mark.line + 1 if mark is not None else None
        ours = isinstance(error, _Refused)
        text = f"{'' if ours else 'not valid YAML: '}{error.problem}"
        raise failure(path, text, line) from error
    except (yaml.YAMLError, RecursionError) as error:
        raise failure(path, f"not valid YAML: {error}") from error
    except ValidationError as error:
        first, *others = _problems(places, error, form)
        lines = [first[1], *(f"{path}:{line}: {text}" for line, text in others)]
        raise failure(path, "\n".join(lines), first[0]) from error
    return YamlFile(path, validated[0], places, failure)


@functools.cache
def _adapter(form: Any) -> TypeAdapter[tuple[Any]]:
    # A dataclass cannot be given a config from outside; what stands in a tuple inherits it.
    config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)
    one: Any = tuple[form]
    return TypeAdapter(one, config=config)


# --- the values of a file -------------------------------------------------------------------------


class _Refused(yaml.MarkedYAMLError):
    """A value that no form has."""

    def __init__(self, node: yaml.Node, steps: Steps, text: str) -> None:
        super().__init__(problem=_located(steps, text), problem_mark=node.start_mark)


class _Places:
    """The line of each value of a file, and the value in words."""

    def __init__(self) -> None:
        self._construct = yaml.constructor.SafeConstructor()
        self._found: dict[Steps, tuple[int, str]] = {(): (1, "nothing")}  # line, in words

    def line(self, steps: Steps) -> int:
        return self._found[self.known(steps)][0]

    def shown(self, steps: Steps) -> str:
        return self._found[self.known(steps)][1]

    def known(self, steps: Steps) -> Steps:
        """Return the steps that exist: no missing key, no name that pydantic gives a branch."""
        known: Steps = ()
        for step in steps:
            known = (*known, step) if (*known, step) in self._found else known
        return known

    def plain(self, node: yaml.Node, steps: Steps, key: yaml.Node | None = None) -> Any:
        """Return a node as numbers, texts, lists and mappings; nothing else is made of it."""
        if len(self._found) > _MAX_VALUES:
            raise _Refused(node, (), f"more than {_MAX_VALUES} values, aliases unfolded")
        self._found[steps] = ((key or node).start_mark.line + 1, _shown(node))
        if isinstance(node, yaml.ScalarNode):
            return self._scalar(node, steps)
        if node.tag not in _COLLECTIONS:
            raise _Refused(node, (), f"not valid YAML: the tag {node.tag} is not allowed")
        if isinstance(node, yaml.SequenceNode):
            return [self.plain(item, (*steps, index)) for index, item in enumerate(node.value)]
        content: dict[str, Any] = {}
        for name, item in node.value:
            if not isinstance(name, yaml.ScalarNode):
                raise _Refused(name, steps, "expected a name before the colon")
            if name.value in content:
                raise _Refused(name, steps, f"the key '{name.value}' is given twice")
            content[name.value] = self.plain(item, (*steps, name.value), name)
        return content

    def _scalar(self, node: yaml.ScalarNode, steps: Steps) -> bool | float | str | None:
        try:
            value = self._construct.construct_object(node)
        except ValueError as error:  # the 45th of May
            raise _Refused(node, steps, f"{error}, got {_shown(node)}") from error
        if value is None or isinstance(value, bool | int | float | str):
            return value
        expected = "expected a number, a text, true or false"
        raise _Refused(node, steps, f"{expected}, got {_shown(node)}")


def _shown(node: yaml.Node) -> str:
    if isinstance(node, yaml.ScalarNode):
        return f"'{node.value}'" if node.value else "nothing"
    return f"a list of {len(node.value)}" if isinstance(node, yaml.SequenceNode) else "a mapping"


def _located(steps: Steps, text: str) -> str:
    where = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in steps)[1:]
    return text if not where or text.startswith(where) else f"{where}: {text}"


# --- what pydantic finds wrong with them ----------------------------------------------------------


def _problems(places: _Places, error: ValidationError, form: Any) -> list[tuple[int, str]]:
    """Return lines and texts of all problems, in the order of the lines."""
    expected: dict[Steps, list[str]] = {}  # the branches of a union fail at one place
    found: list[tuple[Steps, str]] = []
    for item in error.errors(include_url=False):
        kind, steps = item["type"], item["loc"][1:]
        known = places.known(steps)
        if kind == "missing" and isinstance(steps[-1], str):
            found.append((known, f"lacks the key '{steps[-1]}'"))
        elif kind in ("unexpected_keyword_argument", "extra_forbidden"):
            keys = list(_form_at(form, steps[:-1])["properties"])
            hint = did_you_mean(str(steps[-1]), keys)
            found.append((known, f"unknown key{hint} (known: {', '.join(keys)})"))
        elif kind == "value_error":
            found.append((known, str(item["ctx"]["error"])))
        elif kind == "json_invalid":  # nested too deeply, half a surrogate pair
            found.append((known, f"not valid YAML: {item['ctx']['error']}"))
        elif steps[-1:] == ("[key]",):
            found.append((known, f"expected {_expected(item, form)} as key, got '{steps[-2]}'"))
        else:
            expected.setdefault(known, []).append(_expected(item, form))
    reached = [*expected, *(steps for steps, _ in found)]
    for steps, words in expected.items():
        # The branch that matched deepest has the most specific error.
        if not any(len(one) > len(steps) and one[: len(steps)] == steps for one in reached):
            text = " or ".join(dict.fromkeys(words))
            found.append((steps, f"expected {text}, got {places.shown(steps)}"))
    lines = [(places.line(steps), _located(steps, text)) for steps, text in found]
    return sorted(dict.fromkeys(lines), key=lambda line: line[0])


def _expected(item: ErrorDetails, form: Any) -> str:
    kind, steps = item["type"], item["loc"][1:]
    if kind == "missing":
        return f"a list of {_form_at(form, steps[:-1]).get('minItems', 'more')}"
    if kind in ("too_short", "too_long"):
        bound = ("least", "min_length") if kind == "too_short" else ("most", "max_length")
        return f"a list of at {bound[0]} {item['ctx'][bound[1]]}"
    if kind in ("dict_type", "dataclass_type"):
        keys = ", ".join(_form_at(form, steps).get("properties", ()))
        return f"a mapping with {keys}" if keys else "a mapping"
    words = _EXPECTED.get(kind, item["msg"].removeprefix("Input should be "))
    return f"a number {words}" if "than" in kind else words


def _form_at(form: Any, steps: Steps) -> dict[str, Any]:
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
