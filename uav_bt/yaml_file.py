"""YAML files as typed values: all problems of a file at once, each with its line.

The form of a file is a dataclass (or another type for pydantic). pydantic checks the values; PyYAML
gives the lines. Further checks go into `__post_init__` of the dataclass and raise ValueRangeError:

    @dataclass(frozen=True, kw_only=True)
    class Room:
        width_m: Annotated[float, Field(gt=0.0)]
        doors: tuple[str, ...] = ()

    room = read_yaml(Path("room.yaml"), Room, "room file").value
"""

from __future__ import annotations

import functools
import json
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Generic, TypeVar, cast

import yaml
from pydantic import ConfigDict, TypeAdapter, ValidationError
from pydantic_core import ErrorDetails

from uav_bt.errors import FileError, InputError, did_you_mean
from uav_bt.files import did_you_mean_file, read_bounded, reading
from uav_bt.yaml_values import BoundedLoader, Places, RefusedValueError, Steps, located

T = TypeVar("T")

MAX_BYTES: Final = 250_000  # a site or a scene has one thousand
_MAX_PROBLEMS: Final = 50
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
    """The content of a file, with the line of each value; `failure` makes the errors."""

    path: Path
    value: T
    places: Places
    failure: type[FileError]

    def line(self, *steps: str | int) -> int:
        """Return the line of a value, given by keys and indices."""
        return self.places.line(steps)

    @contextmanager
    def at(self, *steps: str | int) -> Iterator[None]:
        """Give errors of a block the line of a value, given by keys and indices."""
        try:
            yield
        except InputError as error:
            raise self.error(str(error), *steps) from error

    def error(self, message: str, *steps: str | int) -> FileError:
        """Return an error about a value, given by keys and indices."""
        return self.failure(self.path, located(steps, message), self.line(*steps))


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
        form: the type of its content; other keys are refused.
        what: the kind of file, for messages.
        failure: class of the error, which has one line per problem.
        remedy: advice for a missing file.
    """
    with reading(path, failure):
        if not path.exists():
            raise failure(
                path,
                f"there is no such {what}{did_you_mean_file(path)}{'; ' if remedy else ''}{remedy}",
            )
        text = read_bounded(path, MAX_BYTES, failure).decode()
    places = Places()
    try:
        root = yaml.compose(text, Loader=BoundedLoader)
        content = {} if root is None else places.plain(root, ())
        # JSON's strict mode takes lists for tuples and texts for paths, but no number for a text.
        validated = _adapter(cast("Any", form)).validate_json(
            json.dumps([content]), context={"folder": path.parent}
        )
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = mark.line + 1 if mark is not None else None
        ours = isinstance(error, RefusedValueError)
        text = f"{'' if ours else 'not valid YAML: '}{error.problem}"
        raise failure(path, text, line) from error
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        reason = f"the character #x{error.character:04x} is not allowed"
        raise failure(path, f"not valid YAML: {reason}", line) from error
    except yaml.YAMLError as error:
        raise failure(path, f"not valid YAML: {error}") from error
    except ValidationError as error:
        first, *others = _problems(places, error, form)
        lines = [first[1], *(f"{path}:{line}: {text}" for line, text in others[:_MAX_PROBLEMS])]
        if len(others) > _MAX_PROBLEMS:
            lines.append(f"and {len(others) - _MAX_PROBLEMS} problems more")
        raise failure(path, "\n".join(lines), first[0]) from error
    return YamlFile(path, validated[0], places, failure)


@functools.cache
def _adapter(form: Any) -> TypeAdapter[tuple[Any]]:
    # A dataclass takes no config from outside, but an element of a tuple inherits the tuple's.
    config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)
    one: Any = tuple[form]
    return TypeAdapter(one, config=config)


# --- pydantic's errors as problems ----------------------------------------------------------------


def _problems(places: Places, error: ValidationError, form: Any) -> list[tuple[int, str]]:
    """Return lines and texts of all problems, in the order of the lines."""
    expected: dict[Steps, list[str]] = {}  # all branches of a union fail at one place
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
        elif kind == "json_invalid":  # nested too deeply, or half a surrogate pair
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
    lines = [(places.line(steps), located(steps, text)) for steps, text in found]
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


@functools.cache
def _schema(form: Any) -> dict[str, Any]:
    return TypeAdapter(form).json_schema()


def _form_at(form: Any, steps: Steps) -> dict[str, Any]:
    """Return the JSON schema at a place."""
    part = whole = _schema(form)
    for step in (*steps, None):
        while "$ref" in part or "anyOf" in part:
            if "$ref" in part:
                part = whole["$defs"][part["$ref"].rpartition("/")[2]]
            else:
                branches = part["anyOf"]
                nested = (one for one in branches if one.get("type") in (None, "array", "object"))
                part = next(nested, branches[0])
        if isinstance(step, str):
            others = part.get("additionalProperties")  # values of a mapping with any keys
            others = others if isinstance(others, dict) else part
            part = part.get("properties", {}).get(step, others)
        elif isinstance(step, int):
            part = part.get("items") or part["prefixItems"][step]
    return part
